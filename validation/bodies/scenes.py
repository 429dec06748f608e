"""The paper's scenes as plain numbers. Units: cell size h = 1, force F = 1, Young's modulus E0 = 1.

Compliance then comes in F^2 / E0 (per unit thickness), displacement in F / E0 and stress in F / h. What the paper
leaves open (where the tip force acts, the filter's radius, rho_min, the meaning of E_min) is an argument; the defaults
are our choice.
"""

from dataclasses import fields, replace
from typing import Any, Literal

import numpy as np

from mpmtop.body import Body, Material, Support
from mpmtop.criteria import PNormStress
from mpmtop.design import Design
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.region import Circle, Difference, Rectangle, Region
from mpmtop.scene import Scene

H = 1.0
"""Background cell size h."""
SPACING = 0.5 * H
"""Distance of neighbouring points, two per cell and direction."""

TipLoad = Literal["mid-height", "bottom corner"]


def changed(scene: Scene, **changes: Any) -> Scene:
    """The scene with other numbers, by the names of the fields of its body, its design and its own."""
    parts = {
        part: replace(getattr(scene, part), **{f.name: changes.pop(f.name) for f in fields(of) if f.name in changes})
        for part, of in (("body", Body), ("design", Design))
    }
    return replace(scene, **parts, **changes)


CLAMP = Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)))
"""A left edge at x = 0, held."""
SOLID = Material(young=1.0, poisson=0.3, plane="strain")
"""In every scene of the paper."""


def cantilever(load: TipLoad = "mid-height", radius: float = 3 * SPACING, **changes: Any) -> Scene:
    """Fig. 7a: 40h x 20h, left edge clamped, unit force down at the right edge, shared by the six nearest points."""
    tip = {"mid-height": (40.0, 10.0), "bottom corner": (40.0, 0.0)}[load]
    domain = Rectangle((0.0, 0.0), (40.0, 20.0))
    body = Body(domain, (CLAMP,), (PointLoad(tip, (0.0, -1.0), points=6),), SOLID)
    return changed(Scene(f"cantilever, load at {load}", body, Design(0.4, radius)), **changes)


def extended_cantilever() -> Scene:
    """The cantilever, continued 2h behind its clamp and beyond its tip, with the force at the tip's place on the grid.

    The same body on the same supports for any shift of its points in x by less than 2h.
    """
    return changed(
        cantilever(),
        name="cantilever, extended",
        domain=Rectangle((-2.0, 0.0), (42.0, 20.0)),
        loads=(PositionLoad((40.0, 10.0), (0.0, -1.0)),),
    )


CORNER = (20.0, 20.0)
"""Re-entrant corner of the L-bracket."""


def l_bracket(radius: float = 2 * SPACING, **changes: Any) -> Scene:
    """Fig. 7b: arms 20h wide in a 50h square, top edge clamped, unit force down at the lower arm's top right corner.

    The p-norm of the relaxed stress is minimised, p = 12 and q = 0.5.
    """
    size = 50.0
    domain = Difference(Rectangle((0.0, 0.0), (size, size)), Rectangle(CORNER, (size, size)))
    top = Support(Rectangle((-np.inf, size), (np.inf, np.inf)))
    body = Body(domain, (top,), (PointLoad((size, CORNER[1]), (0.0, -1.0), points=6),), SOLID)
    return changed(Scene("L-bracket", body, Design(0.4, radius), PNormStress(p=12.0, q=0.5)), **changes)


def toy_cantilever(width: float = 4.0, height: float = 1.0) -> Scene:
    """Fig. 3: four cells of 2 x 2 points, left edge clamped, unit force down on the lower right point."""
    corner = PointLoad((width - SPACING / 2, SPACING / 2), (0.0, -1.0), points=1)
    body = Body(Rectangle((0.0, 0.0), (width, height)), (CLAMP,), (corner,), SOLID)
    return Scene(f"toy cantilever, {width:g} x {height:g} cells", body, Design(0.4, SPACING))


HOLE = Circle((15.0, 15.0), 10.0)
"""The hole of Fig. 16, in units of h = 1 mm."""


def perforated(hole: Region = HOLE, *, absent: bool, **changes: Any) -> Scene:
    """Fig. 16: 45h x 30h, left edge clamped, unit force down at the lower right corner, and a hole.

    The hole is cut out of the domain (`absent`), or is passive void. Load and hole are those of Sigmund (2001), Struct.
    Multidisc. Optim. 21:120, Sect. 4.3, which the paper refers to.
    """
    plate = Rectangle((0.0, 0.0), (45.0, 30.0))
    domain = Difference(plate, hole) if absent else plate
    body = Body(domain, (CLAMP,), (PointLoad((45.0, 0.0), (0.0, -1.0), points=6),), SOLID)
    design = Design(0.4, 3 * SPACING, passive_void=None if absent else hole)
    return changed(Scene("cantilever with a hole", body, design), **changes)


def distributed_load(radius: float = 1.0, depth: float = 1 / 3) -> Scene:
    """Fig. 18: 30h x 15h, left edge clamped, a unit force spread over the points of the body's upper edge.

    They are those above a depth, h/3: a row of coarse points or two rows of fine ones.
    """
    edge = RegionLoad(Rectangle((0.0, 15.0 - depth), (30.0, 15.0)), (0.0, -1.0))
    body = Body(Rectangle((0.0, 0.0), (30.0, 15.0)), (CLAMP,), (edge,), SOLID)
    return Scene("cantilever, distributed load", body, Design(0.4, radius))

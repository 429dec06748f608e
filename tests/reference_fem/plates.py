"""A plate with a hole: its mesh, scene, areas and edges."""

import numpy as np
from skfem import MeshQuad

from mpmtop.arrays import Array
from mpmtop.body import Body, Support
from mpmtop.design import Design
from mpmtop.loads import PointLoad, RegionLoad
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.scene import Scene
from reference_fem.hole import around_hole
from validation.bodies.scenes import changed

BODY, HOLE = Rectangle((0, 0), (45, 30)), Circle((15, 15), 10)


def plate(size: float) -> MeshQuad:
    """The paper's rectangle of 45 x 30 with a hole of radius 10."""
    return around_hole((0, 0), (45, 30), (15, 15), 10, size)


def cantilever(load: PointLoad | RegionLoad | None = None, **changes: object) -> Scene:
    """The same, clamped on the left and pulled down in the middle of the right edge."""
    left = Support(Rectangle((0, 0), (0, 30)))
    body = Body(Difference(BODY, HOLE), (left,), (load or PointLoad((45, 15), (0, -1)),))
    return changed(Scene("cantilever with a hole", body, Design(0.4, 4.0)), **changes)


def corner_areas(mesh: MeshQuad) -> Array:
    """Signed areas (4, e) of the triangles that each corner forms with its two neighbours, from determinants."""
    corners = mesh.p[:, mesh.t]
    triangles = np.stack([np.roll(corners, k, axis=1) for k in (1, 0, -1)])  # (3, 2, 4, e)
    rows = np.concatenate([triangles, np.ones_like(triangles[:, :1])], axis=1)
    return np.linalg.det(np.moveaxis(rows, (0, 1), (-2, -1))) / 2


def area(mesh: MeshQuad) -> float:
    return float(corner_areas(mesh)[[0, 2]].sum())  # two triangles are the quad


def edges_of(mesh: MeshQuad) -> tuple[Array, Array]:
    """Node pairs (2, f) of all edges, and how many elements each has (f,)."""
    pairs = np.sort(np.stack([mesh.t, np.roll(mesh.t, -1, axis=0)]).reshape(2, -1), axis=0)
    return np.unique(pairs, axis=1, return_counts=True)

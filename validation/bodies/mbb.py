"""Half of an MBB beam, the scene of the published optimality-criteria codes."""

from mpmtop.body import Body, Material, Support
from mpmtop.design import Design
from mpmtop.loads import PositionLoad
from mpmtop.region import Rectangle
from mpmtop.scene import Scene


def half_mbb(width: float = 60.0, height: float = 20.0, radius: float = 2.4) -> Scene:
    """Symmetry along the left edge, a roller at the lower right corner, unit force down at the upper left one; half of
    the volume, plane stress. Source: E. Andreassen et al., Struct. Multidisc. Optim. 43 (2011) 1, Sect. 2."""
    symmetry = Support(Rectangle((0.0, 0.0), (0.0, height)), (True, False))
    roller = Support(Rectangle((width, 0.0), (width, 0.0)), (False, True))
    body = Body(
        Rectangle((0.0, 0.0), (width, height)),
        (symmetry, roller),
        (PositionLoad((0.0, height), (0.0, -1.0)),),
        Material(1.0, 0.3, "stress"),
    )
    return Scene("half MBB beam", body, Design(0.5, radius, rho_min=0.0))

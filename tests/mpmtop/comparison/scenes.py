"""A scene that is compared in a second, and files that make one or do not."""

from mpmtop import Body, Design, PointLoad, Rectangle, Scene, Support

SMALL = """
from mpmtop import Body, Design, PointLoad, Rectangle, Scene, Support

clamp = Support(Rectangle((-1.0, 0.0), (0.0, 4.0)))
body = Body(Rectangle((0.0, 0.0), (8.0, 4.0)), (clamp,), (PointLoad((8.0, 2.0), (0.0, -1.0)),))
scene = Scene("small beam", body, Design(0.4, 1.5))
h = 1.0
iterations = 40
methods = ("fem", "mpm", "gimp")
"""

CLAMP = Support(Rectangle((-1.0, 0.0), (0.0, 4.0)))
BODY = Body(Rectangle((0.0, 0.0), (8.0, 4.0)), (CLAMP,), (PointLoad((8.0, 2.0), (0.0, -1.0)),))
BEAM = Scene("small beam", BODY, Design(0.4, 1.5))

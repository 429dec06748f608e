"""A footbridge: a deck that carries people, a hole to pass through, half of the rest to be left out.

`python -m mpmtop compare bridge.py` says which method to trust with it. Lengths are in m, forces in kN, moduli in kPa;
any consistent units will do. Change what you like: the file has to end with one `Scene`.
"""

from mpmtop import Body, Circle, Design, Difference, Material, Rectangle, RegionLoad, Scene, Support

length, height, deck = 12.0, 4.0, 0.4

# The domain may be a Rectangle, Circle, Polygon, HalfPlane or LevelSet, or made of them.
opening = Circle((6.0, 1.2), 0.8)
domain = Difference(Rectangle((0.0, 0.0), (length, height)), opening)

# A support holds what lies in a region, in both components or in one: here a hinge and a roller.
supports = (
    Support(Rectangle((0.0, 0.0), (0.6, 0.0))),
    Support(Rectangle((length - 0.6, 0.0), (length, 0.0)), fixed=(False, True)),
)

# 5 kN per metre of deck, spread over its points.
on_deck = Rectangle((0.0, height - deck), (length, height))
loads = (RegionLoad(on_deck, (0.0, -5.0 * length)),)

body = Body(domain, supports, loads, Material(young=2.1e8, poisson=0.3, plane="stress"))

# 40 % of the body may be material. The deck stays. The filter radius is the thinnest bar, about: a cell at least.
design = Design(volume_fraction=0.4, filter_radius=0.3, passive_solid=on_deck)

scene = Scene("Bridge with a deck and a hole", body, design)

# How it is compared; each line may go, and the command line overrides it.
h = 0.2  # side of a cell; without it there are about 3,200 points
crossing = ("none", "periodic(4, 0.26)")  # points as seeded, and moved over the lines of the grid

"""A wall bracket that is pulled down or pushed sideways, never both at once: two load cases, the worse one counts.

`python -m mpmtop compare bracket.py` says which method to trust with it.
"""

from mpmtop import (
    MMA,
    Body,
    Circle,
    Compliance,
    Design,
    LoadCase,
    Polygon,
    Rectangle,
    RegionLoad,
    Scene,
    Support,
    Worst,
)

# A triangle without its tip: screwed to the wall on the left, the eye on the right.
outline = Polygon(((0.0, 0.0), (4.0, 0.0), (16.0, 6.0), (16.0, 10.0), (0.0, 10.0)))
wall = Support(Rectangle((0.0, 0.0), (0.0, 10.0)))
eye = Circle((14.5, 8.5), 1.0)

down = LoadCase((RegionLoad(eye, (0.0, -1.0)),))
sideways = LoadCase((RegionLoad(eye, (2.0, 0.0)),))

body = Body(outline, (wall,))
design = Design(volume_fraction=0.35, filter_radius=0.75, passive_solid=eye)
scene = Scene("Bracket with two load cases", body, design, objective=Worst(Compliance()), cases=(down, sideways))

h = 0.5
rule = MMA(move=0.2)  # for the largest of several values
iterations = 30  # a first look; without this line a run goes on until it has converged

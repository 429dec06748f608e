"""A force inverter: pushed to the right at its left end, its right end is to move to the left. Half of it, mirrored.

`python -m mpmtop compare inverter.py` says which method to trust with it. The objective is the output's displacement,
negative where the mechanism inverts: the lower, the better.
"""

from mpmtop import MMA, Body, Design, Displacement, Material, PositionLoad, Rectangle, Scene, Spring, Support

length, height = 40.0, 20.0  # the lower half; the axis of symmetry is its upper side
pushed, moved = (0.0, height), (length, height)

corner = Support(Rectangle((0.0, 0.0), (0.0, 1.0)))
axis = Support(Rectangle((0.0, height), (length, height)), fixed=(False, True))
# The actuator and the workpiece are as stiff as springs; without them the best mechanism is none.
actuator = Spring(pushed, stiffness=0.1, direction=(1.0, 0.0))
piece = Spring(moved, stiffness=0.1, direction=(1.0, 0.0))

body = Body(
    Rectangle((0.0, 0.0), (length, height)),
    (corner, axis, actuator, piece),
    (PositionLoad(pushed, (1.0, 0.0)),),
    Material(plane="stress"),
)
design = Design(volume_fraction=0.3, filter_radius=1.5)
scene = Scene("Force inverter", body, design, objective=Displacement(moved, (1.0, 0.0)))

h = 1.0
rule = MMA(move=0.1)  # a mechanism is found by small steps
iterations = 30  # a first look; without this line a run goes on until it has converged

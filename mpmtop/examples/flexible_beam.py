"""A beam that bends far: in large deformation, in load steps, points cross the lines of the grid by themselves.

`python -m mpmtop compare flexible_beam.py` says which method to trust with it.
"""

from mpmtop import Body, Design, Rectangle, RegionLoad, Scene, Support

clamp = Support(Rectangle((0.0, 0.0), (0.0, 8.0)))
tip = Rectangle((30.0, 3.0), (32.0, 5.0))

# Dead loads that points carry with them; what carries them has to stay solid.
body = Body(Rectangle((0.0, 0.0), (32.0, 8.0)), (clamp,), (RegionLoad(tip, (0.0, -0.006)),))
design = Design(volume_fraction=0.5, filter_radius=1.5, passive_solid=tip)
scene = Scene("Beam in large deformation", body, design)

h = 1.0
load_steps = 4
iterations = 12  # a first look: each of them is as dear as all of its load steps

"""A hook that was scanned: its body is a list of points in a file beside this one, `scanned_hook.csv`, columns x and y.

`python -m mpmtop compare scanned_hook.py` says which method to trust with it. A VTU file that another run has written
can be read in the same way.
"""

from pathlib import Path

from mpmtop import Body, Design, Rectangle, RegionLoad, Scene, Support, read_cloud

hook = read_cloud(Path(__file__).with_name("scanned_hook.csv"))
lower, upper = hook.bounds

held = Support(Rectangle((lower[0], upper[1]), (upper[0], upper[1])))
seat = Rectangle((7.0, 2.0), (11.0, 3.0))  # where the weight hangs, inside the bend
body = Body(hook, (held,), (RegionLoad(seat, (0.0, -1.0)),))
design = Design(volume_fraction=0.6, filter_radius=0.6, passive_solid=seat)
scene = Scene("Hook from a list of points", body, design)

h = 0.5
iterations = 30  # a first look; without this line a run goes on until it has converged

"""Sketches of bodies show what acts on them and what they are made of."""

import matplotlib.pyplot as plt

from mpmtop.body import Body, EdgeSupport, Material, Part, Support
from mpmtop.loads import PositionLoad, Pressure, RegionLoad, Traction
from mpmtop.points import seed
from mpmtop.region import Rectangle
from validation.bodies.sketch import draw

BOX = Rectangle((0, 0), (4, 2))


def test_parts_and_loads_of_every_kind() -> None:
    """A hatched area for each part, one arrow for a force, seven for a region, and some along the outline."""
    layers = tuple(Part(Rectangle((0, y), (4, y + 1)), Material(10.0 + y)) for y in (0, 1))
    count = {}
    for name, load in {
        "position": PositionLoad((4, 1), (0, -1)),
        "region": RegionLoad(Rectangle((3, 0), (4, 2)), (0, -1)),
        "pressure": Pressure(Rectangle((0, 2), (4, 2)), 1.0),
        "traction": Traction(Rectangle((4, 0), (4, 2)), lambda x: 0 * x + [1, 0]),
    }.items():
        supports = (Support(Rectangle((-1, 0), (0, 2))), EdgeSupport(Rectangle((0, 0), (4, 0))))
        figure = draw(Body(BOX, supports, (load,), parts=layers), seed(BOX, (0.5, 0.5)), 1.0)
        ax = figure.axes[0]
        hatched = [getattr(c, "hatches", [None])[0] for c in ax.collections]
        assert [hatch for hatch in hatched if hatch] == ["//", "xx"]
        count[name] = len(ax.texts)
        plt.close(figure)
    assert (count["position"], count["region"]) == (1, 7) and min(count["pressure"], count["traction"]) >= 4

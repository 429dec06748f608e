"""Cell crossing: what it makes of designs, on a slider."""

import pytest

from validation.harness.report import Report
from validation.studies.crossing.designs import CROSSES, PLACES, slide

# points are moved over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")


@pytest.mark.benchmark
def test_slide(report: Report) -> None:
    """Designs as points are pushed over a boundary

    The cantilever optimised anew for every distance by which the points left of one in four cell boundaries have
    moved. Up to 0.25 h none of them is in another cell.
    """
    own = slide(report)
    before = int((PLACES < CROSSES).sum()) - 1
    jump = {name: float(values[before + 1] / values[before] - 1) for name, values in own.items()}
    report.found(
        f"As points cross, from {PLACES[before]:g} to {PLACES[before + 1]:g} h, the optimised compliance changes by "
        f"{jump['standard']:+.1%} with standard MPM and {jump['GIMP']:+.1%} with GIMP."
    )
    assert report.check(
        "change of the optimised compliance as points cross, GIMP less standard",
        jump["GIMP"] - jump["standard"],
        at_most=0.0,
        source="GIMP's functions do not notice the boundary",
    )

"""What is wrong in a criterion, a constraint, a load case, a projection or a symmetry is named."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mpmtop.body import Support
from mpmtop.criteria import AtMost, Compliance, Displacement, PNormStress, Response, Sensitivity, Volume, Worst
from mpmtop.design import Mirror, Projection
from mpmtop.loads import PositionLoad
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase
from tests.mpmtop.test_criteria import ALONG, CASES, DESIGN, LIMITS, TIP, Own, problem

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies of a few cells


@dataclass(frozen=True)
class Wrong(Own):
    def gradient(self, at: Response) -> Sensitivity:
        return Sensitivity(displacement=np.zeros(3))


@dataclass(frozen=True)
class PointWise(Own):
    def value(self, at: Response) -> float:
        return at.volume  # type: ignore[return-value]


@dataclass(frozen=True)
class Silent(Own):
    def value(self, at: Response) -> float:
        return None  # type: ignore[return-value]


@dataclass(frozen=True)
class OneArray(Own):
    def gradient(self, at: Response) -> Sensitivity:
        return at.rho  # type: ignore[return-value]


WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "beta": (lambda: Projection(0.0), "beta 0.0 of a projection"),
    "beta, infinite": (lambda: Projection(np.inf), "beta inf"),
    "threshold": (lambda: Projection(1.0, 1.2), "threshold 1.2"),
    "both": (lambda: Projection(1.0, 0.4, True), "leave `threshold` out"),
    "flag": (lambda: Projection(1.0, preserve_volume="yes"), "say True or False"),  # type: ignore[arg-type]
    "no projection": (lambda: replace(DESIGN, projection=4.0), "give Projection"),  # type: ignore[arg-type]
    "mirror": (lambda: Mirror((0, 1), (0, 0)), "normal"),
    "mirror, three numbers": (lambda: Mirror((0, 1, 2), (0, 1)), "two finite numbers"),  # type: ignore[arg-type]
    "symmetry": (lambda: replace(DESIGN, symmetry=Mirror((0, 1), (0, 1))), "tuple of Mirror"),  # type: ignore[arg-type]
    "direction": (lambda: Displacement((1, 1), (0, 0)), "direction"),
    "place": (lambda: Displacement("tip", (0, 1)), "place of a displacement"),  # type: ignore[arg-type]
    "bound": (lambda: AtMost(Compliance(), np.nan), "bound nan"),
    "bound 0": (lambda: AtMost(ALONG, 0.0), "give a `scale`"),
    "scale": (lambda: AtMost(ALONG, 0.0, -1.0), "scale -1.0"),
    "case": (lambda: AtMost(ALONG, 1.0, case=-1), "number of a load case"),
    "criterion": (lambda: AtMost("stress", 1.0), "with `value` and `gradient`"),  # type: ignore[arg-type]
    "a class": (lambda: AtMost(Compliance, 1.0), "with `value` and `gradient`"),  # type: ignore[arg-type]
    "stress weight": (lambda: PNormStress(weight="area"), "stress weight"),  # type: ignore[arg-type]
    "weight": (lambda: LoadCase((TIP,), -1.0), "weight -1.0 of a load case"),
    "loads": (lambda: LoadCase(TIP), "give a tuple"),  # type: ignore[arg-type]
    "no weight": (lambda: problem(cases=(LoadCase((TIP,), 0.0),)), "no load case has a weight"),
    "no load": (lambda: problem(cases=(LoadCase(()),)), "no load"),
    "cases": (lambda: problem(cases=CASES[0]), "tuple of LoadCase"),
    "constraints": (lambda: problem(constraints=(Compliance(),)), "tuple of AtMost"),
    "no such case": (lambda: problem(constraints=(AtMost(ALONG, 1.0, case=3),)), "load case 3 of 3"),
    "worst of one": (lambda: problem(Worst(Compliance()), cases=CASES[:1]), "several load cases"),
    "worst of volume": (lambda: problem(Worst(Volume()), constraints=LIMITS), "several load cases"),
    "worst of nothing": (lambda: Worst(3), "Worst of 3"),  # type: ignore[arg-type]
    "least volume": (lambda: problem(Volume()), "least volume under no constraint"),
    "q": (lambda: problem(constraints=(AtMost(PNormStress(8, 3.0), 1.0),)), "below the penalty"),
    "sensitivity": (lambda: (of := problem(Wrong())).gradient(of.evaluate(of.x0)), "d/ddisplacement has shape"),
    "a value for each point": (lambda: (of := problem(PointWise())).evaluate(of.x0), "PointWise.value is no number"),
    "no value": (lambda: (of := problem(Silent())).evaluate(of.x0), "Silent.value is no number"),
    "an array": (lambda: (of := problem(OneArray())).gradient(of.evaluate(of.x0)), "a ndarray: return a `Sensitivity`"),
    "held": (lambda: problem(cases=(LoadCase((PositionLoad((0.0, 1.0), (1, 0)),)),)), "do no work"),
    "nowhere": (lambda: problem(Displacement((9, 9), (1, 0))), "a load acts at"),
    "no node": (lambda: problem(cases=(LoadCase((TIP,), supports=(Support(Rectangle((8, 8), (9, 9))),)),)), "no node"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(name: str) -> None:
    make, says = WRONG[name]
    with pytest.raises(ValueError, match=says):
        make()

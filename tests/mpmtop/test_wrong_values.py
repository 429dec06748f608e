"""Wrong values at every argument of what a scene is made of, and of a run: named, never NumPy's own errors."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from mpmtop.body import Bed, Body, EdgeSupport, Material, Part, Spring, Support
from mpmtop.criteria import AtLeast, AtMost, Compliance, Displacement, PNormStress, Worst
from mpmtop.design import Design, Mirror, Projection
from mpmtop.grid import Grid
from mpmtop.loads import BodyForce, PointLoad, PositionLoad, Pressure, RegionLoad, Traction, Weight
from mpmtop.model import discretise
from mpmtop.optimizers import (
    GCMMA,
    MMA,
    OptimalityCriteria,
    Stage,
    continuation,
    design_change,
    optimize,
    relative_change,
)
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.region import Circle, Rectangle
from mpmtop.scene import LoadCase, Scene

WRONG: tuple[Any, ...] = (
    *("1", "abc", b"x", 1j, np.nan, np.inf, 10**400),
    *((), (1,), (1, 2, 3), [1, "b"], (None, None), (1j, 0), (np.nan, 1), ((1, 2), (3, 4)), ((1, 2), 3)),
    *(np.array([]), np.zeros((2, 2)), np.array(["a", "b"]), np.array([1, 2], object), np.datetime64("2020-01-01")),
    *({}, {1, 2}, range(3), slice(2), Ellipsis, object(), object),
)
BOX = Rectangle((0, 0), (4, 2))
CLAMP, TIP = Support(Rectangle((-1, 0), (0, 2))), PointLoad((4, 1), (0, -1))
BODY = Body(BOX, (CLAMP,), (TIP,))
DESIGN = Design(0.5, 1.0)
SCENE = Scene("beam", BODY, DESIGN)
PROBLEM = design_problem(SCENE, 1.0)

GOOD: dict[Callable[..., Any], dict[str, Any]] = {
    Material: {"young": 1.0, "poisson": 0.3, "plane": "strain"},
    Part: {"region": BOX, "material": Material()},
    Support: {"region": BOX, "fixed": (True, True), "displacement": (0.0, 0.0)},
    EdgeSupport: {"region": BOX, "direction": (1, 0)},
    Spring: {"position": (4, 1), "stiffness": 1.0, "direction": (1, 0)},
    Bed: {"region": BOX, "stiffness": 1.0, "direction": (1, 0)},
    PointLoad: {"position": (4, 1), "force": (0, -1), "points": 6},
    PositionLoad: {"position": (4, 1), "force": (0, -1)},
    RegionLoad: {"region": BOX, "force": (0, -1)},
    Circle: {"centre": (1, 1), "radius": 1.0},
    Body: {
        "domain": BOX,
        "supports": (CLAMP,),
        "loads": (TIP,),
        "material": Material(),
        "parts": (Part(BOX, Material()),),
    },
    Projection: {"beta": 2.0, "threshold": 0.5, "preserve_volume": False},
    Mirror: {"point": (2, 1), "normal": (0, 1)},
    Design: {"volume_fraction": 0.5, "filter_radius": 1.0, "penal": 3.0, "contrast": 1e-9, "rho_min": 1e-3},
    LoadCase: {"weight": 1.0},
    PNormStress: {"p": 8.0, "q": 0.5, "measure": "von_mises", "weight": "count"},
    Displacement: {"place": (4, 1), "direction": (0, -1)},
    AtMost: {"criterion": Compliance(), "bound": 100.0, "scale": 1.0},
    AtLeast: {"criterion": Compliance(), "bound": 100.0, "scale": 1.0},
    Worst: {"criterion": Compliance()},
    Scene: {"body": BODY, "design": DESIGN, "objective": Compliance()},
    MMA: {"move": 0.3},
    GCMMA: {"move": 0.3, "warm_start": False, "max_inner": 15},
    OptimalityCriteria: {"move": 0.2, "bisection": 1e-3},
    relative_change: {"tol": 1e-4, "window": 4},
    design_change: {"tol": 0.01},
    partial(discretise, BODY): {"h": 1.0, "ppc": 2, "b_bar": False, "cut": False, "ghost": 0.0},
    partial(discretise, BODY, 1.0): {"points": PROBLEM.model.points},
    partial(discretise, BODY, None): {"grid": Grid((0, 0), (1, 1), (4, 2))},
    partial(DesignProblem, PROBLEM.model, DESIGN): {"design_grid": PROBLEM.model.points, "filter_passive": False},
    Stage: {"problem": PROBLEM, "update": MMA(), "max_iterations": 1},
}
REST = {LoadCase: {"loads": (TIP,)}, Scene: {"name": "s"}}


def right(argument: str, value: Any) -> bool:
    """What of the wrong values is none at an argument."""
    whole = argument in ("points", "window", "max_inner", "max_iterations", "checkpoint_every")
    return (
        (whole and isinstance(value, int))
        or (argument in ("tol", "feasible") and isinstance(value, float) and value == np.inf)
        or (argument in ("loads", "parts") and isinstance(value, tuple) and value == ())
        or (argument == "stop" and callable(value))
    )


@pytest.mark.parametrize("make", GOOD, ids=lambda make: getattr(make, "__name__", str(make.__class__.__name__)))
def test_wrong_values_are_named(make: Callable[..., Any]) -> None:
    good = GOOD[make] | REST.get(make, {})
    make(**good)
    for argument in GOOD[make]:
        for value in WRONG:
            if right(argument, value):
                continue
            with pytest.raises(ValueError, match=r"give|say|allow|add one"):  # InvalidScene is one
                make(**good | {argument: value})


@pytest.mark.parametrize("load", [Traction, Pressure, BodyForce, Weight], ids=lambda load: load.__name__)
@pytest.mark.parametrize(
    "wrong", [*WRONG, lambda: 1.0, lambda x: None, lambda x: x[:3], lambda x: [[1], [2, 3]]], ids=lambda w: repr(w)[:20]
)
def test_wrong_forces_are_named(load: Callable[..., Any], wrong: Any) -> None:
    """A function is asked when the body is discretised."""
    place = (Rectangle((4, 0), (4, 2)),) if load in (Traction, Pressure) else ()
    with pytest.raises(ValueError, match=r"give|return|let it take"):
        discretise(Body(BOX, (CLAMP,), (load(*place, wrong),)), 1.0)


@pytest.mark.parametrize("argument", ["start", "levels", "stop", "max_iterations", "feasible", "checkpoint_every"])
def test_wrong_values_of_a_run_are_named(argument: str) -> None:
    for value in WRONG:
        if right(argument, value) or (argument == "levels" and isinstance(value, tuple | list | range)):
            continue  # problems of a list are told by what they lack
        with pytest.raises(ValueError, match=r"give|lie within"):
            list(optimize(PROBLEM, MMA(), **{"max_iterations": 1} | {argument: value}))


def test_wrong_stages_are_named() -> None:
    for wrong in (*WRONG, PROBLEM, [PROBLEM]):
        with pytest.raises(ValueError, match="give a list of one `Stage"):
            list(continuation(wrong))

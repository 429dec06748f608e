"""A shape function or a solver of one's own: what is right runs, what the protocol does not know is named."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pytest

from mpmtop.body import Body, Support
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene
from mpmtop.large_deformation.model import discretise as load_steps
from mpmtop.loads import PointLoad
from mpmtop.model import discretise
from mpmtop.problem import DesignProblem
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase
from mpmtop.shape_functions import Stencil, gimp, tent
from mpmtop.solvers import BandedCholesky, Pattern
from tests.scenes import cantilever

BODY = cantilever(4, 2).body


def given(answer: Callable[[Any], Any]) -> Callable[..., Any]:
    """The tent, but for what it gives."""

    def mine(xi: Any, half_length: Any, tol: float, ends: Any) -> Any:
        return answer(tent(xi, half_length, tol, ends))

    return mine


WRONG_SHAPES: dict[str, tuple[Any, str]] = {
    "takes two": (
        lambda xi, length: tent(xi, length),
        "lambda> failed .* let it take xi .p,., half_length .p,., tol and ends",
    ),
    "gives N alone": (given(lambda s: s.N), r"mine gave \(32, 2\) for 32 points: return a `Stencil`"),
    "gives nothing": (given(lambda s: None), "gave NoneType"),
    "leaves grad_N out": (given(lambda s: s[:2]), r"gave \(32,\), \(32, 2\) for"),
    "nodes first": (given(lambda s: Stencil(s.first, s.N.T, s.grad_N.T)), r"\(2, 32\), \(2, 32\)"),
    "no gradient of the last": (given(lambda s: Stencil(s.first, s.N, s.grad_N[:, :1])), r"\(32, 2\), \(32, 1\)"),
    "first of both axes": (given(lambda s: Stencil(s.first[:, None], s.N, s.grad_N)), r"\(32, 1\), "),
    "first in floats": (given(lambda s: Stencil(1.0 * s.first, s.N, s.grad_N)), "whole numbers"),
    "not a number": (given(lambda s: Stencil(s.first, s.N, np.nan * s.grad_N)), "finite"),
    "lists": (given(lambda s: Stencil(s.first, s.N.tolist(), s.grad_N)), "gave .32,., list, .32, 2."),
    "nameless": (partial(gimp, tol=0.0), "give a function by name, such as tent"),
}


@pytest.mark.parametrize("kind", WRONG_SHAPES)
def test_a_shape_function_that_is_none_is_named(kind: str) -> None:
    function, message = WRONG_SHAPES[kind]
    with pytest.raises(InvalidScene, match=message):
        discretise(BODY, 1.0, shape_function=function)


def test_load_steps_take_none_of_ones_own() -> None:
    with pytest.raises(InvalidScene, match=r"large deformation with functools\.partial.* use tent, gimp or bspline2"):
        load_steps(BODY, 1.0, shape_function=partial(gimp))  # type: ignore[arg-type]


def test_a_shape_function_keeps_its_own_error() -> None:
    """GIMP says itself what is wrong with domains wider than a cell."""
    with pytest.raises(ValueError, match="GIMP: a point's domain is"):
        discretise(BODY, 2.0, shape_function=lambda xi, length, tol, ends: gimp(xi, 4 * length, tol, ends))


class Plain:
    """A solver as a user writes it: dense, no dataclass."""

    tolerance = 1e-9

    def __init__(self, pattern: Pattern) -> None:
        self.pattern = pattern

    def factor(self, data: Any, tolerance: float | None = None) -> Any:
        K = np.zeros((self.pattern.m, self.pattern.m))
        K[self.pattern.row, self.pattern.col] = K[self.pattern.col, self.pattern.row] = data
        return lambda b: np.linalg.solve(K, b)


@dataclass(frozen=True)
class Answers:
    """Cholesky's method, but for its answer."""

    pattern: Pattern
    answer: Any = None
    tolerance: float = 1e-9

    def factor(self, data: Any, tolerance: float | None = None) -> Any:
        solve = BandedCholesky(self.pattern).factor(data)
        return lambda b: self.answer(solve(b))


class OfOne(Plain):
    def factor(self, data: Any) -> Any:  # type: ignore[override]
        return super().factor(data)


class GivesX(Plain):
    def factor(self, data: Any, tolerance: float | None = None) -> Any:
        return super().factor(data)(np.ones(self.pattern.m))


class Endless(Plain):
    tolerance = 0.0


WRONG_SOLVERS: dict[str, tuple[Any, str]] = {
    "takes nothing": (lambda: None, "let it take a `Pattern`"),
    "a matrix": (lambda pattern: np.eye(pattern.m), r"return an object with `factor\(data, tolerance\)`"),
    "no tolerance": (Endless, "a positive `tolerance`"),
    "factor of one": (OfOne, r"OfOne.factor failed .* let it take \(data, tolerance\)"),
    "factor solves": (GivesX, "GivesX.factor gave a ndarray: return a function that solves K x = b"),
    "a column": (partial(Answers, answer=lambda x: x[:, None]), r"answered \(24, 1\) to b \(24,\)"),
    "a number": (partial(Answers, answer=lambda x: x[0]), r"answered \(\) to b \(24,\)"),
}


@pytest.mark.parametrize("kind", WRONG_SOLVERS)
def test_a_solver_that_is_none_is_named(kind: str) -> None:
    solver, message = WRONG_SOLVERS[kind]
    with pytest.raises(InvalidScene, match=message):
        equilibrium(discretise(BODY, 1.0, solver=solver), np.ones(32))


def test_a_plain_solver_runs_but_not_for_load_cases_on_other_supports() -> None:
    model = discretise(BODY, 1.0, solver=Plain)
    ours = equilibrium(discretise(BODY, 1.0), np.ones(32))
    np.testing.assert_allclose(equilibrium(model, np.ones(32)).u, ours.u, rtol=1e-9, atol=1e-9 * abs(ours.u).max())
    body = Body(BODY.domain, BODY.supports)
    load = PointLoad((4.0, 1.0), (0.0, -1.0))
    other = LoadCase((load,), supports=(Support(Rectangle((-1, 0), (0, 1))),))
    unloaded = discretise(body, 1.0, solver=Plain)
    with pytest.raises(InvalidScene, match="make Plain a dataclass with a `pattern`"):
        DesignProblem(unloaded, Design(0.5, 1.0), cases=(LoadCase((load,)), other))

"""Sound codes pass all checks; each planted fault is found, and named by its kind."""

from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.points import MaterialPoints
from mpmtop.shape_functions import gimp, tent
from tests.codes.broken import FAULTS, SOUND, TENTH
from validation.codes import cases
from validation.codes.analysis import ON_LINES
from validation.codes.answers import NotStated
from validation.codes.card import Card, scorecard
from validation.codes.checks import every
from validation.codes.shape import REVERSED
from validation.methods.elements import ElementMethod
from validation.methods.points import PointMethod
from validation.methods.protocol import Analyses, Answer, Case

# shape functions without weights give singular models, and those are divided by zero on the way to their errors
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
EVERY = every()


@cache
def card_of(kind: str) -> Card:
    return scorecard(FAULTS[kind], EVERY)


def failing(card: Card) -> list[str]:
    return [f"{row.check.name}: {row.observed} {row.where}" for row in card.of("fails")]


def test_an_independent_gimp_passes_with_our_digits() -> None:
    """All but loads at positions and load steps, which it states that it has not. Its answers are ours."""
    card = scorecard(SOUND, EVERY)
    assert failing(card) == [] and card.kinds == []
    lacks = [
        row.check.name for row in card.of("not supported") if row.check.way not in ("load steps", "sheared domain")
    ]
    assert lacks == ["mean stress, loads at positions"]
    assert len(card.of("passes")) >= 50
    assert [row.check.name for row in card.of("not stated")] == ["residual kinetic energy"]
    ours = PointMethod("GIMP", gimp)
    for case in (cases.cantilever("seeded"), cases.cantilever("uneven", cases.uneven((12, 6)))):
        theirs, expected = SOUND.analyse(case), ours.analyse(case)
        assert theirs.stress is not None and expected.stress is not None
        np.testing.assert_allclose(theirs.u, expected.u, atol=1e-12 * np.abs(expected.u).max())
        np.testing.assert_allclose(theirs.stress, expected.stress, atol=1e-12 * np.abs(expected.stress).max())


def test_a_gradient_that_is_a_tenth_off_is_named() -> None:
    card = scorecard(TENTH, EVERY)
    assert card.kinds == ["a gradient 10% off"]
    assert "patch test, uniform points" in [row.check.name for row in card.of("fails")]


@pytest.mark.parametrize("kind", FAULTS)
def test_a_planted_fault_is_found_and_named(kind: str) -> None:
    """By its kind and no other."""
    assert card_of(kind).kinds == [kind]


ANALYSIS_ALONE = {
    "origin of the grid left out along y",
    "weight shared by count, not by volume",
}
"""Kinds that answers name without the functions that gave them."""


@pytest.mark.parametrize("kind", FAULTS)
def test_an_analysis_alone_finds_it(kind: str) -> None:
    card = replace(card_of(kind), rows=tuple(row for row in card_of(kind).rows if row.check.way == "analysis"))
    guessed = {ON_LINES} if kind == REVERSED else set()
    assert card.of("fails") and set(card.kinds) == {kind} & ANALYSIS_ALONE | guessed


class Doubled:
    """Elements whose shear is given as twice the tensor's."""

    name, version = "twice the shear", "1"
    capabilities = ElementMethod().capabilities - {"prescribed displacements"}

    def analyse(self, case: Case) -> Answer:
        answer = ElementMethod().analyse(case)
        return type(answer)(answer.u, answer.stress * [1, 1, 2], answer.compliance)

    def gradient(self, case: Case) -> Array:
        return ElementMethod().gradient(case)


def test_mixed_shears_are_named() -> None:
    assert scorecard(Doubled(), EVERY).kinds == ["tensor and engineering shear mixed"]


class Recording:
    """Keeps the cases that it is asked, and answers with our tent."""

    def __init__(self) -> None:
        self.inner = PointMethod("recording", tent)
        self.name, self.version, self.capabilities = "recording", "", self.inner.capabilities
        self.asked: dict[str, list[bytes]] = {}

    def analyse(self, case: Case) -> Answer:
        held = case.held
        points = case.points.x, case.points.volume, case.moduli, case.carried
        numbers = (*points, case.grid.origin, held.node, held.value)
        self.asked.setdefault(case.name, []).append(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers))
        return self.inner.analyse(case)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)


def test_a_name_is_of_one_case() -> None:
    """Answers are kept by names: check by check, without what is kept, no name stands for two cases."""
    code = Recording()
    for check in EVERY:
        if check.needs <= code.capabilities:
            with suppress(NotStated):
                check.observe(code)
    assert len(code.asked) > 40
    assert [name for name, numbers in code.asked.items() if len(set(numbers)) > 1] == []


def test_cases_are_as_they_say() -> None:
    """Domains of uneven points stay in the box and some cross lines; both columns weigh one; some lie on lines."""

    def outline(points: MaterialPoints) -> list[float]:
        return [*(points.x - points.half_length).min(axis=0), *(points.x + points.half_length).max(axis=0)]

    uneven = cases.uneven((12, 6))
    assert outline(uneven) == pytest.approx([2, 2, 14, 8])
    cell = np.floor(uneven.x), np.floor(cases.cantilever("seeded").points.x)
    assert np.any(cell[0] != cell[1])
    for unequal in (False, True):
        assert cases.column("column", 16, unequal=unequal).carried.sum(axis=0) == pytest.approx([0, -1])
    assert np.count_nonzero(cases.on_lines((12, 6)).x[:, 0] % 1 == 0) == 12 * 12


@pytest.mark.parametrize("code", [PointMethod("tent", tent), ElementMethod()], ids=["points", "elements"])
def test_what_is_not_supported_is_never_asked(code: Analyses) -> None:
    """A code of no capability gets no verdict but that."""
    bare = type("Bare", (), {"name": "bare", "version": "", "capabilities": frozenset()})()
    assert {row.verdict for row in scorecard(bare, EVERY).rows} == {"not supported"}
    card = scorecard(code, EVERY)
    assert failing(card) == []
    for row in card.of("not supported"):
        assert row.where and row.observed is None

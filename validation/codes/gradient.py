"""Checks of the compliance's gradient by the points' moduli."""

from dataclasses import replace
from functools import partial

import numpy as np

from mpmtop.arrays import Array
from validation.codes import cases
from validation.codes.answers import Misanswered, NotStated, asked
from validation.codes.card import Check, Observed
from validation.measures.derivatives import taylor_remainders
from validation.measures.orders import observed_order
from validation.methods.protocol import Capability, Case, Differentiates

GRADIENT: frozenset[Capability] = frozenset({"analysis", "gradient"})


def _graded() -> Case:
    case = cases.under_weight("cantilever of uneven moduli under weight")
    return replace(case, moduli=np.random.default_rng(4).uniform(0.5, 1.0, len(case.moduli)))


def _compliance(code: Differentiates, case: Case) -> float:
    found = asked(code, case).compliance
    if found is None:
        raise NotStated("compliance")
    return found


def _given(code: Differentiates, case: Case) -> Array:
    asked(code, case)  # whether it may be asked at all
    found = np.asarray(code.gradient(case), float)
    if found.shape != case.moduli.shape or not np.all(np.isfinite(found)):
        raise Misanswered(f"gradient of {found.shape}: give {case.moduli.shape}, finite, one number for each point")
    return found


def homogeneous(code: Differentiates) -> Observed:
    """sum E dC/dE + C by C: the compliance is of degree -1 in the moduli."""
    case = _graded()
    C = _compliance(code, case)
    ratio = float(_given(code, case) @ case.moduli) / C
    return Observed(abs(ratio + 1), f"sum E dC/dE is {ratio:.6g} C")


def taylor(code: Differentiates) -> Observed:
    """Observed order of the remainder C(E + s d) - C(E) - s dC . d, from s to s / 2, in a direction d at random."""
    case = _graded()
    gradient = _given(code, case)
    d = np.random.default_rng(5).uniform(-1, 1, len(gradient)) * case.moduli

    def C(moduli: Array) -> float:
        at = f", stepped by {np.abs(moduli / case.moduli - 1).max():.1g}" if moduli is not case.moduli else ""
        return _compliance(code, replace(case, name=f"{case.name}{at}", moduli=moduli))

    remainders = taylor_remainders(C, case.moduli, d, float(gradient @ d), (1e-2, 5e-3))
    return Observed(float(observed_order(*remainders)), f"remainders {remainders[0]:.2e} and {remainders[1]:.2e}")


def single(code: Differentiates) -> Observed:
    """Largest difference from central difference quotients at three points, by the gradient's mean size."""
    case = _graded()
    slope = _given(code, case)
    errors = []
    for p in (0, len(slope) // 2, len(slope) - 1):
        step = 1e-3 * case.moduli[p] * (np.arange(len(slope)) == p)
        ahead, behind = (
            _compliance(code, replace(case, name=f"{case.name}, point {p} {way}", moduli=case.moduli + sign * step))
            for way, sign in (("stiffer", 1), ("softer", -1))
        )
        errors.append(abs((ahead - behind) / (2 * step[p]) - slope[p]))
    return Observed(float(max(errors) / np.mean(np.abs(slope))))


def checks() -> list[Check]:
    """All checks of a gradient."""
    check = partial(Check, "gradient", needs=GRADIENT)
    return [
        check(
            "degree -1 in the moduli",
            observe=homogeneous,
            at_most=1e-9,
            why="an identity: condition number below 1e5, rounding 1e-16, two digits left",
            look="a factor of two, of the volume, or of E in the sensitivity",
            rounding=True,
        ),
        check(
            "Taylor's remainder, order",
            observe=taylor,
            at_least=1.9,
            why="2, less a tenth for the next term: steps of 1 % and 0.5 %",
            look="a sensitivity that belongs to another load or state; a point order that differs from the case's",
        ),
        check(
            "single points",
            observe=single,
            at_most=1e-4,
            why="central differences over 0.1 % of a modulus: 1e-6 of the derivative; rounding of C, 1e-13, over 1e-3 "
            "of a few thousandths of it",
            look="the point's own strain energy: its volume, its order",
        ),
    ]

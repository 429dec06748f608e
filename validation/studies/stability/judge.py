"""Stability: what a case is, what can come of it, and how an analysis is judged.

A case is an input, most of them far from what is sensible, and a judgement of what comes out. Its outcome is one of
three: *right*, within a stated tolerance of a reference or an invariant; a *named error*, one of mpmtop's own that says
what to change; a *limit*, right for the discrete problem where the documentation says that this is far from the body's
physics. Anything else is *other*: a wrong number, NaN, a warning, an error without a name, or a false alarm.

The reference of an analysis is `validation.oracles.extended`: an answer where that finds none, as K is singular, is
wrong. An error is a named one only if it is of a class that the input asks for.
"""

import re
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

import mpmtop
from mpmtop.arrays import Array
from mpmtop.criteria import PNormStress
from mpmtop.diagnose import ModelWarning
from mpmtop.equilibrium import Equilibrium, adjoint, equilibrium, moduli_gradient
from mpmtop.errors import NotConverged, UnsupportedBody
from mpmtop.model import Model
from mpmtop.objectives import COMPLIANCE, compliance, p_norm_stress, p_norm_stress_derivative
from mpmtop.solvers import BandedCholesky, MultigridCG
from validation.oracles.dense import Quantities, objectives
from validation.oracles.extended import Undetermined, condition, extended, pseudo_compliance

Kind = Literal["right", "named error", "limit", "other"]
KINDS: tuple[Kind, ...] = ("right", "named error", "limit", "other")

PENAL, CONTRAST = 3.0, 1e-9
"""Of the stiffness law."""
RTOL = 1e-8
"""Of the compliance, whatever the condition number: ten times what `checked_solve` accepts by rounded residuals."""
ROUNDING = 10 * float(np.finfo(float).eps)
"""Times the condition number: forward error of a backward stable solve with refinement (Higham, 2002, Sect. 12.2). What
depends on strains, p-norm, gradients and displacements, is held to the larger of this and RTOL ..."""
HOPELESS = 1e-4
"""... and to this at most: with fewer digits an analysis has to say so."""
WELL_CONDITIONED = 1e13
"""An error is a false alarm if the condition number of the scaled K is below this, by either solver: beyond it less
than three digits are left in double precision, to conjugate gradients as to Cholesky's method."""
FAR = 2.5
"""Factor of the compliance beyond which an answer, right for the discrete problem, is far from the body's."""
NORM = PNormStress(p=12.0, q=0.5)
multigrid = partial(MultigridCG, coarsest=20, tolerance=1e-6)
"""As `discretise(..., solver=...)` takes it: two levels or more on bodies of five cells, held to ten times less than an
optimisation asks for."""


class Wrong(ArithmeticError):
    """What came out is wrong in a way that no deviation measures."""


class Limit(NamedTuple):
    """A documented limit, and the range of factors of the compliance that it may explain."""

    what: str
    least: float = 0.0
    most: float = np.inf


class Finding(NamedTuple):
    """Largest deviation over its tolerance, right up to 1; the documented limit the case is in, "" for none."""

    deviation: float
    limit: str = ""


class Case(NamedTuple):
    """One input; `run` raises or returns what was found, `judge` says what by.

    `expected` are the classes of the errors that the input may ask for, `says` a word of their message.
    """

    family: str
    name: str
    judge: str
    run: Callable[[], Finding]
    expected: tuple[type[Exception], ...] = ()
    says: str = ""


UNSEEN = "mechanism that the load does not move, multigrid"
SOFT = "displacement of a piece that hangs on void alone, multigrid"
"""Limits: see `mpmtop.solvers.MultigridCG`."""


class Outcome(NamedTuple):
    """What came of a case; `what` is the error's class, the limit, or what is wrong."""

    family: str
    name: str
    judge: str
    kind: Kind
    what: str


def outcome(case: Case) -> Outcome:
    """Run a case; a warning counts as an error without a name, but for those of bodies that mislead."""
    made = partial(Outcome, case.family, case.name, case.judge)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ModelWarning)  # of bodies cut, moved and jittered on purpose
            finding = case.run()
    except Exception as error:
        if is_named(error) and type(error) in case.expected and case.says in str(error):
            return made("named error", type(error).__name__)
        return made("other", f"{type(error).__name__}: {error}")
    if not finding.deviation <= 1:  # NaN, too
        return made("other", f"{finding.deviation:.1e} tolerances off")
    return made("limit", finding.limit) if finding.limit else made("right", "")


def is_named(error: Exception) -> bool:
    """Whether the error is of mpmtop's own, or a ValueError that mpmtop raised itself, and says cause and cure."""
    raised_in = Path(traceback.extract_tb(error.__traceback__)[-1].filename)
    by_us = Path(mpmtop.__file__).parent in raised_in.parents
    own = type(error).__module__.startswith("mpmtop.") or type(error) is ValueError
    return by_us and own and re.search(r"\w.*[:;] \w+ `?\w+", str(error)) is not None


def tally(outcomes: Iterable[Outcome]) -> pd.DataFrame:
    """Counts by family: how judged, cases tried, and how many of each kind."""
    frame = pd.DataFrame(outcomes, columns=list(Outcome._fields))
    counts = pd.crosstab(frame["family"], frame["kind"]).reindex(columns=list(KINDS), fill_value=0)
    by_family = frame.groupby("family", sort=False)
    table = by_family.agg(judge=("judge", "first"), cases=("kind", "size"))
    return table.join(counts).rename(columns={"judge": "judged by"})


@dataclass(frozen=True, eq=False)
class Analysis:
    """A body to analyse: how its model is made, with `multigrid` as its solver, the densities rho (p,) or
    solid, and the contrast of their moduli.

    `error` is what making the model may raise. `compliance` and `rtol` are an invariant's expectation. Where `sane` is
    given, a compliance further from it than a factor of `within` is the documented `limit`, and wrong if there is none.
    """

    family: str
    name: str
    make: Callable[[], Model]
    rho: Array | None = None
    contrast: float = CONTRAST
    error: type[Exception] | None = None
    compliance: float | None = None
    rtol: float = RTOL
    sane: float | None = None
    within: float = FAR
    limit: Limit | None = None

    @property
    def case(self) -> Case:
        """The analysis by the direct solver, judged by extended precision."""
        judge = "extended precision" if self.compliance is None else "extended precision, invariance"
        return Case(self.family, self.name, judge, self.run, self._errors)

    @property
    def twice(self) -> Case:
        """The analysis by multigrid, judged by the direct solver."""
        return Case(self.family, self.name, "direct solver", self.run_twice, self._errors)

    @property
    def _errors(self) -> tuple[type[Exception], ...]:
        return UnsupportedBody, NotConverged, *([] if self.error is None else [self.error])

    def discretised(self) -> Model:
        """The model; Wrong if making it fails with an error that the input does not ask for."""
        try:
            return self.make()
        except ValueError as error:
            if self.error is None or type(error) is not self.error:
                raise Wrong(f"false alarm: {error}") from error
            raise

    def run(self) -> Finding:
        """Judge state, objectives and gradients."""
        model = direct(self.discretised())
        rho, moduli = densities(model, self.rho, self.contrast)
        with no_false_alarm(model, moduli):
            found = quantities(model, equilibrium(model, moduli), rho)
        expected, number = reference(model, moduli, rho)
        C, *others = distances(found, expected)
        digits = min(max(RTOL, ROUNDING * number), HOPELESS)
        deviation = worst(C / RTOL, worst(*others) / digits)
        if self.compliance is not None:
            deviation = worst(deviation, abs(found.compliance[0] / self.compliance - 1) / self.rtol)
        factor = 1.0 if self.sane is None else float(found.compliance[0] / self.sane)
        if 1 / self.within <= factor <= self.within:
            return Finding(deviation)
        if self.limit is None or not self.limit.least <= factor <= self.limit.most:
            raise Wrong(f"compliance {factor:.3g} times the body's")
        return Finding(deviation, self.limit.what)

    def run_twice(self) -> Finding:
        """Compare the solvers. An error of multigrid's is its outcome; where only the direct solver refuses an answer,
        multigrid's compliance is judged without it. Displacements may differ by what a force of the tolerance moves a
        piece in void: they are compared in units of the force and the least modulus then."""
        model = self.discretised()
        rho, moduli = densities(model, self.rho, self.contrast)
        with no_false_alarm(model, moduli):
            ours = quantities(model, equilibrium(model, moduli), rho)
        tol = 10 * model.solver.tolerance
        try:
            theirs = quantities(direct(model), equilibrium(direct(model), moduli), rho)
        except (UnsupportedBody, NotConverged):
            return self.alone(model, moduli, float(ours.compliance[0]), tol)
        *others, displacement = distances(ours, theirs)
        deviation = worst(*others) / tol
        if displacement <= tol:
            return Finding(worst(deviation, displacement / tol))
        apart = float(np.abs(ours.displacement - theirs.displacement).max())
        by_void = apart * float(moduli.min()) / float(np.linalg.norm(model.f_ext.reshape(-1, 2).sum(axis=0)))
        return Finding(worst(deviation, by_void / tol), SOFT)

    def alone(self, model: Model, moduli: Array, ours: float, tol: float) -> Finding:
        """Judge multigrid's compliance where the direct solver refuses an answer: by extended precision, and where that
        sees it, too, by the pseudo-inverse of K, to the digits that a singular K leaves."""
        try:
            exact = extended(model, moduli)
        except Undetermined:
            return Finding(abs(ours / pseudo_compliance(model, moduli) - 1) / HOPELESS, UNSEEN)
        return Finding(abs(ours / float(exact.equations.f_ext @ exact.u) - 1) / tol)


@contextmanager
def no_false_alarm(model: Model, moduli: Array) -> Iterator[None]:
    """An error of the analysis passes only if the body's K is as ill-conditioned as that; else it is Wrong."""
    try:
        yield
    except (ValueError, NotConverged) as error:
        if (number := condition(model, moduli)) < WELL_CONDITIONED:
            raise Wrong(f"false alarm at condition number {number:.0e}: {error}") from error
        raise


def reference(model: Model, moduli: Array, rho: Array) -> tuple[Quantities, float]:
    """What extended precision finds, and the condition number of K scaled by its diagonal. Raises Wrong: an answer
    without a reference, and an error of the reference itself, is no named error of mpmtop's."""
    try:
        equations, u, solve, number = extended(model, moduli)
        return objectives(equations, u, moduli, rho, solve, model.body.material, NORM.p, NORM.q), number
    except Exception as error:
        raise Wrong(f"no reference: {error}") from error


def direct(model: Model) -> Model:
    """The model with the direct solver."""
    solver = model.solver
    if not isinstance(solver, MultigridCG):
        return model
    return replace(model, solver=BandedCholesky(solver.pattern))


def refused(make: Callable[[], object]) -> Finding:
    """Wrong, unless making it raises: what must not be taken."""
    made = make()
    raise Wrong(f"{made} was taken")


def quantities(model: Model, state: Equilibrium, rho: Array) -> Quantities:
    """All that is judged, by mpmtop."""
    p, q = NORM.p, NORM.q
    by_compliance, by_p_norm = (
        moduli_gradient(model, state, adjoint(model, state, by)) * state.moduli
        for by in (COMPLIANCE, p_norm_stress_derivative(model, state, rho, p=p, q=q))
    )
    return Quantities(
        np.array([compliance(model, state)]),
        np.array([p_norm_stress(model, state, rho, p=p, q=q)]),
        by_compliance,
        by_p_norm,
        model.transfer.interpolate(state.u),
    )


def densities(model: Model, rho: Array | None, contrast: float) -> tuple[Array, Array]:
    """Densities (p,), one unless given, and the point moduli (p,), by the law of the paper."""
    rho = np.ones(len(model.points.x)) if rho is None else rho
    return rho, model.body.material.young * (contrast + rho**PENAL * (1 - contrast))


def worst(*deviations: float) -> float:
    """The largest; NaN if one of them is, which `max` may pass over."""
    return float(np.max(deviations))


def distance(a: Array, b: Array) -> float:
    """|a - b| / |b|, zero if both are zero."""
    size = float(np.linalg.norm(b.astype(float)))
    apart = float(np.linalg.norm((a - b).astype(float)))
    return apart / size if size > 0 else (np.inf if apart > 0 else apart)


def distances(found: Quantities, expected: Quantities) -> list[float]:
    """`distance` of each quantity."""
    return [distance(a, b) for a, b in zip(found, expected, strict=True)]

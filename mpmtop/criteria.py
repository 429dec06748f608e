"""Criteria: by what a design is judged. Each is an objective, or with a bound a constraint.

One of one's own is an object with `value(at)` and `gradient(at)`, see `OwnCriterion`; both solvers take it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np

from mpmtop.arrays import Array, number
from mpmtop.errors import InvalidScene, NotConverged
from mpmtop.loads import Load, PositionLoad, RegionLoad
from mpmtop.region import Region, finite_pair

StressMeasure = Literal["von_mises", "von_mises_in_plane"]
"""Von Mises stress with sigma_zz or without it; by the same names in `fields.SCALARS` and in exported files."""
StressWeight = Literal["count", "volume"]
"""How points count in a norm over them: each once, or by their part of the volume."""


@dataclass(frozen=True)
class Compliance:
    """J1 = f_ext . u (Eq. 8)."""


@dataclass(frozen=True)
class PNormStress:
    """J2 = (sum_p (rho_p^q vm_p)^p)^(1/p) over all material points (Eq. 9).

    vm is the von Mises stress of solid material, with modulus E0, under the strain at the point; the relaxation rho^q,
    0 < q < penal, takes it away from voids. In plane strain sigma_zz = nu (sigma_xx + sigma_yy) counts in it; the
    measure "von_mises_in_plane" leaves it out, as codes made for plane stress do:
    vm^2 = sigma_xx^2 - sigma_xx sigma_yy + sigma_yy^2 + 3 sigma_xy^2. In plane stress the two are one.

    The sum of the paper grows with the number of points. Weighted by "volume" it is sum_p V_p / V (...)^p, a mean over
    the body: it tends to a limit as points get finer, and points may differ in size.
    """

    p: float = 12.0
    q: float = 0.5
    measure: StressMeasure = "von_mises"
    weight: StressWeight = "count"

    def __post_init__(self) -> None:
        if not 1 <= number(self.p) < np.inf:
            raise InvalidScene(f"p-norm exponent {self.p}: give a finite number of at least 1")
        if not 0 <= number(self.q) < np.inf:
            raise InvalidScene(f"stress relaxation q {self.q}: give a finite number of at least 0")
        for what, given, known in (("measure", self.measure, StressMeasure), ("weight", self.weight, StressWeight)):
            if not isinstance(given, str) or given not in get_args(known):
                raise InvalidScene(f"stress {what} {given!r}: give one of {', '.join(get_args(known))}")


@dataclass(frozen=True)
class Volume:
    """sum V_p rho_p / sum V_p, the second sum over all that is not passive void: the fraction that the design fills."""


@dataclass(frozen=True)
class Displacement:
    """Displacement along `direction`, of any length, at a position, or its mean over the material in a region.

    u . d at the position through the functions that grid or mesh have there, sum V_p u_p . d / sum V_p over a region:
    the work of a unit force there, a `PositionLoad` or a `RegionLoad`. Negative against the direction.
    """

    place: tuple[float, float] | Region
    direction: tuple[float, float]

    def __post_init__(self) -> None:
        if not hasattr(self.place, "contains"):
            object.__setattr__(self, "place", finite_pair("place of a displacement", self.place))
        object.__setattr__(self, "direction", finite_pair("direction of a displacement", self.direction))
        if not np.any(self.direction):
            raise InvalidScene("direction (0, 0) of a displacement: give one that is not zero")

    @property
    def unit_load(self) -> Load:
        """The unit force whose work it is."""
        dx, dy = self.direction
        unit = (float(dx / np.hypot(dx, dy)), float(dy / np.hypot(dx, dy)))
        return PositionLoad(self.place, unit) if isinstance(self.place, tuple) else RegionLoad(self.place, unit)


@dataclass(frozen=True, eq=False)
class Response:
    """What a criterion of one's own sees of an analysed design, at n places that have a density.

    They are the material points, or of finite elements the centres or Gauss points (`stress_at`): x (n, 2), volume (n,)
    that each stands for, rho (n,), displacement (n, 2), strain (n, 3) in Voigt order with 2 eps_xy, and stress (n, 3)
    of solid material under it.
    """

    x: Array
    volume: Array
    rho: Array
    displacement: Array
    strain: Array
    stress: Array


class Sensitivity(NamedTuple):
    """Derivatives of a criterion by the fields of a `Response`, each of that field's shape; None for zero."""

    rho: Array | None = None
    displacement: Array | None = None
    strain: Array | None = None
    stress: Array | None = None


class OwnCriterion(Protocol):
    """A criterion of one's own; a frozen dataclass, so that it can be told from another one."""

    def value(self, at: Response) -> float:
        """J of the fields of an analysed design."""

    def gradient(self, at: Response) -> Sensitivity:
        """dJ by each of the fields, as if they were independent: the solver knows how they follow from densities."""


Criterion = Compliance | PNormStress | Volume | Displacement | OwnCriterion


@dataclass(frozen=True)
class Worst:
    """The largest of all load cases' values of a criterion, each times the weight of its case: an objective.

    It is minimised as max_l w_l J_l, by a bound variable z >= w_l J_l, see `mpmtop.optimizers`.
    """

    criterion: Criterion

    def __post_init__(self) -> None:
        check_criterion("Worst of", self.criterion)


@dataclass(frozen=True)
class AtMost:
    """Constraint J <= bound, held in every load case, or in number `case` alone: g = (J - bound) / scale <= 0.

    The scale is |bound| unless given: a bound of zero needs one, the size of what would be too much. Weights of cases
    take no part.
    """

    criterion: Criterion
    bound: float
    scale: float | None = None
    case: int | None = None

    def __post_init__(self) -> None:
        check_criterion(f"{type(self).__name__} of", self.criterion)
        if not np.isfinite(number(self.bound)):
            raise InvalidScene(f"bound {self.bound!r} of a constraint: give a finite number")
        if self.scale is None and self.bound == 0:
            raise InvalidScene("a bound of 0 does not say what counts: give a `scale`, of the size of the criterion")
        if self.scale is not None and not 0 < number(self.scale) < np.inf:
            raise InvalidScene(f"scale {self.scale} of a constraint: give a positive, finite number")
        if self.case is not None and (not isinstance(self.case, int) or self.case < 0):
            raise InvalidScene(f"case {self.case!r} of a constraint: give the number of a load case, from 0 on")

    @property
    def factor(self) -> float:
        """dg/dJ."""
        return 1 / (abs(self.bound) if self.scale is None else self.scale)


@dataclass(frozen=True)
class AtLeast(AtMost):
    """Constraint J >= bound, as `AtMost` the other way round: g = (bound - J) / scale <= 0."""

    @property
    def factor(self) -> float:
        """dg/dJ."""
        return -1 / (abs(self.bound) if self.scale is None else self.scale)


STILL = 1e-3
"""Of the largest displacement: an output that moves less is not connected. Mechanisms move a tenth of it and more."""
SMALLEST = float(np.finfo(float).tiny)  # a force on a support stores nothing
VOID = 1e-2
"""Of the solid's stiffness: softer material is no structure, at a penalty of 3 that of densities up to 0.22."""


class NothingMoves(UserWarning):
    """A displacement that was sought has ended at nothing: no structure leads from the loads to the place."""


class PlaceInVoid(UserWarning):
    """A displacement that was sought or limited is that of void: no structure holds the place."""


def remark(
    stated: Displacement, unit: Array, u: Array, energy: Callable[[], Array], stiffness: Array, *, sought: bool
) -> NothingMoves | PlaceInVoid | None:
    """The warning that a displacement of a final design calls for.

    `unit` and `u` are nodal: the unit force whose work it is and the displacements. `energy` finds what that force
    alone stores in each point or element, of the part E / E0 of the solid's `stiffness`: a place that is void, or on an
    island in it, is held by void. Where the displacement is `sought`, it is told first if it is next to nothing.
    """
    value, largest = float(unit @ u), float(np.max(np.abs(u)))
    if sought and abs(value) <= STILL * largest:
        return NothingMoves(
            f"the displacement sought ended at {value:.1e}, where other parts move by {largest:.1e}: nothing connects "
            f"{stated.place} with the loads, the trivial design of a mechanism. Take MMA with a move limit of 0.1, "
            "which goes through worse designs on its way, or another start"
        )
    try:
        stored = energy()
        part = float(stored[stiffness < VOID].sum()) / max(float(stored.sum()), SMALLEST)
    except NotConverged:  # an island so loose that a force there is in equilibrium with nothing but rounding
        part = 1.0
    if part <= 0.5:
        return None
    return PlaceInVoid(
        f"the displacement {value:.3g} at {stated.place} is that of void, which stores {part:.0%} of the energy of a "
        "force there. Make the place part of the structure, solid (`passive_solid`) and in the way of the loads, or "
        "ask for the displacement where a load acts"
    )


def check_criterion(what: str, value: object) -> None:
    """InvalidScene unless it is a criterion."""
    known = isinstance(value, Compliance | PNormStress | Volume | Displacement)
    if isinstance(value, type) or not (known or (hasattr(value, "value") and hasattr(value, "gradient"))):
        raise InvalidScene(
            f"{what} {value!r}: give Compliance(), PNormStress(p, q), Volume(), Displacement(place, direction), or an "
            "object of your own with `value` and `gradient`"
        )


def own_value(criterion: OwnCriterion, at: Response) -> float:
    """J of a criterion of one's own; InvalidScene unless it is one number."""
    value = criterion.value(at)
    try:
        return float(np.reshape(value, ()))
    except (TypeError, ValueError) as error:
        raise InvalidScene(f"{type(criterion).__name__}.value is no number ({error}): return one") from error


def check_sensitivity(criterion: OwnCriterion, by: Sensitivity, at: Response) -> None:
    """InvalidScene unless it is a Sensitivity, each derivative of its field's shape."""
    if not isinstance(by, Sensitivity):
        raise InvalidScene(f"{type(criterion).__name__}.gradient gave a {type(by).__name__}: return a `Sensitivity`")
    for name, part in by._asdict().items():
        field = getattr(at, name)
        if part is not None and np.shape(part) != field.shape:
            raise InvalidScene(
                f"{type(criterion).__name__}.gradient: d/d{name} has shape {np.shape(part)} and {name} {field.shape}: "
                "give one derivative for each entry"
            )


def finite_gradient(gradient: Array, criterion: Criterion) -> Array:
    """dJ/ddesign (a,) as it is; InvalidScene where an entry is infinite, at densities of zero."""
    if isinstance(criterion, PNormStress) and np.any(gradient == np.inf):
        raise InvalidScene(
            f"the p-norm has an infinite derivative at a density of 0 with q p < 1 (q = {criterion.q}, p = "
            f"{criterion.p}): give a positive rho_min, or a q of at least 1 / p"
        )
    return gradient

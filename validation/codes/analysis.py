"""Checks of an analysis: identities that any consistent code meets to rounding, orders, and what crossing does."""

from collections.abc import Callable
from functools import cache

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.crossing import Bump, Crossing, Jitter, Periodic, Uniform, Wave
from mpmtop.material import tangent
from mpmtop.points import MaterialPoints
from reference_fem import elasticity
from reference_fem.boundary import locate_in_lattice, nodal_forces
from validation.bodies import beam as timoshenko
from validation.codes import cases
from validation.codes.answers import NotStated, asked, fine_work, off, order, ratio_norm, stress_of, work
from validation.codes.card import Observed
from validation.codes.cases import HOME, Map
from validation.codes.shape import REVERSED
from validation.methods.protocol import Analyses, Capability, Case

ANALYSIS: frozenset[Capability] = frozenset({"analysis"})
EXACT = 1e-9
"""Of identities: condition numbers here are below 1e5, rounding is 1e-16, and two digits are left."""
ON_LINES = "points on grid lines: the half-open convention, or a node whose weight is zero and whose gradient is not?"
Code = Analyses


def _at(case: Case, error: Array) -> str:
    """Where the largest of the errors (p,) is, and what the failing points have in common."""
    p = int(np.argmax(error))
    xi = case.grid.cell_coordinates(case.points.x)
    crosses = np.any(np.abs(xi - np.rint(xi)) < case.points.half_length / case.grid.h - 1e-9, axis=1)
    failing = error > EXACT
    where = f"point {p} at ({xi[p, 0]:.4g}, {xi[p, 1]:.4g}) cells; {failing.mean():.0%} of the points fail"
    if failing.any() and not failing.all() and np.all(crosses[failing]):
        where += ", all of them with domains that cross a grid line"
    return where


def rigid(code: Code, name: str, points: MaterialPoints | None) -> Observed:
    """Largest stress, by E and the rotation, or departure from the motion, by its size."""
    case = cases.rigid_motion(name, points)
    answer = asked(code, case)
    error = np.maximum(np.abs(stress_of(answer)).max(axis=1) / 0.1, off(answer.u, cases.rigid(case.points.x)))
    return Observed(float(error.max()), _at(case, error))


def on_lines(code: Code) -> Observed:
    """The same, of points on grid lines; where those that are off them pass, it is the lines."""
    found = rigid(code, "rigid motion, points on grid lines", cases.on_lines((6, 4)))
    if found.value <= EXACT:
        return found
    beside = rigid(code, "rigid motion, points beside grid lines", cases.on_lines((6, 4)).moved((0.01, 0.0)))
    return found._replace(kind=ON_LINES if beside.value <= EXACT else "")


def uneven_patch(code: Code) -> Observed:
    """The same for uneven points, for comparison."""
    return Observed(patch(code, "patch test, uneven points", cases.uneven((6, 4))).value)


def patch(code: Code, name: str, points: MaterialPoints | None) -> Observed:
    """Departure from the linear field and its stress."""
    case = cases.patch(name, points)
    answer = asked(code, case)
    G = cases.GRADIENT
    stress = tangent(cases.SOLID) @ [G[0, 0], G[1, 1], G[0, 1] + G[1, 0]]
    error = np.maximum(
        off(answer.u, cases.linear(case.points.x)), off(stress_of(answer), np.tile(stress, (len(case.moduli), 1)))
    )
    return Observed(float(error.max()), _at(case, error))


def mean_stress(code: Code, case: Case) -> Observed:
    """sum V (sigma_xx, sigma_xy) - sum f (x - x_c) by the size of either: the work of what acts on u = x - x_c.

    Every function that reproduces linear fields meets it, whatever its points, as the clamp is at x_c.
    """
    force, arm = cases.levers(case)
    found, right = case.points.volume @ stress_of(asked(code, case))[:, [0, 2]], arm @ force
    error = np.abs(found - right) / np.abs(right).max()
    ratio = np.divide(found, right, out=np.ones(2), where=right != 0)
    mixed = abs(ratio[0] - 1) <= EXACT and min(abs(ratio[1] - 2), abs(ratio[1] - 0.5)) < 0.01
    words = f"sigma_xx is {ratio[0]:.6g} times what acts, sigma_xy {ratio[1]:.6g} times"
    kind = "tensor and engineering shear mixed" if mixed else ""
    if np.all(np.abs(ratio + 1) <= EXACT):
        kind = "stress positive in compression"
    return Observed(float(error.max()), words, kind)


def layered(code: Code) -> Observed:
    """Departure of the stress in both layers from E eps."""
    case = cases.layered("two layers, stretched")
    right = np.outer(case.moduli, [0.01, 0.0, 0.0]) * 1.0
    error = off(stress_of(asked(code, case)), right)
    return Observed(float(error.max()), _at(case, error))


def plane_stress(code: Code) -> Observed:
    """Difference of plane stress from plane strain of E (1 + 2 nu) / (1 + nu)^2 and nu / (1 + nu), its equivalent."""
    nu = 0.3
    thin = cases.cantilever("plane stress", material=Material(1.0, nu, "stress"))
    thick = cases.cantilever(
        "plane strain in place of plane stress",
        material=Material((1 + 2 * nu) / (1 + nu) ** 2, nu / (1 + nu), "strain"),
    )
    return _differ(code, thin, thick, lambda u: u, lambda stress: stress)


def _differ(
    code: Code, one: Case, other: Case, u_of: Callable[[Array], Array], stress_of_other: Callable[[Array], Array]
) -> Observed:
    """Difference of the answers to two cases, those to the second one taken back by two functions."""
    here, there = asked(code, one), asked(code, other)
    error = off(u_of(there.u), here.u)
    if here.stress is not None and there.stress is not None:
        error = np.maximum(error, off(stress_of_other(there.stress), here.stress))
    return Observed(float(error.max()), _at(one, error))


def mapped(code: Code, name: str, change: Map, back: Callable[[Array], Array] | None = None) -> Observed:
    """Difference of the cantilever's answer from the mapped one's, taken back."""
    here = cases.cantilever("cantilever")
    vector = back or change.vector
    force, modulus = change.force / change.modulus, change.force / change.length

    def stress(found: Array) -> Array:
        tensor = found[:, [0, 2, 2, 1]].reshape(-1, 2, 2) / modulus
        both = vector(np.swapaxes(vector(tensor), 1, 2))
        return np.stack([both[:, 0, 0], both[:, 1, 1], both[:, 0, 1]], axis=1)

    return _differ(code, here, change(here, name), lambda u: vector(u) / force, stress)


ORIGINS = {
    "elevated": (0.0, 50.0),
    "to the right": (50.0, 0.0),
    "negative": (-37.0, -11.0),
    "irrational": (np.pi, -np.e),
}


def elsewhere(code: Code, name: str) -> Observed:
    """Difference of answers on grids from another origin; what is an answer at (0, 0) and none there, too, is named."""
    shift = ORIGINS[name]
    axes = [axis for axis, moved in zip("xy", shift, strict=True) if moved != 0]
    kind = f"origin of the grid left out along {axes[0]}" if len(axes) == 1 else ""
    asked(code, cases.cantilever("cantilever"))
    try:
        found = mapped(code, f"cantilever, origin {name}", cases.moved(shift))
    except Exception as error:  # whatever a code raises where it answered before
        return Observed(np.inf, f"{type(error).__name__}: {error}", kind)
    return found._replace(kind=kind if found.value > 0.1 else "")


def transposed_on_lines(code: Code) -> Observed:
    """Points on grid lines across x, and the same body with x and y exchanged."""
    here = cases.cantilever("cantilever, points on grid lines", cases.on_lines((12, 6)))
    there = cases.TRANSPOSED(here, "cantilever, points on grid lines, transposed")
    found = _differ(code, here, there, lambda u: u[:, ::-1], lambda stress: stress[:, [1, 0, 2]])
    if found.value <= EXACT:
        return found
    off_lines = mapped(code, "cantilever, transposed", cases.TRANSPOSED)
    return found._replace(kind=f"{REVERSED} (along one axis)" if off_lines.value <= EXACT else "")


def reordered(code: Code) -> Observed:
    """Difference of the answers for points in another order."""
    here = cases.cantilever("cantilever")
    shuffle = np.random.default_rng(3).permutation(len(here.moduli))
    back = np.argsort(shuffle)
    there = cases.shuffled(here, "cantilever, points in another order", shuffle)
    return _differ(code, here, there, lambda u: u[back], lambda stress: stress[back])


def doubled(code: Code) -> Observed:
    """Half the answer to twice the load."""
    twice = Map(lambda x: x, lambda v: v, force=2.0)
    return mapped(code, "cantilever, twice the load", twice)


def reciprocal(code: Code) -> Observed:
    """f_A . u_B - f_B . u_A by f_A . u_A and f_B . u_B: Betti."""
    one, other = cases.cantilever("cantilever"), cases.under_weight("cantilever under weight")
    u_one, u_other = asked(code, one), asked(code, other)
    size = np.sqrt(abs(work(one, u_one) * work(other, u_other)))
    there, back = work(one, u_other), work(other, u_one)
    return Observed(
        abs(there - back) / float(size),
        f"point forces do {there:.6g} at the displacements of body forces, these {back:.6g} at those of point forces",
    )


def balance(code: Code, case: Case) -> Observed:
    """sum V sigma : eps - f . u by f . u, with eps of the stress by Hooke's law: Clapeyron."""
    answer = asked(code, case)
    stress = stress_of(answer)
    strain = np.linalg.solve(tangent(case.body.material), stress.T).T / case.moduli[:, None]
    stored, done = float(case.points.volume @ np.sum(stress * strain, axis=1)), work(case, answer)
    return Observed(abs(stored - done) / abs(done), f"strain energy is {stored / done:.4g} of the work of the loads")


def compliance_stated(code: Code) -> Observed:
    """The compliance that the code states, by the work of the loads at its points."""
    case = cases.under_weight("cantilever under weight")
    answer = asked(code, case)
    if answer.compliance is None:
        raise NotStated("compliance")
    return Observed(abs(answer.compliance / work(case, answer) - 1))


def kinetic(code: Code) -> Observed:
    """Kinetic energy that is left, by the strain energy."""
    left = asked(code, cases.cantilever("cantilever")).kinetic
    if left is None:
        raise NotStated("kinetic energy: not a code that steps in time")
    return Observed(left)


def weighed(code: Code, unequal: bool) -> Observed:
    """Mean error of the stress in a column under its weight, by that at its base."""
    cells = 16
    case = cases.column(
        f"column under its weight{', points of unequal size' if unequal else ''}", cells, unequal=unequal
    )
    found = stress_of(asked(code, case))[:, 1]
    y, volume = case.points.x[:, 1] - HOME, case.points.volume

    def error(right: Array) -> float:
        return float(volume @ np.abs(found - right) / volume.sum())

    observed = error(-(1 - y / cells))
    by_count = 1 - np.searchsorted(np.sort(y), y, side="left") / len(y)
    if unequal and observed > WEIGHT and error(-by_count) < 2 * WEIGHT:
        return Observed(observed, "stress is that of a weight in proportion to the number of points", BY_COUNT)
    return Observed(observed, f"base stress {found[np.argmin(y)]:.4g}, right -1")


WEIGHT = 1.05 / 64
"""Mean error of a stress that is constant in each of 16 cells, h / 4, and linear in truth; five per cent for rounding
where it is a half of a half."""
BY_COUNT = "weight shared by count, not by volume"


@cache
def _waves(cells: int, even: bool) -> Case:
    points = None if even else cases.uneven((cells, cells))
    return cases.manufactured(f"waves, {cells} cells a side{'' if even else ', uneven points'}", cells, points)


def wave_error(code: Code, cells: int, even: bool, stress: bool) -> float:
    """Relative error of the manufactured solution."""
    case = _waves(cells, even)
    u, right, _ = cases.waves(case.points.x - HOME, cells)
    answer = asked(code, case)
    found, expected = (stress_of(answer), right) if stress else (answer.u, u)
    return ratio_norm(found - expected, expected, case.points.volume)


def wave_order(code: Code, stress: bool) -> Observed:
    """Observed order from 8 to 16 cells."""
    coarse, fine = (wave_error(code, cells, True, stress) for cells in (8, 16))
    return Observed(order(coarse, fine), f"errors {coarse:.2e} and {fine:.2e}")


def beam_order(code: Code) -> Observed:
    """Observed order of the displacement of Timoshenko's beam, from 2 to 4 cells over its depth."""
    errors = []
    for depth in (2, 4):
        case = cases.beam(f"Timoshenko's beam, {depth} cells deep", depth)
        right = timoshenko.beam(case.points.x - HOME, depth, cases.SOLID).u
        errors.append(ratio_norm(asked(code, case).u - right, right, case.points.volume))
    return Observed(order(*errors), f"errors {errors[0]:.2e} and {errors[1]:.2e}")


@cache
def _fine() -> float:
    return fine_work(cases.refined("cantilever, 8 cells for each", 8))


def refinement(code: Code) -> Observed:
    """Relative error of the compliance at 4 cells for each of the coarsest ones, and whether it falls on the way."""
    errors = []
    for per_cell in (1, 2, 4):
        case = cases.refined(f"cantilever, {per_cell} cells for each", per_cell)
        errors.append(abs(work(case, asked(code, case)) / _fine() - 1))
    falls = errors[0] > errors[1] > errors[2]
    words = ", ".join(f"{error:.2%}" for error in errors)
    return Observed(errors[2] if falls else np.inf, f"errors {words}{'' if falls else ': they do not fall'}")


def small_cut(code: Code, overlap: float) -> Observed:
    """Relative change of the compliance by a move of all points over the upper edge of the body's cells."""
    seeded = cases.cantilever("cantilever")
    cut = cases.cantilever(f"cantilever, {overlap:g} cells over the edge", seeded.points.moved((0.0, overlap)))
    return Observed(abs(work(cut, asked(code, cut)) / work(seeded, asked(code, seeded)) - 1))


def column_jump(code: Code) -> Observed:
    """Relative jump of the compliance as one column of points goes over a grid line."""
    seeded = cases.cantilever("cantilever").points
    column = np.isclose(seeded.x[:, 0], HOME + 3.75)
    works = []
    for side, shift in (("before", 0.2499), ("behind", 0.2501)):
        case = cases.cantilever(
            f"cantilever, one column {side} a grid line", seeded.moved(np.outer(column, [shift, 0.0]))
        )
        works.append(work(case, asked(code, case)))
    return Observed(abs(works[1] / works[0] - 1))


FAMILIES: tuple[Crossing, ...] = (Uniform(0.3), Periodic(4), Wave(8), Bump(4), Jitter(0.3))


def family(code: Code, crossing: Crossing) -> Observed:
    """Compliance with crossed points by that of the points as seeded."""
    seeded, crossed = cases.cantilever("cantilever"), cases.crossed(f"cantilever, {crossing}", crossing)
    return Observed(work(crossed, asked(code, crossed)) / work(seeded, asked(code, seeded)))


def gauss(code: Code) -> Observed:
    """Compliance by points at Gauss points over that of bilinear elements of the cells' size, where the points are."""
    case = cases.gauss("cantilever, points at Gauss points")
    return Observed(work(case, asked(code, case)) / _bilinear(case) - 1)


def _bilinear(case: Case) -> float:
    """Compliance of bilinear elements of the size of cells, by `reference_fem`."""
    model = elasticity.discretise(case.body, case.grid.h)
    assert case.body_force is not None
    force = case.points.volume[:, None] * case.body_force
    f = nodal_forces(model.basis, case.points.x, force, locate_in_lattice)
    return float(f @ elasticity.inverse_stiffness(model, np.ones(len(model.area)))(f))

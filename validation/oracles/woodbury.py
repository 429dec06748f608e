"""Derivatives of an objective by every single density, without an adjoint: difference quotients and exact ones.

Covered are all shape functions, with B-bar or without; a ghost penalty by the exact derivative only.

A density rho_p changes the modulus of one point, and K by the low rank of k_p = F_p^T F_p. For a change delta of any
size, from one factorisation of K (Sherman, Morrison and Woodbury; Hager 1989, SIAM Rev. 31:221),

    u' = u - K^-1 F_p^T z_p,    z_p = delta (I + delta F_p K^-1 F_p^T)^-1 F_p u.

The exact derivative is the complex step rho_p + ih with h -> 0 (Squire and Trapp 1998, SIAM Rev. 40:110). To first
order in h, which is all that double precision holds of it at h = 1e-30, every step from rho to J is then linear:

    u' = u - ih dE_p/drho_p K^-1 F_p^T F_p u,    Im J' = dJ/du . Im u',

and without subtraction there is neither truncation nor cancellation. The displacements of every variable are solved
for; SIMP, von Mises stress and p-norm are evaluated at complex arguments: only the linear steps, K and f, are
differentiated by hand.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.linalg import solve_triangular

from mpmtop.arrays import Array, Index
from mpmtop.body import Material
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.material import simp, tangent, von_mises
from mpmtop.problem import DesignProblem
from mpmtop.voigt import local_B
from reference_fem.elasticity import strain_operator
from reference_fem.simp import DesignProblem as FemProblem

Numbers = npt.NDArray[Any]  # real or complex
STEP = 1e-30
"""Complex step h: h^2 is lost in the rounding of whatever it is added to."""
SOLVED, STRAINED = 512, 64
"""Right-hand sides solved for, and variables whose strains are computed, at a time: what the cache favours."""


@dataclass(frozen=True, eq=False)
class BlockTridiagonal:
    """Factors of a banded K in blocks, K = L S L^T: many right-hand sides run at the speed of matrix products.

    Block k holds the unknowns from `start[k]` to `start[k + 1]`, and K couples it to its neighbours only. `inverse[k]`
    is S_k^-1, of the block's Schur complement; `below[k]` is L_(k+1)k, L having units on its diagonal.
    """

    start: list[int]
    inverse: list[Array]
    below: list[Array]

    @classmethod
    def factor(cls, K: sp.csr_array) -> Self:
        """Factorise K (n, n), symmetric positive definite; numpy.linalg.LinAlgError if it is not."""
        reach = np.maximum.accumulate(np.maximum.reduceat(K.indices, K.indptr[:-1])) + 1
        start = [0, int(reach[0])]
        while start[-1] < K.shape[0]:
            start.append(int(reach[start[-1] - 1]))
        inverse: list[Array] = []
        below: list[Array] = []
        schur = K[: start[1], : start[1]].toarray()
        for i, j, k in zip(start, start[1:], [*start[2:], start[-1]], strict=False):
            root = solve_triangular(np.linalg.cholesky(schur), np.eye(j - i), lower=True)
            inverse.append(root.T @ root)
            coupling = K[j:k, i:j].toarray()
            below.append(coupling @ inverse[-1])
            schur = K[j:k, j:k].toarray() - below[-1] @ coupling.T
        return cls(start, inverse, below)

    def solve(self, b: Array) -> Array:
        """K^-1 b for b (n, c)."""
        return self.overwrite(b.copy())

    def overwrite(self, x: Array) -> Array:
        """K^-1 x for x (n, c), in place."""
        blocks = list(zip(self.start, self.start[1:], self.inverse, self.below, strict=False))
        loaded = int(np.argmax(x.any(axis=1)))  # what is before the first load stays zero
        for i, j, _, below in blocks:
            if j > loaded:
                x[j : j + len(below)] -= below @ x[i:j]
        for i, j, inverse, below in reversed(blocks):
            x[i:j] = inverse @ x[i:j] - below.T @ x[j : j + len(below)]
        return x


class GhostPart(NamedTuple):
    """A ghost penalty's part of dK/dE_p = J^T diag(M_p) J: `jump` J (g, n), `modulus` M (g, p)."""

    jump: sp.csr_array
    modulus: sp.csr_array

    def loads(self, u: Array) -> sp.csr_array:
        """dK/dE_p u of every point, (p, n)."""
        return sp.csr_array(self.modulus.T @ sp.diags_array(self.jump @ u) @ self.jump)


@dataclass(frozen=True, eq=False)
class System:
    """K(E) u = f, K = sum_p E_p F_p^T F_p: n unknowns, p material points (or elements) with d unknowns each.

    `unknown` (p, d) are the unknowns of each point and `F` (p, r, d) acts on them; a degree of freedom that is held
    counts as unknown 0, with zeros in F. f (n,); `strain` (3p, n) takes u to the strains at the points: all xx, then
    all yy, then all engineering shears. `matrix` takes moduli (p,), real or complex, to K (n, n): the discretisation's
    own, for another sum of the same terms would round differently.
    """

    material: Material
    design: Design
    objective: Compliance | PNormStress
    unknown: Index
    F: Array
    f: Array
    strain: sp.csr_array
    matrix: Callable[[Numbers], sp.csr_array]
    ghost: GhostPart | None = None

    def moduli(self, rho: Numbers) -> Numbers:
        """Young's moduli (p,) for densities (p,), real or complex, Eq. (10)."""
        return self.material.young * simp(rho, self.design.penal, self.design.contrast)[0]

    @cached_property
    def stress_root(self) -> sp.csr_array:
        """S (3p, n): the squares of the three rows of a point in S u sum to vm^2 of solid material.

        vm^2 is a quadratic form of the strain; its matrix M comes from vm by polarisation, and S from M = R^T R.
        """
        unit = np.eye(3)
        pairs = [(unit[:, None] + sign * unit).reshape(9, 3) for sign in (1, -1)]
        sums, differences = (self.solid_von_mises(strain) ** 2 for strain in pairs)
        R = np.linalg.cholesky((sums - differences).reshape(3, 3) / 4).T
        return sp.csr_array(sp.kron(R, sp.eye_array(len(self.F))) @ self.strain)

    def solid_stress(self, strain: Numbers) -> Numbers:
        """Stresses (m, 3) of solid material under strains (m, 3)."""
        return self.material.young * strain @ tangent(self.material)

    def solid_von_mises(self, strain: Numbers) -> Numbers:
        """Von Mises stress (m,) of solid material under strains (m, 3), real or complex, by the objective's measure."""
        measure = self.objective.measure if isinstance(self.objective, PNormStress) else "von_mises"
        return von_mises(self.solid_stress(strain), self.material, measure)


def material_points(problem: DesignProblem) -> System:
    """The system of a problem of material points: F_p = sqrt(V_p) C B_p with C^T C = D."""
    model = problem.model
    transfer, pattern = model.transfer, model.stiffness
    p, nodes = transfer.stencil.shape
    B = local_B(transfer.grad_N, transfer.b_bar).reshape(p, 3, 2 * nodes)
    F = np.sqrt(model.points.volume)[:, None, None] * (np.linalg.cholesky(model.D).T @ B)

    def matrix(moduli: Numbers) -> sp.csr_array:
        # to the bit what the solver factors; K is linear in the moduli, complex ones included
        data = pattern.data(moduli.real)
        if np.iscomplexobj(moduli):
            data = data + 1j * pattern.data(moduli.imag)
        lower = sp.csr_array((data, (pattern.row, pattern.col)), shape=2 * pattern.dof.shape)
        return sp.csr_array(lower + sp.triu(lower.T, k=1))

    local = (2 * transfer.stencil[:, :, None] + np.arange(2)).reshape(p, 2 * nodes)
    system = _system(problem, pattern.dof, local, F, model.f_ext, transfer.B, matrix)
    if model.ghost.modulus.shape[0] == 0:
        return system
    jump = sp.kron(model.ghost.jump, sp.eye_array(2), format="csr")[:, pattern.dof]  # each of 2 f rows, by component
    return replace(
        system, ghost=GhostPart(sp.csr_array(jump), sp.csr_array(model.ghost.modulus[np.arange(jump.shape[0]) // 4]))
    )


def finite_elements(problem: FemProblem) -> System:
    """The system of a problem of finite elements, F from eigenvectors of the element matrices, without rigid motions.

    Strains are those at the element centres; unknowns are in the model's order, a band at the sizes of the studies.
    """
    model = problem.model
    values, vectors = np.linalg.eigh(model.matrices)
    F = (np.sqrt(values[:, 3:, None]) * np.swapaxes(vectors[:, :, 3:], 1, 2))[model.shape]
    local, strain = model.basis.element_dofs.T, strain_operator(model)
    return _system(problem, model.free, local, F, model.f_ext, strain, lambda E: sp.csr_array(model.stiffness(E)))


def _system(
    problem: DesignProblem | FemProblem,
    dof: Index,
    local: Index,
    F: Array,
    f_ext: Array,
    strain: sp.csr_array,
    matrix: Callable[[Numbers], sp.csr_array],
) -> System:
    """From the degree of freedom of each unknown (n,), those of each point (p, d), and strains point by point."""
    number = np.full(len(f_ext), -1)
    number[dof] = np.arange(len(dof))
    unknown = number[local]
    F = np.where(unknown[:, None] < 0, 0.0, F)
    by_component = np.arange(3 * len(F)).reshape(-1, 3).T.ravel()
    strain = sp.csr_array(strain[:, dof])[by_component]
    material, objective = problem.model.body.material, problem.objective
    if not isinstance(objective, Compliance | PNormStress):
        raise ValueError(f"objective {objective}: this oracle knows Compliance() and PNormStress(p, q)")
    return System(material, problem.design, objective, np.maximum(unknown, 0), F, f_ext[dof], strain, matrix)


@dataclass(frozen=True, eq=False)
class State:
    """A system in equilibrium at densities rho (p,), with its factorisation and u (n,)."""

    system: System
    rho: Array
    factor: BlockTridiagonal
    u: Array

    @classmethod
    def at(cls, system: System, rho: Array) -> Self:
        """Factorise and solve."""
        factor = BlockTridiagonal.factor(system.matrix(system.moduli(rho)))
        return cls(system, rho, factor, factor.solve(system.f[:, None])[:, 0])

    @cached_property
    def inverse(self) -> Array:
        """K^-1 (n, n)."""
        n = len(self.u)
        columns = [self.factor.overwrite(np.eye(n, min(SOLVED, n - k), -k)) for k in range(0, n, SOLVED)]
        return np.concatenate(columns, axis=1)

    @cached_property
    def strained(self) -> Array:
        """F_p u, (p, r)."""
        return (self.system.F @ self.u[self.system.unknown][:, :, None])[:, :, 0]

    def response(self, points: Index, z: Array, at_a_time: int) -> Iterator[tuple[slice, Array]]:
        """K^-1 F_p^T z_p, (n, c), of the given points (m,) and their z (m, r), for slices of c <= `at_a_time` points.

        With more points than unknowns the inverse is the cheaper way, else a solve for each.
        """
        unknown = self.system.unknown[points]
        m, d = unknown.shape
        load = (z[:, None, :] @ self.system.F[points]).ravel()
        loads = sp.csr_array((load, unknown.ravel(), np.arange(0, m * d + 1, d)), shape=(m, len(self.u)))
        for first in range(0, m, at_a_time):
            part = slice(first, min(first + at_a_time, m))
            if m > len(self.u):
                yield part, np.ascontiguousarray((loads[part] @ self.inverse).T)
            else:
                yield part, self.factor.overwrite(loads[part].T.toarray(order="C"))


def changed_objectives(state: State, change: float, points: Index | None = None) -> tuple[float, Array]:
    """J, and J (m,) after the density of one point alone has grown by `change`, for each of the points (all).

    Exact for a change of any size; a p-norm must be of even p, and there may be no ghost penalty, through which a point
    changes K by more than its own low rank: else ValueError.
    """
    if state.system.ghost is not None:
        raise ValueError("changes of any size with a ghost penalty: take `exact_derivatives`, or ghost=0")
    system, rho = state.system, state.rho
    points = np.arange(len(rho)) if points is None else points
    F, unknown, y = system.F[points], system.unknown[points], state.strained[points]
    delta = (system.moduli(rho + change) - system.moduli(rho))[points, None]
    flexibility = F @ state.inverse[unknown[:, :, None], unknown[:, None, :]] @ np.swapaxes(F, 1, 2)
    z = delta * np.linalg.solve(np.eye(F.shape[1]) + delta[:, :, None] * flexibility, y[:, :, None])[:, :, 0]
    match system.objective:
        case Compliance():  # f . K^-1 F_p^T z_p = F_p u . z_p
            J = float(system.f @ state.u)
            return J, J - np.sum(y * z, axis=1)
        case PNormStress(p, q):
            if p % 2:
                raise ValueError(f"p-norm exponent {p}: give an even number")
            return _changed_p_norms(state, change, points, z, p, q)


def _changed_p_norms(state: State, change: float, points: Index, z: Array, p: float, q: float) -> tuple[float, Array]:
    rho, u = state.rho, state.u[:, None]
    relaxed = sp.csr_array(sp.diags_array(np.tile(rho**q, 3)) @ state.system.stress_root)
    largest = float(np.sqrt(np.max(_squares(relaxed @ u))))
    relaxed /= largest

    def norms(squares: Array) -> Array:
        return largest * np.sum(_even_power(squares, int(p)), axis=0) ** (1 / p)

    own = (1 + change / rho[points]) ** (2 * q)  # the point's own stress is relaxed less, too
    changed = np.empty(len(points))
    for part, response in state.response(points, z, STRAINED):
        squares = _squares(relaxed @ (u - response))
        squares[points[part], np.arange(response.shape[1])] *= own[part]
        changed[part] = norms(squares)
    return float(norms(_squares(relaxed @ u))[0]), changed


def _squares(roots: Array) -> Array:
    """Sum of squares (p, c) of the three roots of each point, (3p, c); overwrites them."""
    xx, yy, xy = np.square(roots, out=roots).reshape(3, -1, roots.shape[1])
    xx += yy
    xx += xy
    return xx


def _even_power(square: Array, p: int) -> Array:
    """square^(p/2) by repeated squaring, where `**` takes several times as long."""
    if p == 2:
        return square
    power = _even_power(square * square, p // 4 * 2)
    return square * power if p % 4 else power


def exact_derivatives(state: State, points: Index | None = None) -> Array:
    """dJ/drho_p of the given points (all), by the complex step rho_p + ih, h -> 0."""
    points = np.arange(len(state.rho)) if points is None else points
    by_u, explicit = _complex_steps(state)
    d_moduli = np.imag(state.system.moduli(state.rho + 1j * STEP)) / STEP
    derivative = explicit[points]
    if state.system.ghost is not None:
        adjoint = state.factor.solve(by_u[:, None])[:, 0]
        derivative -= d_moduli[points] * (state.system.ghost.loads(state.u)[points] @ adjoint)
    for part, response in state.response(points, d_moduli[points, None] * state.strained[points], SOLVED):
        derivative[part] -= by_u @ response
    return derivative


def _complex_steps(state: State) -> tuple[Array, Array]:
    """dJ/du (n,) and, at fixed u, dJ/drho (p,): what is common to the complex steps of all variables."""
    system, rho = state.system, state.rho
    match system.objective:
        case Compliance():
            return system.f, np.zeros_like(rho)
        case PNormStress(p, q):
            strain = (system.strain @ state.u).reshape(3, -1).T
            stepped = strain[:, None] + 1j * STEP * np.eye(3)  # (p, 3, 3): one component each
            vm = system.solid_von_mises(stepped.reshape(-1, 3)).reshape(-1, 3)
            s = rho**q * vm[:, 0].real
            by_s = np.imag(_norm_after(s, s + 1j * STEP, p)) / STEP
            by_strain = (by_s * rho**q)[:, None] * vm.imag / STEP
            explicit = by_s * vm[:, 0].real * np.imag((rho + 1j * STEP) ** q) / STEP
            return system.strain.T @ by_strain.T.ravel(), explicit


def _norm_after(s: Array, changed: Numbers, p: float) -> Numbers:
    """p-norm (p,) of s (p,) after one entry alone has been changed, for every entry."""
    largest = s.max()
    powers = (s / largest) ** p
    return largest * (powers.sum() - powers + (changed / largest) ** p) ** (1 / p)

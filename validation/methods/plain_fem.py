"""Plain scikit-fem, as its user would write it from its examples: an analysis, and a SIMP loop, the timings' baseline.

`BilinearForm` assembled anew each iteration with the modulus as a field, `condense`, `solve`. Same elements, filter
and problem as `reference_fem.simp`, whose numbers it must reproduce; nothing is cached but mesh, basis and filter.
"""

from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad0,
    ElementQuad1,
    ElementVector,
    Functional,
    LinearForm,
    MeshQuad,
    condense,
    solve,
)
from skfem.helpers import ddot, dot, eye, sym_grad, trace

from mpmtop.arrays import Array, Index
from mpmtop.scene import Scene
from validation.methods.protocol import Answer, Capability, Case


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Objective, constraints g <= 0, densities and displacements of one design."""

    objective: float
    constraints: Array
    rho: Array
    u: Array


@dataclass(frozen=True, eq=False)
class PlainProblem:
    """Compliance of the cantilever `scene` on nx x ny bilinear elements, one design variable each."""

    scene: Scene
    nx: int
    ny: int

    @cached_property
    def mesh(self) -> MeshQuad:
        """The mesh."""
        lower, upper = self.scene.body.domain.bounds
        axes = (np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, (self.nx, self.ny), strict=True))
        return MeshQuad.init_tensor(*axes)

    @cached_property
    def basis(self) -> Basis:
        """Displacements."""
        return Basis(self.mesh, ElementVector(ElementQuad1()))

    @cached_property
    def density_basis(self) -> Basis:
        """Element-wise constant densities at the quadrature points of `basis`."""
        return self.basis.with_element(ElementQuad0())

    @cached_property
    def centres(self) -> Array:
        """Element centres (e, 2)."""
        return self.mesh.p[:, self.mesh.t].mean(axis=1).T

    @cached_property
    def filter(self) -> sp.csr_matrix:
        """Cone filter with rows that sum to one."""
        tree, radius = KDTree(self.centres), self.scene.design.filter_radius
        distance = tree.sparse_distance_matrix(tree, radius, output_type="coo_matrix")
        weight = sp.csr_matrix((radius - distance.data, (distance.row, distance.col)))
        return sp.diags(1 / np.asarray(weight.sum(axis=1)).ravel()) @ weight

    @cached_property
    def f_ext(self) -> Array:
        """The load's six forces through the basis at their positions."""
        f = np.zeros(self.basis.N)
        for load in self.scene.body.loads:
            x, force = load.act(self.centres, np.ones(len(self.centres)), 1e-9).places(self.centres)
            f += self.basis.probes(x.T).T @ force.T.ravel()
        return f

    @property
    def x0(self) -> Array:
        """The volume fraction everywhere."""
        return np.full(len(self.centres), self.scene.design.volume_fraction)

    @property
    def lower(self) -> Array:
        """rho_min."""
        return np.full(len(self.centres), self.scene.design.rho_min)

    @property
    def upper(self) -> Array:
        """One."""
        return np.ones(len(self.centres))

    @property
    def fingerprint(self) -> str:
        """Never resumed: its name suffices."""
        return f"plain scikit-fem, {self.nx} x {self.ny}"

    def evaluate(self, x: Array) -> Evaluation:
        """Assemble, condense, solve."""
        rho = self.filter @ x
        young = self.scene.design.contrast + rho**self.scene.design.penal * (1 - self.scene.design.contrast)
        K = stiffness.assemble(
            self.basis, young=self.density_basis.interpolate(young), nu=self.scene.body.material.poisson
        )
        u = solve(*condense(K, self.f_ext, D=self.basis.get_dofs(lambda x: np.isclose(x[0], 0))))
        volume = np.mean(rho) / self.scene.design.volume_fraction - 1
        return Evaluation(float(self.f_ext @ u), np.array([volume]), rho, u)

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """Strain energies of the elements, back through SIMP and the filter."""
        u = self.basis.interpolate(evaluation.u)
        work = energy.elemental(self.basis, u=u, nu=self.scene.body.material.poisson)
        slope = (
            self.scene.design.penal * evaluation.rho ** (self.scene.design.penal - 1) * (1 - self.scene.design.contrast)
        )
        weight = np.full(len(self.centres), 1 / (self.scene.design.volume_fraction * len(self.centres)))
        return self.filter.T @ (-slope * work), (self.filter.T @ weight)[None]


@dataclass(frozen=True)
class PlainFem:
    """Bilinear elements behind the methods' protocol, one for each point, in plane strain; fields at their centres."""

    name: str = "plain scikit-fem"
    version: str = f"scikit-fem {version('scikit-fem')}"
    capabilities: frozenset[Capability] = field(
        default=frozenset(
            {
                *("analysis", "gradient", "moduli by point", "body forces", "loads at positions"),
                *("prescribed displacements", "any outline"),
            }
        )
    )

    def analyse(self, case: Case) -> Answer:
        """See `Analyses`."""
        basis, f, u, element = self._solved(case)
        centre = Basis(basis.mesh, basis.elem, quadrature=(np.full((2, 1), 0.5), np.ones(1)))
        at = centre.interpolate(u)
        stress = np.asarray(_stress(sym_grad(at), case.body.material.poisson))[:, :, element, 0] * case.moduli
        return Answer(np.asarray(at)[:, element, 0].T, stress[[0, 1, 0], [0, 1, 1]].T, float(f @ u))

    def gradient(self, case: Case) -> Array:
        """Minus the elements' strain energies at unit modulus, twice; see `Analyses`."""
        basis, _, u, element = self._solved(case)
        work: Array = energy.elemental(basis, u=basis.interpolate(u), nu=case.body.material.poisson)
        return -work[element]

    def _solved(self, case: Case) -> tuple[Basis, Array, Array, Index]:
        """Basis, load vector f (N,), displacements u (N,), and the element (p,) of each point."""
        lower, upper = case.body.domain.bounds
        count = np.rint((upper - lower) / (2 * case.points.half_length[0])).astype(int)
        mesh = MeshQuad.init_tensor(*(np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, count, strict=True)))
        mesh = mesh.restrict(lambda x: case.body.domain.contains(x.T))
        basis = Basis(mesh, ElementVector(ElementQuad1()))
        element = KDTree(mesh.p[:, mesh.t].mean(axis=1).T).query(case.points.x)[1]

        def by_element(values: Array) -> Array:
            ordered = np.empty_like(values)
            ordered[element] = values
            return ordered

        places, forces = case.acts.places(case.points.x)
        f = basis.probes(places.T).T @ forces.T.ravel() if len(places) else np.zeros(basis.N)
        if case.body_force is not None:
            constant = by_element(case.body_force).T[:, :, None] * np.ones(basis.dx.shape)
            f = f + LinearForm(lambda v, w: dot(w.b, v)).assemble(basis, b=constant)
        density = basis.with_element(ElementQuad0())
        K = stiffness.assemble(basis, young=density.interpolate(by_element(case.moduli)), nu=case.body.material.poisson)
        given, held = np.zeros(basis.N), []
        displaced = case.displaced(mesh.p.T)
        for support in case.body.held:
            inside = np.flatnonzero(support.region.contains(mesh.p.T, 1e-9 * float(case.points.half_length.min())))
            held += [basis.nodal_dofs[a, inside] for a in (0, 1) if support.fixed[a]]
        for a in (0, 1):
            given[basis.nodal_dofs[a]] = displaced[:, a]
        return basis, f, solve(*condense(K, f, x=given, D=np.unique(np.concatenate(held)))), element


def _stress(strain: Array, nu: float) -> Array:
    return (strain + nu / (1 - 2 * nu) * eye(trace(strain), 2)) / (1 + nu)


@BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """Plane strain elasticity with Young's modulus field `young`."""
    return w.young * ddot(_stress(sym_grad(u), w.nu), sym_grad(v))


@Functional
def energy(w: Any) -> Any:
    """Stress times strain at unit modulus."""
    return ddot(_stress(sym_grad(w.u), w.nu), sym_grad(w.u))

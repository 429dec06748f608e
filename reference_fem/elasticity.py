"""Linear elasticity by finite elements: one scikit-fem quad per material point, element matrices integrated once.

Afterwards an analysis is: element moduli -> K.data (one sparse product) -> factorisation -> u, with every result
checked by its residual. Stresses are ordered (xx, yy, xy, zz) on the last axis.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis, MeshQuad
from skfem.helpers import sym_grad
from skfem.models.elasticity import linear_elasticity, linear_stress
from skfem.quadrature import get_quadrature

from mpmtop.arrays import Array, Index
from mpmtop.body import Body, Elastic, elastic
from mpmtop.criteria import StressMeasure
from mpmtop.errors import InvalidScene, NotConverged
from mpmtop.loads import action, check_work
from reference_fem.boundary import held_dofs, nodal_forces, prescribed
from reference_fem.factorise import Factorise, Solve, choose_elimination, minimum_degree_superlu
from reference_fem.forces import Forces, distributed
from reference_fem.mesh import (
    ELEMENT_CENTRE,
    GEOMETRY_TOLERANCE,
    check_mesh,
    domain_lattice,
    element_areas,
    element_centres,
    element_sides,
    shortest_side,
    vector_basis,
)
from reference_fem.outline import ANY_MESH, LATTICE, MeshKind
from reference_fem.stiffness import StiffnessMap, numbering, stiffness_map
from reference_fem.ties import Ties, tie

Eliminate = Callable[[CellBasis, Index], tuple[Index, Factorise]]  # free dofs (n,) -> in what order, and how

# Largest |r.u| / f.u, the relative error of f.u to first order in the residual r. Rounding leaves 1e-12 on designs; on
# densities drawn at random, whose void of modulus 1e-9 carries load, 1e-9 at 410,000 dofs, and refinement in double
# precision does not lower it. |r| / |f| would read ten times that and say nothing about f.u.
ENERGY_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class FemModel:
    """A body cut into quads: e elements with d dofs each, N dofs of which n are free.

    basis       scikit-fem basis whose only quadrature point is the element centre
    centres     (e, 2) element centres [length]
    area        (e,) element areas [length^2]
    elastic     elastic constants of solid elements
    free        (n,) free dofs in order of elimination
    matrices    (s, d, d) stiffness at unit modulus of each distinct element shape and Poisson's ratio
    shape       (e,) which of them an element has
    f_ext       (N,) load vector [force], but for loads that follow the density
    weight      (N, e) these by the density of each element, None if there is none
    eliminate   how free dofs are ordered and factorised
    kind        lattice or any other mesh
    forces_of   load vectors of any loads of the body; None where the model was given its own
    prescribed  (N,) displacements that supports prescribe, zero elsewhere; None if all are zero
    """

    body: Body
    basis: CellBasis
    centres: Array
    area: Array
    elastic: Elastic
    free: Index
    matrices: Array
    shape: Index
    f_ext: Array
    weight: sp.csr_matrix | None
    ties: Ties
    prescribed: Array | None
    stiffness: StiffnessMap
    factorise: Factorise
    eliminate: Eliminate
    kind: MeshKind
    forces_of: Callable[[Body], Forces] | None = None

    def force(self, rho: Array) -> Array:
        """Load vector (N,) of all loads at densities rho (e,)."""
        return self.f_ext if self.weight is None else self.f_ext + self.weight @ rho


@dataclass(frozen=True, eq=False)
class State:
    """Displacements u (N,) in equilibrium under element moduli (e,), and K^-1 by the factorisation that gave them.

    `solve` is ready for an adjoint; it is a hundred times as large as the rest, so a history should keep what it needs
    of a state rather than the state.
    """

    moduli: Array
    u: Array
    solve: Solve


def discretise(
    body: Body, size: float | tuple[float, float] | None = None, order: int = 1, *, mesh: MeshQuad | None = None
) -> FemModel:
    """Quads of side `size` over the bounding box of the domain, those whose centre is in the domain kept; or a `mesh`.

    order 1 is the bilinear element, 2 the biquadratic one. Loads act through the basis at the positions that
    `load.act` chooses among the element centres. A mesh of straight-sided quads is taken as it is, for the body.
    Raises EmptyDomain, InvalidScene (size does not divide the sides; quads that are not convex or lie outside
    the domain), LoadOutsideBody and UnsupportedBody.
    """
    if (size is None) == (mesh is None):
        raise InvalidScene("elements: give their size or a mesh, one of the two")
    if mesh is None:
        mesh, kind, eliminate = domain_lattice(body.domain, np.broadcast_to(np.asarray(size, float), 2)), *ON_LATTICE
    else:
        check_mesh(body.domain, mesh)
        kind, eliminate = ON_ANY_MESH
    basis = vector_basis(mesh, order)

    def forces_of(body: Body) -> Forces:
        centres, tol = element_centres(mesh), GEOMETRY_TOLERANCE * shortest_side(mesh)
        acts = action(body.loads, centres, element_areas(mesh), tol)
        positions, forces = acts.places(centres)
        spread = distributed(acts, body.domain, basis, kind)
        at_places = nodal_forces(basis, positions, forces, kind.locate)
        return Forces(at_places + spread.fixed, spread.weight, float(np.abs(forces).sum()) + spread.size)

    loads = forces_of(body)
    model = replace(fem_model(body, basis, loads.fixed, eliminate, kind=kind, weight=loads.weight), forces_of=forces_of)
    if body.loads:
        check_work(model.force(np.ones(len(model.area)))[model.free], loads.size)
    return model


def lattice_elimination(basis: CellBasis, free: Index) -> tuple[Index, Factorise]:
    """Order (n,) of the free dofs (n,) of lattice quads by their position, and the factorisation that suits it."""
    step = basis.elem.maxdeg // 2  # dof locations per element side: 1 bilinear, 2 biquadratic
    location = basis.doflocs[:, free].T - basis.mesh.p.min(axis=1)
    ix = np.rint(step * location / element_sides(basis.mesh).min(axis=0)).astype(np.intp)
    return choose_elimination(ix, numbering(basis.N, free)[basis.element_dofs.T])


def minimum_degree_elimination(basis: CellBasis, free: Index) -> tuple[Index, Factorise]:
    """The free dofs (n,) as they are: on a mesh of any kind the factorisation finds its own order."""
    return np.arange(len(free)), minimum_degree_superlu


ON_LATTICE = LATTICE, lattice_elimination
ON_ANY_MESH = ANY_MESH, minimum_degree_elimination


def fem_model(
    body: Body,
    basis: CellBasis,
    f_ext: Array,
    eliminate: Eliminate = lattice_elimination,
    *,
    kind: MeshKind = LATTICE,
    weight: sp.csr_matrix | None = None,
) -> FemModel:
    """Model of supports and material on a basis over quads, under the load vector f_ext (N,) and `weight` (N, e)."""
    tol = GEOMETRY_TOLERANCE * shortest_side(basis.mesh)
    held = held_dofs(body, basis, tol)
    unordered = np.flatnonzero(~held)
    order, factorise = eliminate(basis, unordered)
    free = unordered[order]
    centres = element_centres(basis.mesh)
    constants = elastic(body, centres, "element")
    matrices, shape = unit_stiffness(basis, constants)
    ties = tie(body, basis, kind, *lame(constants))
    number = numbering(basis.N, free)
    return FemModel(
        body=body,
        basis=basis,
        centres=centres,
        area=basis.dx.sum(axis=1),
        elastic=constants,
        free=free,
        matrices=matrices,
        shape=shape,
        f_ext=f_ext,
        weight=weight,
        ties=ties,
        prescribed=prescribed(body.held, basis, tol) if body.is_displaced else None,
        stiffness=stiffness_map(number, basis.element_dofs.T, matrices[shape], len(free), ties),
        factorise=factorise,
        eliminate=eliminate,
        kind=kind,
    )


def unit_stiffness(basis: CellBasis, constants: Elastic) -> tuple[Array, Index]:
    """Element stiffness at unit modulus (s, d, d) of the s distinct element shapes, and which one each has (e,).

    Elements of one Poisson's ratio that are translates of each other have equal matrices: one of them is integrated,
    by the Gauss rule that is exact on parallelograms (2 x 2 bilinear, 3 x 3 biquadratic). On other quads the integrand
    is a ratio of polynomials and no rule is exact. This one still integrates the area and B, the strain over it,
    exactly, so that constant stress is reproduced, which is what convergence takes.
    """
    corners = basis.mesh.p[:, basis.mesh.t]
    edges = (corners[:, 1:] - corners[:, :1]).reshape(6, -1).T
    told = np.rint(edges / (GEOMETRY_TOLERANCE * np.abs(edges).max()))
    several = np.ndim(constants.poisson) > 0
    if several:
        told = np.column_stack([told, constants.poisson])
    _, first, shape = np.unique(told, axis=0, return_index=True, return_inverse=True)
    exact = CellBasis(basis.mesh, basis.elem, intorder=basis.elem.maxdeg, elements=first, dofs=basis.dofs)
    lam, mu = (c[first, None] if several else c for c in lame(constants))
    return linear_elasticity(lam, mu).coo_data(exact).tolocal(), shape.ravel()


def lame(constants: Elastic) -> tuple[Any, Any]:
    """Lamé parameters (lambda, mu) at unit modulus, mu = 1 / (2 (1 + nu)): numbers, or (e,) where Poisson's ratio is.

    lambda = nu / ((1 + nu)(1 - 2 nu)) in plane strain; in plane stress, sigma_zz = 0 leaves the law of the plane with
    2 lambda mu / (lambda + 2 mu) = nu / (1 - nu^2) in its place.
    """
    nu = constants.poisson
    lam = nu / ((1 + nu) * (1 - 2 * nu)) if constants.plane == "strain" else nu / (1 - nu**2)
    return lam, 1 / (2 * (1 + nu))


def solve(model: FemModel, young: Array) -> Array:
    """Displacements u (N,), K(E) u = f, for element moduli young (e,). Raises as `inverse_stiffness` and its result."""
    return displacements(model, young, inverse_stiffness(model, young), model.f_ext)


def displacements(model: FemModel, young: Array, inverse: Solve, force: Array) -> Array:
    """u = g + w (N,) of prescribed displacements g and K w = force - K g, w zero where held, by K^-1."""
    g = model.prescribed
    return inverse(force) if g is None else g + inverse(force - resistance(model, young, g))


def resistance(model: FemModel, young: Array, u: Array) -> Array:
    """K u (N,), before any dof is held, springs and edges included."""
    dofs = model.basis.element_dofs.T
    force = young[:, None] * np.matmul(model.matrices[model.shape], u[dofs][:, :, None])[:, :, 0]
    return np.bincount(dofs.ravel(), force.ravel(), model.basis.N) + model.ties.force(young, u)


def inverse_stiffness(model: FemModel, young: Array) -> Solve:
    """K(E)^-1 for element moduli young (e,): one factorisation, for the state and any adjoint.

    It takes load vectors (N,) to displacements (N,), zero where held. Raises UnsupportedBody if K is singular; its
    result raises NotConverged if the residual changes the energy f.u of the load by over 1e-7 of it.
    """
    K = model.stiffness(young)
    factor = model.factorise(K)

    def inverse(load: Array) -> Array:
        f = load[model.free]
        free_u = factor(f)
        error, energy = abs(free_u @ (K @ free_u - f)), f @ free_u
        if not error <= ENERGY_TOLERANCE * energy:  # also catches NaN
            raise NotConverged(
                f"the residual of equilibrium carries {error:.1e} of the energy {energy:.1e}: raise the modulus "
                "contrast, or hold the part of the body that hangs on void"
            )
        u = np.zeros(model.basis.N)
        u[model.free] = free_u
        return u

    return inverse


def basis_at(model: FemModel, reference: Array) -> CellBasis:
    """The model's basis evaluated at reference positions (2, q) of every element."""
    return CellBasis(
        model.basis.mesh, model.basis.elem, quadrature=(reference, np.ones(reference.shape[1])), dofs=model.basis.dofs
    )


def strain_operator(model: FemModel, reference: Array = ELEMENT_CENTRE) -> sp.csr_matrix:
    """B (3 e q, N): B u is the strain (e, q, 3), (xx, yy, 2 xy), at reference positions (2, q) of every element."""
    basis = basis_at(model, reference)
    strain = np.stack([sym_grad(function[0]) for function in basis.basis])  # (d, 2, 2, e, q)
    values = np.stack([strain[:, 0, 0], strain[:, 1, 1], 2 * strain[:, 0, 1]], axis=-1)  # (d, e, q, 3)
    rows = np.broadcast_to(np.arange(values[0].size).reshape(values.shape[1:]), values.shape)
    columns = np.broadcast_to(basis.element_dofs[:, :, None, None], values.shape)
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(values[0].size, basis.N))


def stress(model: FemModel, u: Array, young: Array, reference: Array = ELEMENT_CENTRE) -> Array:
    """Stress (e, q, 4), (xx, yy, xy, zz), at reference positions (2, q) in [0, 1]^2 of every element.

    The default is the centre (q = 1); `gauss_points(model)` gives the integration points. sigma_zz is
    nu (sigma_xx + sigma_yy) in plane strain and zero in plane stress.
    """
    basis = basis_at(model, reference)
    lam, mu = (np.reshape(c, (-1, 1)) for c in lame(model.elastic))
    plane = linear_stress(lam, mu)(sym_grad(basis.interpolate(u))) * young[:, None]
    nu = np.reshape(model.elastic.poisson, (-1, 1)) * (model.elastic.plane == "strain")
    zz = nu * (plane[0, 0] + plane[1, 1])
    return np.stack([plane[0, 0], plane[1, 1], plane[0, 1], zz], axis=-1)


def gauss_points(model: FemModel) -> Array:
    """Reference positions (2, q) of the integration points: 2 x 2 bilinear, 3 x 3 biquadratic."""
    return get_quadrature(model.basis.elem, model.basis.elem.maxdeg)[0]


def von_mises(sigma: Array, measure: StressMeasure = "von_mises") -> Array:
    """Von Mises stress (...,) of stresses (..., 4) ordered (xx, yy, xy, zz); in the plane zz does not count."""
    xx, yy, xy, zz = np.moveaxis(sigma, -1, 0)
    if measure == "von_mises_in_plane":
        return np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2)


def von_mises_factor(constants: Elastic, measure: StressMeasure = "von_mises") -> Array:
    """M (1, 3, 3), or (e, 3, 3) of several materials, with vm = |M eps|, the von Mises stress of solid material under
    the strain eps = (xx, yy, 2 xy).

    With s = (sigma_xx + sigma_yy) / 2, d = (sigma_xx - sigma_yy) / 2, t = sigma_xy: vm^2 = (s - sigma_zz)^2 + 3 d^2 +
    3 t^2, where s = (lambda + mu)(eps_xx + eps_yy), d = mu (eps_xx - eps_yy), t = 2 mu eps_xy and sigma_zz = 2 nu s in
    plane strain, 0 in plane stress and where the measure leaves it out.
    """
    lam, mu = (constants.young * constant for constant in lame(constants))
    zz_counts = constants.plane == "strain" and measure == "von_mises"
    mean, shear = np.broadcast_arrays((lam + mu) * (1 - 2 * constants.poisson * zz_counts), np.sqrt(3) * mu)
    none = np.zeros_like(mean)
    rows = np.array([[mean, mean, none], [shear, -shear, none], [none, none, shear]])
    return rows.reshape(3, 3, -1).transpose(2, 0, 1)

"""The common judge: one finite element analysis for the designs of every method, on equal terms.

A design is densities at points that own rectangles. The judge cuts a lattice finer than the smallest rectangle, gives
each cell the density of its owner, and solves with biquadratic elements. Densities are taken as they are: no filter.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from skfem import CellBasis

from mpmtop.arrays import Array, Index
from mpmtop.body import Body
from mpmtop.criteria import Criterion, PNormStress, Worst
from mpmtop.design import Design, physical_densities
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody
from mpmtop.loads import action
from mpmtop.scene import Scene
from reference_fem.boundary import nodal_forces
from reference_fem.elasticity import FemModel, fem_model, inverse_stiffness, stress, von_mises
from reference_fem.forces import Forces, distributed
from reference_fem.mesh import GEOMETRY_TOLERANCE, element_centres, element_sides, lattice, vector_basis
from reference_fem.objectives import p_norm
from reference_fem.outline import LATTICE
from reference_fem.simp import simp

GAUSS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / np.sqrt(12)  # of the side: exact to cubics along each axis


@dataclass(frozen=True, eq=False)
class Judgement:
    """Compliance f.u of a design, free dofs and elements of the judge's mesh, displacements u (N,)."""

    compliance: float
    dofs: int
    elements: int
    u: Array


@dataclass(frozen=True, eq=False)
class JudgedStress:
    """Relaxed von Mises stress s (e,) at the centres of the judge's elements, its p-norm and its largest value."""

    s: Array
    p_norm: float
    largest: float


@dataclass(frozen=True, eq=False)
class Judge:
    """A finite element model over p points, ready for any number of designs of one law; owner (e,) of each element."""

    model: FemModel
    design: Design
    objective: Criterion | Worst
    owner: Index
    points: int

    def __call__(self, rho: Array) -> Judgement:
        """Analyse the physical densities rho (p,) in [0, 1] of the points: one factorisation, one solve."""
        rho = physical_densities(rho, self.points, "point")
        moduli = simp(rho, self.model.body.material, self.design)[0][self.owner]
        force = self.model.force(rho[self.owner])
        u = inverse_stiffness(self.model, moduli)(force)
        return Judgement(float(force @ u), len(self.model.free), len(self.owner), u)


def reanalyse(scene: Scene, x: Array, half_length: Array, rho: Array, split: int = 2, order: int = 2) -> Judgement:
    """Judge one design; see `build_judge`, which serves many designs on the same points."""
    return build_judge(scene, x, half_length, split, order)(rho)


def build_judge(scene: Scene, x: Array, half_length: Array, split: int = 2, order: int = 2) -> Judge:
    """Judge for points x (p, 2) owning rectangles of half-length (p, 2), which may differ in size and overlap.

    The lattice's pitch is the smallest full length over `split`. A cell belongs to the point whose rectangle holds its
    centre, in an overlap to the nearest in Chebyshev distance scaled by the half-lengths; a cell in none is absent.

    Loads: a force that a point carries is spread uniformly over that point's cells, so that it is the
    same load on every mesh. Point forces would not do: the energy of a point force in the plane is infinite, the
    compliance would grow with the logarithm of 1/pitch. On one bilinear element per point the two are identical.
    A `PositionLoad` asks for the position itself and gets it, divergence included.

    Raises InvalidScene, EmptyDomain, LoadOutsideBody and UnsupportedBody.
    """
    if split < 1:
        raise InvalidScene(f"split {split}: give 1 or more elements along each point's side")
    full = lattice(scene.body.domain.bounds, 2 * half_length.min(axis=0) / split)
    owner = owners(element_centres(full), x, half_length)
    owned = np.flatnonzero(owner >= 0)
    if len(owned) == 0:
        raise EmptyDomain(
            f"no point's rectangle lies in the domain of {scene.name!r}: check positions and half-lengths"
        )
    basis = vector_basis(full.restrict(owned), order)
    load = _load(scene.body, basis, x, half_length, owner[owned])
    model = fem_model(scene.body, basis, load.fixed, weight=load.weight)
    return Judge(model, scene.design, scene.objective, owner[owned], len(x))


def judge_stress(judge: Judge, rho: Array, judgement: Judgement) -> JudgedStress:
    """Relaxed stress s_e = rho^q vm_e of a judged design rho (p,), vm that of solid material, modulus E0 (Eq. 9).

    Its p-norm is (sum_e s_e^p / n_e)^(1/p), n_e being the number of elements of the point that owns element e: every
    point counts once at any resolution, and with one element per point this is Eq. (9). p, q and the measure of vm are
    those of the scene's `PNormStress`, or its defaults if the scene has another objective.
    """
    rho = physical_densities(rho, judge.points, "point")
    stated = judge.objective if isinstance(judge.objective, PNormStress) else PNormStress()
    solid = np.full(len(judge.owner), judge.model.body.material.young)
    vm = von_mises(stress(judge.model, judgement.u, solid), stated.measure)[:, 0]
    s = rho[judge.owner] ** stated.q * vm
    weight = 1 / np.bincount(judge.owner)[judge.owner]
    return JudgedStress(s, p_norm(s, stated.p, weight), float(s.max()))


def owners(cells: Array, x: Array, half_length: Array) -> Index:
    """Point (m,) whose rectangle holds each of the cell centres (m, 2), the nearest if several do, -1 if none."""
    best = np.full(len(cells), 1 + GEOMETRY_TOLERANCE)
    owner = np.full(len(cells), -1)
    rounded = np.rint(half_length / (GEOMETRY_TOLERANCE * half_length.min()))
    _, first, size = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    for s, half in enumerate(half_length[first]):  # one search for each size of rectangle: a few levels
        members = np.flatnonzero(size.ravel() == s)
        distance, nearest = cKDTree(x[members] / half).query(cells / half, p=np.inf)
        closer = distance < best
        best[closer], owner[closer] = distance[closer], members[nearest[closer]]
    return owner


def _load(body: Body, basis: CellBasis, x: Array, half_length: Array, owner: Index) -> Forces:
    """Load vectors of loads on points x (p, 2), spread over the elements that `owner` (e,) gives them."""
    sides = element_sides(basis.mesh)
    acts = action(body.loads, x, np.prod(2 * half_length, axis=1), GEOMETRY_TOLERANCE * float(sides.min()))
    force = np.zeros_like(x)
    np.add.at(force, acts.points, acts.carried)
    loaded = np.any(force != 0, axis=1)
    cells = np.bincount(owner, minlength=len(x))
    if np.any(loaded & (cells == 0)):
        raise LoadOutsideBody(
            f"the loaded point at {x[loaded & (cells == 0)][0]} owns no cell of the domain: move the load"
        )
    element = np.flatnonzero(loaded[owner])
    share = (force / np.maximum(cells, 1)[:, None])[owner[element]] / len(GAUSS)
    gauss = element_centres(basis.mesh)[element, None] + GAUSS * sides[element, None]
    position, at = np.concatenate([acts.position, gauss.reshape(-1, 2)]), np.repeat(share, len(GAUSS), axis=0)
    spread = distributed(acts, body.domain, basis, LATTICE)
    at_places = nodal_forces(basis, position, np.concatenate([acts.force, at]))
    return spread._replace(fixed=at_places + spread.fixed)

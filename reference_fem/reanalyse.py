"""The common judge: one finite element analysis for the designs of every method, on equal terms.

A design is densities at points that own rectangles. The judge cuts a lattice finer than the smallest rectangle, gives
each cell the density of its owner, and solves with biquadratic elements. Densities are taken as they are: no filter.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.spatial import cKDTree
from skfem import CellBasis

from mpmtop.arrays import Array, Index, Mask
from mpmtop.body import Body
from mpmtop.criteria import AtMost, Criterion, PNormStress, Worst
from mpmtop.design import Design, physical_densities
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody
from mpmtop.loads import action
from mpmtop.region import Region
from mpmtop.scene import LoadCase, Scene
from reference_fem.boundary import nodal_forces
from reference_fem.cases import Sum, case_models, constraint_sums, objective_sums, states
from reference_fem.elasticity import FemModel, State, fem_model, stress, von_mises
from reference_fem.forces import Forces, distributed
from reference_fem.mesh import ELEMENT_CENTRE, GEOMETRY_TOLERANCE, element_centres, element_sides, lattice, vector_basis
from reference_fem.objectives import Objective, objective, p_norm, p_norm_stress
from reference_fem.outline import LATTICE
from reference_fem.simp import simp

VOLUME_ROUNDING = 1e-9  # of a design's volume, whose sum of many terms a cut within it is to reach
GAUSS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / np.sqrt(12)  # of the side: exact to cubics along each axis


@dataclass(frozen=True, eq=False)
class Judgement:
    """Compliance f.u of a design, free dofs and elements of the judge's mesh, displacements u (N,).

    With load cases compliance and u are of the first one; `states` are all of them.
    """

    compliance: float
    dofs: int
    elements: int
    states: tuple[State, ...]

    @property
    def u(self) -> Array:
        """Displacements (N,), in the first load case."""
        return self.states[0].u


@dataclass(frozen=True, eq=False)
class JudgedStress:
    """Relaxed von Mises stress s (e,) at the centres of the judge's elements, its p-norm and its largest value."""

    s: Array
    p_norm: float
    largest: float


@dataclass(frozen=True, eq=False)
class JudgedCriteria:
    """Objectives (k,), the largest of which counts, and constraints g (m,) of the scene, but that of the volume
    fraction."""

    objectives: Array
    constraints: Array

    @property
    def objective(self) -> float:
        """J."""
        return float(self.objectives.max())


@dataclass(frozen=True, eq=False)
class Judge:
    """A finite element model over p points, in each load case, ready for any number of designs of one scene; owner (e,)
    of each element."""

    models: tuple[FemModel, ...]
    design: Design
    objective: Criterion | Worst
    owner: Index
    points: int
    constraints: tuple[AtMost, ...] = ()
    cases: tuple[LoadCase, ...] = ()

    @property
    def model(self) -> FemModel:
        """The model, in the first load case."""
        return self.models[0]

    @cached_property
    def sums(self) -> tuple[tuple[Sum, ...], tuple[Sum, ...]]:
        """The scene's objectives and constraints on the judge's mesh."""
        area = self.model.area
        solid = np.ones(len(area), bool) if self.design.passive_void is None else ~self._in(self.design.passive_void)
        per_point = 1 / np.bincount(self.owner)[self.owner]
        make = partial(judged_functional, self.model, area / area[solid].sum(), per_point)
        sought = self.objective.criterion if isinstance(self.objective, Worst) else self.objective
        objectives = objective_sums(self.objective, make(sought), self.cases)
        return objectives, constraint_sums(self.constraints, make, len(self.models))

    def _in(self, region: Region) -> Mask:
        return region.contains(self.model.centres)

    def __call__(self, rho: Array) -> Judgement:
        """Analyse the physical densities rho (p,) in [0, 1] of the points: one factorisation, one solve."""
        rho = physical_densities(rho, self.points, "point")
        on_elements = rho[self.owner]
        moduli = simp(on_elements, self.model.elastic, self.design)[0]
        found = states(self.models, moduli, on_elements)
        work = float(self.model.force(on_elements) @ found[0].u)
        return Judgement(work, len(self.model.free), len(self.owner), found)


def reanalyse(
    scene: Scene, x: Array, half_length: Array, rho: Array, split: int = 2, order: int = 2, *, trim: bool = False
) -> Judgement:
    """Judge one design; see `build_judge`, which serves many designs on the same points."""
    return build_judge(scene, x, half_length, split, order, trim=trim)(rho)


def build_judge(
    scene: Scene, x: Array, half_length: Array, split: int = 2, order: int = 2, *, trim: bool = False
) -> Judge:
    """Judge for points x (p, 2) owning rectangles of half-length (p, 2), which may differ in size and overlap.

    The lattice's pitch is the smallest full length over `split`. A cell belongs to the point whose rectangle holds its
    centre, in an overlap to the nearest in Chebyshev distance scaled by the half-lengths; a cell in none is absent, and
    with `trim` one whose centre the domain does not hold, as beside points that are cut along the outline.

    Loads: a force that a point carries is spread uniformly over that point's cells, so that it is the
    same load on every mesh. Point forces would not do: the energy of a point force in the plane is infinite, the
    compliance would grow with the logarithm of 1/pitch. On one bilinear element per point the two are identical.
    A `PositionLoad` asks for the position itself and gets it, divergence included.

    Raises InvalidScene, EmptyDomain, LoadOutsideBody and UnsupportedBody.
    """
    if split < 1:
        raise InvalidScene(f"split {split}: give 1 or more elements along each point's side")
    full = lattice(scene.body.domain.bounds, 2 * half_length.min(axis=0) / split)
    centres = element_centres(full)
    owner = owners(centres, x, half_length)
    if trim:
        owner[~scene.body.domain.contains(centres)] = -1
    owned = np.flatnonzero(owner >= 0)
    if len(owned) == 0:
        raise EmptyDomain(
            f"no point's rectangle lies in the domain of {scene.name!r}: check positions and half-lengths"
        )
    basis = vector_basis(full.restrict(owned), order)
    whole = np.prod(2 * half_length, axis=1)
    cells: Array = np.bincount(owner[owned], minlength=len(x)).astype(float)
    volume = cells * float(np.prod(element_sides(full)[0])) if trim else whole
    forces_of = partial(_load, basis=basis, x=x, volume=volume, owner=owner[owned])
    load = forces_of(scene.body)
    model = replace(fem_model(scene.body, basis, load.fixed, weight=load.weight), forces_of=forces_of)
    models = case_models(model, scene.cases)
    return Judge(models, scene.design, scene.objective, owner[owned], len(x), scene.constraints, scene.cases)


def judge_criteria(judge: Judge, rho: Array, judgement: Judgement) -> JudgedCriteria:
    """Objectives and constraints of the scene for a judged design rho (p,).

    What they are of is taken on the judge's mesh: stresses and the fields of one's own criteria at the element centres,
    a p-norm that counts points as `judge_stress` does.
    """
    on_elements = physical_densities(rho, judge.points, "point")[judge.owner]
    objectives, constraints = (
        np.array([each.value(judge.models, judgement.states, on_elements) for each in sums]) for sums in judge.sums
    )
    return JudgedCriteria(objectives, constraints)


def judged_functional(model: FemModel, share: Array, per_point: Array, stated: Criterion) -> Objective:
    """A criterion on the judge's mesh; `share` (e,) as for `objective`, `per_point` (e,) one over the elements of each
    element's point."""
    if isinstance(stated, PNormStress) and stated.weight == "count":
        return p_norm_stress(model, stated.p, stated.q, ELEMENT_CENTRE, stated.measure, per_point)
    return objective(stated, model, "centre", share)


def thresholded(rho: Array, volume: Array, level: float | None = None, *, exceed: float = 0.5) -> Array:
    """Densities (p,) cut to 0 and 1: above the `level`, or where none is given the densest points of the given volumes
    (p,) up to the volume of rho, which the last one may exceed by the part `exceed` of its own: half of it comes
    nearest, none keeps within. Rounding does not choose between mirror images."""
    if level is not None:
        return (rho > level).astype(float)
    densest = np.argsort(-np.round(rho, 6), kind="stable")
    kept = np.cumsum(volume[densest]) - exceed * volume[densest] <= (1 + VOLUME_ROUNDING) * float(rho @ volume)
    black = np.zeros_like(rho)
    black[densest[kept]] = 1
    return black


def judge_stress(judge: Judge, rho: Array, judgement: Judgement) -> JudgedStress:
    """Relaxed stress s_e = rho^q vm_e of a judged design rho (p,), vm that of solid material, modulus E0 (Eq. 9).

    Its p-norm is (sum_e s_e^p / n_e)^(1/p), n_e being the number of elements of the point that owns element e: every
    point counts once at any resolution, and with one element per point this is Eq. (9). p, q and the measure of vm are
    those of the scene's `PNormStress`, or its defaults if the scene has another objective.
    """
    rho = physical_densities(rho, judge.points, "point")
    stated = judge.objective if isinstance(judge.objective, PNormStress) else PNormStress()
    solid = np.full(len(judge.owner), judge.model.elastic.young)
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


def _load(body: Body, *, basis: CellBasis, x: Array, volume: Array, owner: Index) -> Forces:
    """Load vectors of loads on points x (p, 2) of volumes (p,), spread over the elements that `owner` (e,) gives
    them."""
    sides = element_sides(basis.mesh)
    acts = action(body.loads, x, volume, GEOMETRY_TOLERANCE * float(sides.min()))
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
    size = float(np.abs(force).sum() + np.abs(acts.force).sum()) + spread.size
    return Forces(at_places + spread.fixed, spread.weight, size)

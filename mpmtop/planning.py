"""Plan: what an analysis of a problem computes and what it skips, in words."""

import numpy as np
import scipy.sparse as sp

from mpmtop.cases import shared_with
from mpmtop.criteria import Worst
from mpmtop.cut import WHOLE
from mpmtop.loads import action
from mpmtop.model import Model
from mpmtop.problem import DesignProblem
from mpmtop.solvers import MAX_ITERATIONS, MultigridCG
from mpmtop.stiffness import CellMap


def plan(problem: DesignProblem) -> str:
    """What an analysis of the problem computes and what it skips, and why: one line each, to print.

    TypeError for problems of another kind: load steps and elements compute all that they are asked for.
    """
    if not isinstance(problem, DesignProblem):
        raise TypeError(f"a plan of {type(problem).__name__}: give a DesignProblem, of material points at small strain")
    model = problem.model
    total, active = int(np.prod(model.grid.nodes)), len(model.transfer.nodes)
    held = 2 * active - len(model.stiffness.dof)
    touched = np.count_nonzero(model.transfer.touched, axis=1)
    p = len(touched)
    space, n = problem.space, len(problem.positions)
    passive = f"{np.count_nonzero(space.solid)} are passive solid, {np.count_nonzero(space.void)} passive void"
    lines = [
        f"design variables: {n} of {p} points; {'none is passive' if space.all_active else passive}",
        *_point_plan(model),
        f"nodes: {active} of {total} get degrees of freedom; no point touches the others",
        f"unknowns: {len(model.stiffness.dof)}; {held} degrees of freedom are held and never assembled",
        f"stencil ({model.shape_function.__name__}): {np.mean(touched):.2f} nodes for a point on average; "
        f"{np.count_nonzero(touched <= 4)} of {p} points need no more than the 4 of their own cell",
        f"loads: {_load_plan(model)}",
        *_support_plan(model),
        *_material_plan(model),
        f"dilatation: {'of each point' if model.transfer.b_bar is None else 'averaged over each cell (B-bar)'}",
        f"ghost faces: {_ghost_plan(model)}",
        f"stiffness: {len(model.stiffness.row)} entries of the lower triangle, {_stiffness_plan(model)}",
        f"solver: {_solver_plan(model, problem.tolerance)}",
        "solves: one for a design, and one more for each step of iterative refinement where rounding calls for it",
        _adjoint_plan(sum(functional.solves for functional in problem.functionals)),
        "stresses: at every point"
        if any(functional.of_stress for functional in problem.functionals)
        else "stresses: skipped, the objective needs none",
        f"filter: {_filter_plan(problem)}",
        *_asked_plan(problem),
        *dict.fromkeys(
            f"warning, {type(finding).__name__}: {finding}" for each in problem.models for finding in each.findings
        ),
    ]
    return "\n".join(lines)


def _point_plan(model: Model) -> list[str]:
    """How many points are cut along the outline, where some are."""
    points = model.points
    pieces = np.count_nonzero(points.volume < (1 - WHOLE) * np.prod(2 * points.half_length, axis=1))
    said = f"points: {pieces} of {len(points.volume)} are cut along the outline, each at the centroid of its piece"
    return [said] if pieces else []


def _support_plan(model: Model) -> list[str]:
    """What only some bodies have beside nodes that are held where they are."""
    body = model.body
    moved = sum(any(support.displacement) for support in body.held)
    parts = [
        f"{count} {what}"
        for count, what in (
            (moved, "of prescribed displacement: their forces on the body are part of the load"),
            (len(body.edges), "along the outline, weakly (Nitsche)"),
            (len(body.springs), "springs"),
            (len(body.beds), "elastic beds"),
        )
        if count
    ]
    return [f"supports: {'; '.join(parts)}"] if parts else []


def _material_plan(model: Model) -> list[str]:
    """How many points are of which material, where there are several."""
    if not model.body.parts:
        return []
    count = len(model.points.x)
    constants = np.column_stack([np.broadcast_to(c, count) for c in (model.elastic.young, model.elastic.poisson)])
    kinds, points = np.unique(constants, axis=0, return_counts=True)
    each = "; ".join(f"{n} points of E0 = {E:g}, nu = {nu:g}" for (E, nu), n in zip(kinds, points, strict=True))
    return [f"materials: {each}"]


def _adjoint_plan(solves: int) -> str:
    if solves > 1:
        return f"adjoint solves: {solves}, with the factorisations of the states"
    if solves == 1:
        return "adjoint solve: one, with the factorisation of the state"
    return "adjoint solve: skipped, compliance is self-adjoint"


def _asked_plan(problem: DesignProblem) -> list[str]:
    """What only some scenes ask for: load cases, constraints, projection, symmetry."""
    lines, design = [], problem.design
    if problem.cases:
        first = shared_with(problem.models)
        groups = [[str(k) for k, other in enumerate(first) if other == leader] for leader in sorted(set(first))]
        shared = "; ".join(
            f"cases {', '.join(group)} share one" if len(group) > 1 else f"case {group[0]} has its own"
            for group in groups
        )
        lines.append(f"load cases: {len(first)}, one solve each, {len(groups)} factorisation(s): {shared}")
        of_cases = "the largest of all, by a bound variable" if isinstance(problem.objective, Worst) else "weighted sum"
        lines.append(f"objective of the cases: {of_cases}")
    if problem.constraints:
        volume = "the volume fraction and " if problem.limits_volume else "no volume fraction, "
        lines.append(f"constraints: {volume}{problem.others} of values, each with a gradient of its own")
    if design.projection is not None:
        eta = "that keeps the volume" if design.projection.preserve_volume else f"{design.projection.threshold:g}"
        move = f", moves of {problem.largest_move:g} at most" if problem.largest_move < 1 else ""
        lines.append(f"projection: beta {design.projection.beta:g}, threshold {eta}{move}")
    if design.symmetry:
        lines.append(f"symmetry: {len(problem.positions)} variables for {len(problem.space.active)} active points")
    return lines


def _load_plan(model: Model) -> str:
    points = model.points
    acts = action(model.body.loads, points.x, points.volume, 1e-9 * min(model.grid.h))
    parts = {
        f"{len(acts.points)} forces carried by points": len(acts.points),
        f"{len(acts.position)} at positions": len(acts.position),
        f"{len(acts.along)} along the outline": len(acts.along),
        f"{len(acts.throughout)} by volume": len(acts.throughout),
    }
    follows = "" if model.forces.weight is None else ", of which some follow the density: a part of every gradient"
    return (", ".join(text for text, count in parts.items() if count) or "none") + follows


def _ghost_plan(model: Model) -> str:
    ghost = model.ghost
    faces = ghost.modulus.shape[0]
    if ghost.gamma == 0:
        return "skipped, the ghost penalty is off"
    if faces == 0:
        return f"skipped, none of the {ghost.between} between two cells of the body has a cut cell beside it"
    return f"{faces} of {ghost.between} between two cells of the body have a cut cell beside them"


def _solver_plan(model: Model, tolerance: float) -> str:
    if isinstance(model.solver, MultigridCG):
        if model.solver.too_tight(tolerance):
            return f"SparseCholesky, one factorisation for a design: the criteria ask for a residual of {tolerance:g}"
        return f"MultigridCG, one hierarchy for a design; sparse Cholesky where {MAX_ITERATIONS} iterations do not do"
    return f"{type(model.solver).__name__}, one factorisation for a design"


def _stiffness_plan(model: Model) -> str:
    part = model.stiffness.maps[0]
    if isinstance(part, CellMap):
        return f"by {len(part.place)} cells and {len(part.local)} distinct matrices of points"
    return "one sparse product, as the points' matrices differ"


def _filter_plan(problem: DesignProblem) -> str:
    matrix = problem.filter.matrix
    return f"{matrix.nnz} weights, built once" if sp.issparse(matrix) else "a convolution over the lattice of points"

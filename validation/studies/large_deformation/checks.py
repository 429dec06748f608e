"""What is known without a computation: uniform deformation, rotation, and the balance of work and energy."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body, Support
from mpmtop.grid import Grid
from mpmtop.large_deformation.law import jacobian, stress
from mpmtop.large_deformation.model import Model, discretise
from mpmtop.large_deformation.step import State, moved, operators, start
from mpmtop.large_deformation.steps import Trajectory
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from validation.bodies.large import METHODS

SIZE, BOX = 8, 13
"""Cells of a square block, and of the box around its corner to each side."""
QUARTER = np.pi / 2
INCREMENTS = 10


def turn(angle: float) -> Array:
    """R (2, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


WIDE = np.diag([1.3, 0.8])
"""A stretch by which domains of half a cell stay below one."""
UNIFORM: dict[str, Array] = {
    "stretch": WIDE,
    "shear": np.array([[1.0, 0.4], [0.0, 1.0]]),
    "rotation by 45 degrees": turn(QUARTER / 2),
    "rotation by 90 degrees": turn(QUARTER),
    "stretch, then 90 degrees": turn(QUARTER) @ WIDE,
}


def block(method: str) -> Model:
    """A square of cells of side 1 with 2 x 2 points each; supports, load and background play no part."""
    domain, held = Rectangle((0.0, 0.0), (float(SIZE), float(SIZE))), Support(Rectangle((0.0, 0.0), (0.0, 0.0)))
    body = Body(domain, (held,), (RegionLoad(domain, (0.0, -1.0)),))
    grid = Grid((-BOX, -BOX), (1.0, 1.0), (2 * BOX, 2 * BOX))
    return discretise(body, grid=grid, **(METHODS[method] | {"alpha": 0.0}))


def reached(model: Model, F: Array) -> State:
    """The state of a block under x = F X, in increments of nodes along the straight line from 1 to F; rotations along
    their arc."""
    stretched = np.sqrt(np.linalg.eigvalsh(F.T @ F))
    rigid = np.allclose(stretched, 1)
    angle = np.arctan2(F[1, 0], F[0, 0])
    way = [
        turn(angle * t) if rigid else np.eye(2) + t * (F - np.eye(2)) for t in np.arange(1, INCREMENTS + 1) / INCREMENTS
    ]
    nodes, state, before = model.grid.node_positions(), start(model), np.eye(2)
    for to in way:
        ops = operators(model, state)
        # in the total frame nodes are those of the undeformed body
        here = nodes if model.frame == "total" else nodes @ np.linalg.inv(before).T
        u = here @ (to - before).T
        state = moved(model, state, ops.at_points(u), state.F + ops.gradient(u))
        before = to
    return state


def imbalance(model: Model, state: State) -> float:
    """Largest force of a unit hydrostatic Cauchy stress at nodes that the block surrounds, by the sum of the sizes of
    its points' parts there: zero where a uniform stress is in equilibrium."""
    ops, n = operators(model, state), int(np.prod(model.grid.nodes))
    volume = model.points.volume * (1.0 if model.frame == "total" else jacobian(state.F))
    parts = volume[:, None, None] * ops.weights.grad_N
    node, count = ops.weights.node.ravel(), len(model.points.x)
    force = np.stack([np.bincount(node, parts[..., a].ravel(), n) for a in (0, 1)], axis=1)
    size = np.bincount(node, np.linalg.norm(parts, axis=2).ravel(), n)
    inside = _inside(model, state, count)
    return float(np.max(np.linalg.norm(force[inside], axis=1) / size[inside]))


def _inside(model: Model, state: State, count: int) -> Array:
    """Nodes (nodes,) whose cells and their neighbours lie in the block."""
    F = np.eye(2) if model.frame == "total" else state.F[count // 2]
    X = model.grid.node_positions() @ np.linalg.inv(F).T
    margin = 2.5 * np.abs(np.linalg.inv(F)).sum(axis=1)
    return np.all((margin < X) & (SIZE - margin > X), axis=1)


def uniform(method: str) -> dict[str, tuple[float, float, float]]:
    """By deformation: largest errors of F, of x [cells], and the imbalance of a uniform stress."""
    model = block(method)
    found = {}
    for name, F in UNIFORM.items():
        state = reached(model, F)
        x = np.abs(state.x - model.points.x @ F.T).max()
        found[name] = (float(np.abs(state.F - F).max()), float(x), imbalance(model, state))
    return found


def rotated(method: str) -> tuple[float, Array]:
    """Largest stress [E] after a quarter turn, and the half-lengths by those at the start, (2,)."""
    model = block(method)
    state = reached(model, turn(QUARTER))
    return float(np.abs(stress(model.law, state.F)).max()), np.mean(
        state.half_length / model.points.half_length, axis=0
    )


def energy_gap(model: Model, path: Trajectory) -> tuple[float, float]:
    """(work of the loads - stored energy) / stored energy at the end, and what the background took of it.

    Work by the trapezium rule over the steps; the background's forces start from none in every step, S q at its end.
    """
    levels = np.append(0.0, model.levels)
    moved_by = [np.sum(model.force * (b.x - a.x)) for a, b in zip(path.states[:-1], path.states[1:], strict=True)]
    work = float(np.sum((levels[:-1] + levels[1:]) / 2 * moved_by))
    stored = float((model.points.volume * path.moduli) @ model.law.energy(path.states[-1].F).W)
    taken = 0.0
    for state, step in zip(path.states, path.increments, strict=False):
        ops = operators(model, state)
        to_unknowns = ops.assembly.to_unknowns
        q = (to_unknowns @ step.u.ravel()) / (to_unknowns.multiply(to_unknowns)).sum(axis=1)
        taken += q @ (ops.assembly.soft @ q) / 2
    return work / stored - 1, taken / stored

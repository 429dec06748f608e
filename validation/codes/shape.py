"""What is observed of shape functions in the plane: nodes, N and grad N at positions with rectangular domains.

All are of points inside a body that holds the whole grid, so that no function has reached an end of it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array, Mask
from mpmtop.grid import Grid
from validation.codes.answers import Misanswered
from validation.codes.card import Observed
from validation.methods.protocol import HasShape, Shape

CELLS, AWAY = 10, 3
"""Cells of the grid each way, and how many of them lie between its edge and the points: no known function reaches
further than two."""
ROUNDING = 1e-12
"""Sums of a few products near one, of nodes whose positions are a few units off: 1e-16 with four digits to spare."""
STEP = 1e-5
"""Of a difference quotient, in cells: 1e-11 by a cubic's third derivative, 1e-11 by rounding."""
KINK = 1e-3
"""Distance [cells] kept from places where functions in use have kinks: lines, half lines, domains' edges on them."""
REVERSED = "half-open convention reversed on one side"


@dataclass(frozen=True, eq=False)
class Sample:
    """Positions (k, 2) with domains of half_length (k, 2) on a grid."""

    grid: Grid
    x: Array
    half_length: Array

    @property
    def from_line(self) -> Array:
        """Distance (k, 2) of the positions from the nearest grid line [cells]."""
        xi = self.grid.cell_coordinates(self.x)
        return np.abs(xi - np.rint(xi))

    @property
    def crosses(self) -> Mask:
        """Whose domain holds a part of a grid line (k,)."""
        return np.any(self.from_line < self.half_length / self.grid.h, axis=1)


def sample(
    origin: tuple[float, float] = (0.0, 0.0), h: tuple[float, float] = (1.0, 1.0), count: int = 300, seed: int = 0
) -> Sample:
    """Points at random in the middle of a grid, away from kinks, with domains of a tenth to one half of a cell."""
    rng = np.random.default_rng(seed)
    xi = rng.uniform(AWAY, CELLS - AWAY, (4 * count, 2))
    half = rng.uniform(0.05, 0.25, (4 * count, 2))
    places = np.stack([xi, xi - half, xi + half, xi - 0.5])
    clear = np.all(np.abs(places - np.rint(places)) > KINK, axis=(0, 2))
    xi, half = xi[clear][:count], half[clear][:count]
    return Sample(Grid(origin, h, (CELLS, CELLS)), origin + xi * h, half * h)


def asked(code: HasShape, at: Sample, x: Array | None = None) -> Shape:
    """The code's functions at a sample, or at other positions with its domains; Misanswered if they are none."""
    x = at.x if x is None else x
    return counted(code.shape(x, at.half_length[: len(x)], at.grid), len(x), at.grid)


def counted(given: Shape, k: int, grid: Grid) -> Shape:
    """Functions at k positions as a code gave them, counted, finite, on nodes of the grid; Misanswered if not."""
    node, N, grad_N = given
    N, grad_N, node = np.asarray(N, float), np.asarray(grad_N, float), np.asarray(node)
    n = N.shape[-1] if N.ndim else 0
    if node.shape != (k, n, 2) or N.shape != (k, n) or grad_N.shape != (k, n, 2):
        raise Misanswered(
            f"node {node.shape}, N {N.shape}, grad N {grad_N.shape} for {k} points: give (k, n, 2), (k, n), (k, n, 2)"
        )
    if not (np.all(np.isfinite(N)) and np.all(np.isfinite(grad_N))):
        raise Misanswered("values or gradients are not finite")
    used = (N != 0) | np.any(grad_N != 0, axis=-1)
    if np.any(used & ~np.all((node >= 0) & (node <= grid.cells), axis=-1)):
        raise Misanswered("nodes lie outside the grid: give lattice indices (i, j), from the origin on")
    return Shape(node.astype(np.intp), N, grad_N)


def dense(shape: Shape) -> Array:
    """N and both gradients (k, nodes, 3) on all nodes of the grid: comparable whatever the order of the nodes."""
    k, side = len(shape.N), CELLS + 1
    full = np.zeros((k, side * side, 3))
    index = shape.node[..., 0] * side + shape.node[..., 1]
    values = np.concatenate([shape.N[..., None], shape.grad_N], axis=-1)
    used = np.any(values != 0, axis=-1)
    point = np.broadcast_to(np.arange(k)[:, None], used.shape)
    np.add.at(full, (point[used], index[used]), values[used])
    return full


def worst(error: Array, at: Sample, kind: str = "") -> Observed:
    """Largest of the errors (k,) or (k, ...), and at which point."""
    by_point = error.reshape(len(at.x), -1).max(axis=1)
    p = int(np.argmax(by_point))
    near = " whose domain crosses a grid line" if at.crosses[p] else ""
    return Observed(float(by_point[p]), f"point at {_place(at, p)} cells{near}", kind)


def _place(at: Sample, p: int) -> str:
    return "({:.4g}, {:.4g})".format(*at.grid.cell_coordinates(at.x)[p])


def unity(code: HasShape) -> Observed:
    at = sample()
    inside = ~at.crosses
    return worst(np.abs(asked(code, at).N.sum(axis=1) - 1)[inside], _part(at, inside))


def reach(code: HasShape) -> Observed:
    """|sum N - 1| and |sum N x - x| of points whose domains cross a line."""
    at = sample()
    shape, crossing = asked(code, at), at.crosses
    error = np.abs(shape.N.sum(axis=1) - 1) + np.abs(_moment(shape, at.grid) - at.grid.cell_coordinates(at.x)).sum(1)
    found = worst(error[crossing], _part(at, crossing))
    within = error[~crossing].max()
    return found._replace(kind="weights end at the cell" if within <= ROUNDING < found.value else "")


def _part(at: Sample, chosen: Mask) -> Sample:
    return Sample(at.grid, at.x[chosen], at.half_length[chosen])


def _moment(shape: Shape, grid: Grid) -> Array:
    """sum N x_i (k, 2) in cells."""
    moment: Array = np.einsum("kn,kna->ka", shape.N, shape.node.astype(float))
    return moment


def gradient_sum(code: HasShape) -> Observed:
    at = sample()
    return worst(np.abs(asked(code, at).grad_N.sum(axis=1)), at)


def completeness(code: HasShape, h: tuple[float, float]) -> Observed:
    """|sum N x_i - x| in cells and |sum grad N x_i - 1|."""
    at = sample(h=h)
    shape = asked(code, at)
    x = shape.node * at.grid.h
    values = np.abs(_moment(shape, at.grid) - at.grid.cell_coordinates(at.x))
    slopes = np.abs(np.einsum("kna,knb->kab", x, shape.grad_N) - np.eye(2)).reshape(-1, 4)
    return worst(np.concatenate([values, slopes], axis=1), at)


def derivative(code: HasShape) -> Observed:
    """|grad N - dN/dx| by central differences; where it fails, the ratio of the two names the fault."""
    at = sample()
    given = dense(asked(code, at))[..., 1:]
    steps = STEP * np.eye(2)
    quotient = np.stack(
        [
            (dense(asked(code, at, at.x + s))[..., 0] - dense(asked(code, at, at.x - s))[..., 0]) / (2 * STEP)
            for s in steps
        ],
        axis=-1,
    )
    error = np.abs(given - quotient)
    p, node, a = np.unravel_index(int(np.argmax(error)), error.shape)
    if error[p, node, a] <= 1e-8:
        return Observed(float(error[p, node, a]))
    wrong = error > 1e-8
    ratio = given[wrong & (np.abs(quotient) > 0.05)] / quotient[wrong & (np.abs(quotient) > 0.05)]
    i, j = divmod(int(node), CELLS + 1)
    side = np.array([i, j])[a] - at.grid.cell_coordinates(at.x)[p, a]
    where = (
        f"d/d{'xy'[a]} of node ({i}, {j}), {side:+.3g} cells away along {'xy'[a]}, at {_place(at, int(p))} cells; "
        f"{wrong.mean(axis=(0, 1))[0]:.1%} of the derivatives along x and {wrong.mean(axis=(0, 1))[1]:.1%} along y fail"
    )
    return Observed(float(error[p, node, a]), where, _named(ratio))


def _named(ratio: Array) -> str:
    """The kind of fault that ratios of given to right gradients, all of failing ones, are the mark of."""
    if len(ratio) == 0:
        return ""
    middle = float(np.median(ratio))
    if np.all(np.abs(ratio - middle) > 0.05):
        return ""
    if abs(middle + 1) < 0.01:
        return "wrong sign in a gradient"
    return f"a gradient {abs(middle - 1):.0%} {'off' if middle > 0 else 'and of the wrong sign'}"


ORIGINS = {
    "elevated": (0.0, 50.0),
    "to the right": (50.0, 0.0),
    "negative": (-37.0, -11.0),
    "irrational": (np.pi, -np.e),
    "1e6 cells away": (1e6, -1e6),
}


def origin(code: HasShape, name: str) -> Observed:
    """Difference from the same points on a grid from (0, 0)."""
    axes = [axis for axis, moved in zip("xy", ORIGINS[name], strict=True) if moved != 0]
    left_out = f"origin of the grid left out along {axes[0]}" if len(axes) == 1 else ""
    here, there = dense(asked(code, sample())), sample(ORIGINS[name])
    try:
        error = np.abs(dense(asked(code, there)) - here)
    except Misanswered as nothing:  # what is right at (0, 0) names other nodes here, or none
        return Observed(np.inf, str(nothing), left_out)
    found = worst(error, there)
    return found._replace(kind=left_out if found.value > 0.1 else "")  # of functions near one: at another place


def _on_lines(axis: int, offset: float = 0.0) -> Sample:
    """Points on, or `offset` cells beside, grid lines across one axis; along the other one as in `sample`."""
    at = sample(count=60)
    x = at.x.copy()
    x[:, axis] = np.rint(x[:, axis]) + offset
    return Sample(at.grid, x, at.half_length)


def side_of(code: HasShape, axis: int) -> str:
    """Which side's gradients points on a grid line have: "left" (below), "right" (above), "both", or "neither"."""
    here, left, right = (dense(asked(code, _on_lines(axis, offset))) for offset in (0.0, -1e-7, 1e-7))
    same = {side: float(np.abs(here - there).max()) < 1e-4 for side, there in (("left", left), ("right", right))}
    if all(same.values()):
        return "both"
    return next((side for side, alike in same.items() if alike), "neither")


def convention(code: HasShape) -> Observed:
    """0 if points on lines belong to one side, the same along both axes; 1 if not."""
    sides = {axis: side_of(code, a) for a, axis in enumerate("xy")}
    words = "; ".join(f"across {axis}: {side}" for axis, side in sides.items())
    if "neither" in sides.values():
        return Observed(1.0, f"{words}: weights on a line are those of neither side", REVERSED)
    alike = sides["x"] == sides["y"]
    return Observed(0.0 if alike else 1.0, words, "" if alike else f"{REVERSED} (along one axis)")


def near_lines(code: HasShape) -> Observed:
    """Unity and gradient sum on grid lines, on crossings of them and 1e-12 beside."""
    found = {name: _sums(asked(code, at)) for name, at in _near_lines().items()}
    name = max(found, key=lambda name: sum(found[name]))
    values, gradients = found[name]
    on_them = all(sum(sums) <= 20 * ROUNDING for other, sums in found.items() if not other.startswith("on"))
    one_sided = on_them and values <= ROUNDING < gradients
    return Observed(max(values, gradients), f"points {name}", REVERSED if one_sided else "")


def _sums(shape: Shape) -> tuple[float, float]:
    """Largest |sum N - 1| and |sum grad N|."""
    return float(np.abs(shape.N.sum(axis=1) - 1).max()), float(np.abs(shape.grad_N.sum(axis=1)).max())


def _near_lines() -> dict[str, Sample]:
    samples = {}
    for name, offset in (("on", 0.0), ("1e-12 before", -1e-12), ("1e-12 behind", 1e-12)):
        x_lines, y_lines = _on_lines(0, offset), _on_lines(1, offset)
        samples[f"{name} lines across x"], samples[f"{name} lines across y"] = x_lines, y_lines
        samples[f"{name} nodes"] = Sample(x_lines.grid, np.rint(x_lines.x) + offset, x_lines.half_length)
    return samples


def symmetry(code: HasShape, turn: Callable[[Array], Array]) -> Observed:
    """Difference of functions at turned points from the turned functions; `turn` acts on places about the middle."""
    at = sample()
    middle = CELLS / 2
    x, half = turn(at.x - middle) + middle, np.abs(turn(at.half_length))
    turned = dense(asked(code, Sample(at.grid, x, half)))
    nodes = at.grid.node_positions()
    image = np.rint(turn(nodes - middle) + middle).astype(int) @ [CELLS + 1, 1]
    here = dense(asked(code, at))
    expected = np.zeros_like(turned)
    expected[:, image, 0] = here[..., 0]
    expected[:, image, 1:] = turn(here[..., 1:].reshape(-1, 2)).reshape(here[..., 1:].shape)
    return worst(np.abs(turned - expected), at)


def mirrored(x: Array) -> Array:
    return x * [-1.0, 1.0]


def turned(x: Array) -> Array:
    """By a quarter."""
    return np.stack([-x[:, 1], x[:, 0]], axis=1)


def one_by_one(code: HasShape) -> Observed:
    """Difference between points asked together, in another order, and alone."""
    at = sample()
    together = dense(asked(code, at))
    order = np.random.default_rng(1).permutation(len(at.x))
    shuffled = dense(asked(code, Sample(at.grid, at.x[order], at.half_length[order])))
    error = np.zeros(len(at.x))
    error[order] = np.abs(shuffled - together[order]).max(axis=(1, 2))
    for p in range(5):
        alone = dense(asked(code, _part(at, np.arange(len(at.x)) == p)))
        error[p] = max(error[p], float(np.abs(alone[0] - together[p]).max()))
    return worst(error, at)


def jump(code: HasShape, what: slice) -> Observed:
    """Largest change over a move of 2e-9 cells across a grid line."""
    moves = [np.abs(dense(asked(code, _on_lines(a, 1e-9))) - dense(asked(code, _on_lines(a, -1e-9)))) for a in (0, 1)]
    return Observed(max(float(move[..., what].max()) for move in moves))

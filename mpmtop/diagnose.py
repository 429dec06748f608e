"""What is right for the equations and misleading for the body: warned of before the number is used.

The discrete model is not the body where its functions glue a gap (`GluedGap`), where nothing but a hair of material or
a motion that the points do not see answers the load (`NearMechanism`), where cells at its edge count more or fewer
points than it fills of them (`UnevenCells`), or where it depends on which way round the body lies
(`PointsOnGridLines`). Each is a warning class of its own, to be turned off or into an error by that class.
"""

from collections.abc import Sequence

import numpy as np

from mpmtop.arrays import Array, Mask
from mpmtop.body import Support
from mpmtop.gaps import Gap, glued_gaps
from mpmtop.grid import Grid
from mpmtop.points import GAUSS_2, MaterialPoints
from mpmtop.region import Region
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from mpmtop.transfer import Transfer, located

MISLEADS = 0.04
"""Relative error of the compliance from which a clamp off the body is warned of: twice what the grids of the studies
leave anyway (two per cent at 20 cells over the depth of a cantilever)."""
BENDING = 3.0
"""By this the compliance of a beam's first slice at the clamp exceeds the mean: its moment is the largest, and the
energy goes with the square of a moment that falls to zero linearly. Under tension it is one."""
UNSEEN = 2.0
"""Energy that the points do not see, in parts of what they do see. One or two cells over the depth of a beam, too few
to bend it, leave up to 1.3 with any function; what moves next to freely leaves 3 and up to 1e5."""
UNEVEN = 0.0065
"""Estimated error of the extension of a bar from which uneven cells are warned of: the estimate is 0.65 to 1 times what
a bar of eight cells with 2 x 2 to 6 x 6 points finds, of which 1 % is too much."""
NORM = np.array([1, 1, 0.5])
"""|eps|^2 = NORM . eps^2 of engineering shear."""
AT_ONCE = 16_384
"""Points taken at a time, so that what is computed of them stays in the processor's cache."""
SHOWN = 3
"""Gaps that a warning describes; the others are counted."""


class ModelWarning(UserWarning):
    """The discrete model misleads about the body."""


class GluedGap(ModelWarning):
    """Nodes tie points together that the body does not connect: a slit, or two bodies, nearer than functions reach."""


class NearMechanism(ModelWarning):
    """Supports or points leave a motion next to no resistance."""


class PointsOnGridLines(ModelWarning):
    """Points lie where gradients jump: the mirror image of the body is another model."""


class UnevenCells(ModelWarning):
    """Cells at the body's edge count more or fewer points than the body fills of them."""


def gap_warning(gaps: Sequence[Gap], shape_function: ShapeFunction) -> GluedGap | None:
    """The warning of `gaps`, if there are any."""
    if not gaps:
        return None
    each = "; ".join(
        f"{gap.nodes} nodes from ({gap.lower[0]:g}, {gap.lower[1]:g}) to ({gap.upper[0]:g}, {gap.upper[1]:g}), "
        + (f"gap {gap.width:.3g} wide" if gap.width > 0 else "gap narrower than the points show")
        + f" at ({gap.place[0]:g}, {gap.place[1]:g})"
        for gap in gaps[:SHOWN]
    )
    more = f"; and {len(gaps) - SHOWN} more" if len(gaps) > SHOWN else ""
    return GluedGap(
        f"glued where the body is not connected ({shape_function.__name__}): {each}{more}. Points on both sides share "
        "nodes and move together: refine until the gap is as wide as the functions reach (two cells with tent, more "
        "with others, or lines of the grid on both edges), or close it"
    )


def loose_support(grid: Grid, points: MaterialPoints, transfer: Transfer, support: Support, f_ext: Array) -> str | None:
    """What is wrong with a support that lies off the body, else None.

    Held nodes beyond the body's edge hold it through a part of a cell. At the edge the tents of the held nodes sum to
    s <= 1, for a straight edge the part of their cell that is filled; the cell is then soft by 1/s and shorter by s,
    as if the body were longer by h (1/s - s). Of a length L to the load the compliance grows by that over L under
    tension, and up to BENDING times as much. s is the mean over the nodes that the support holds.
    """
    position = grid.node_positions(transfer.nodes)
    inside = support.region.contains(position, 1e-9 * min(grid.h))
    if not np.any(inside) or not np.any(f_ext):
        return None  # refused by name elsewhere
    force = f_ext.reshape(-1, 2) / np.abs(f_ext).max()  # squares stay in range
    size = np.hypot(*force.T)
    clamp = position[inside]
    s = float(_hold(grid, points, transfer, support.region, inside).mean())
    h = grid.h[int(np.argmin(np.ptp(clamp, axis=0) / grid.h))]  # across the line of held nodes
    longer = h * (1 / s - s) if s > 0 else np.inf
    length = max(float(np.hypot(*(size @ position / size.sum() - clamp.mean(axis=0)))), h)
    arm = position - clamp.mean(axis=0)
    moment = float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))
    width, pull = float(np.ptp(clamp, axis=0).max()), float(np.linalg.norm(force.sum(axis=0)))
    # energies of a slice of the beam: F^2 / W of the force and 12 M^2 / W^3 of the moment
    turning, pulling = 12 * moment**2, (width * pull) ** 2
    bending = turning / (turning + pulling) if width > 0 and turning > 0 else 0.0
    error = (1 + (BENDING - 1) * bending) * longer / length
    if error <= MISLEADS:
        return None
    (x0, y0), (x1, y1) = clamp.min(axis=0), clamp.max(axis=0)
    return (
        f"the support's {len(clamp)} nodes from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) lie off the body's edge and hold "
        f"it by {s:.2g} on average (1 at the edge), as if it were {longer:.2g} longer: compliance too large by about "
        f"{100 * error:.2g} %. Lay a line of the grid on the held edge (`grid`), let the body reach on behind its "
        "clamp, or refine"
    )


def _hold(grid: Grid, points: MaterialPoints, transfer: Transfer, region: Region, inside: Mask) -> Array:
    """How far each of the nodes `inside` (a,) the region holds the material beside it, (n,) up to 1.

    Of nodes on one line of the grid: the largest sum of their tents at a corner of a domain beside. Of others, as
    behind an oblique line, the sum S of their functions at a point, and on to the edge of its domain by |l grad S|:
    domains are not turned with the points, and their corners stick out.
    """
    point, k = np.nonzero(transfer.touched & inside[transfer.stencil])
    beside, entry = np.unique(point, return_inverse=True)
    h = np.asarray(grid.h)
    if np.ptp(grid.node_positions(transfer.nodes[inside]), axis=0).min() < h.min() / 2:
        corners = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])[:, None]
        xi = grid.cell_coordinates(points.x[beside] + corners * points.half_length[beside])  # (4, n, 2)
        cell = np.floor(xi)
        s, t = np.moveaxis(xi - cell, -1, 0)
        nodes = ((0, 0), (0, 1), (1, 0), (1, 1))
        at = (cell + np.array(nodes)[:, None, None]) * h + grid.origin
        fixed = region.contains(at.reshape(-1, 2), 1e-9 * h.min()).reshape(4, *s.shape)
        value = sum(np.abs(1 - i - s) * np.abs(1 - j - t) * of for (i, j), of in zip(nodes, fixed, strict=True))
        held = np.max(value, axis=0)
    else:
        of_support = inside[transfer.stencil[beside]] & transfer.touched[beside]
        gradient = np.einsum("pn,pnk->pk", of_support, transfer.grad_N[beside])
        held = (of_support * transfer.N[beside]).sum(axis=1) + np.hypot(*(points.half_length[beside] * gradient).T)
    largest = np.zeros(len(inside))
    np.maximum.at(largest, transfer.stencil[point, k], held[entry])
    return np.minimum(largest[inside], 1)


def support_warning(
    grid: Grid, points: MaterialPoints, transfer: Transfer, supports: Sequence[Support], f_ext: Array
) -> NearMechanism | None:
    """The warning of all supports that lie off the body, if any does."""
    found = [loose_support(grid, points, transfer, support, f_ext) for support in supports]
    text = "; ".join(line for line in found if line)
    return NearMechanism(text) if text else None


def line_warning(grid: Grid, points: MaterialPoints, shape_function: ShapeFunction) -> PointsOnGridLines | None:
    """The warning of points on lines of the grid, which count to the cell on the right.

    Tents have a gradient that jumps there. B-splines end with the outermost cells that hold a point, so that for them
    it is the body's outermost points that matter. GIMP's gradient is a mean over the domain.
    """
    if shape_function is gimp:
        return None
    xi, _, tol = located(grid, points.x)
    on = np.abs(xi - np.rint(xi)) <= tol
    if shape_function is not tent:
        on &= (xi <= xi.min(axis=0) + tol) | (xi >= xi.max(axis=0) - tol)
    on_line = np.any(on, axis=1)
    if not np.any(on_line):
        return None
    x, y = points.x[on_line][0]
    return PointsOnGridLines(
        f"{np.count_nonzero(on_line)} points lie on lines of the grid, the first at ({x:g}, {y:g}), and count to the "
        f"cell on the right, or above ({shape_function.__name__}): the body's mirror image is another model, by "
        "several per cent. Move the grid (`grid`) or the points by a part of a cell, or use GIMP"
    )


def uneven_warning(
    grid: Grid, points: MaterialPoints, shape_function: ShapeFunction, domain: Region | None
) -> UnevenCells | None:
    """The warning of tents on points seeded in `domain` whose rectangles reach over lines of the grid.

    A tent counts a point wholly to one cell. Of a bar along an axis, in whose column c of cells there are points of
    volume V_c where the body fills F_c, c is longer than it should be by F_c / V_c, which with the cross-section gives
    (extension - exact) / exact = sum_c F_c (F_c / V_c - 1) / sum_c F_c; an end without a point goes with the column
    beside it, whose functions it takes.
    """
    if shape_function is not tent or domain is None:
        return None
    errors = [_uneven(grid, points, axis) for axis in (0, 1)]
    worst = int(np.argmax(np.abs(errors)))
    if abs(errors[worst]) <= UNEVEN:
        return None
    return UnevenCells(
        "tents count a point wholly to the cell of its middle, and lines of the grid cut the points' rectangles: a "
        f"bar along {'xy'[worst]} would be off by about {100 * errors[worst]:+.2g} %. Use points cut along the outline "
        "(`cut=True`), GIMP, or more points per cell"
    )


def _uneven(grid: Grid, points: MaterialPoints, axis: int) -> float:
    """Relative error of the extension of a bar along an axis."""
    xi, cell, tol = located(grid, points.x)
    half = points.half_length[:, axis] / grid.h[axis]
    start = xi[:, axis] - half
    first = np.floor(start + tol).astype(np.intp)
    share = np.clip((first + 1 - start) / (2 * half), 0, 1)
    columns = grid.cells[axis] + 2
    filled = np.bincount(first + 1, points.volume * share, columns)
    filled += np.bincount(first + 2, points.volume * (1 - share), columns)[:columns]
    counted = np.bincount(cell[:, axis] + 1, points.volume, columns)
    held = np.flatnonzero(counted)
    filled[held[0]] += filled[: held[0]].sum()
    filled[held[-1]] += filled[held[-1] + 1 :].sum()
    F, V = filled[held], counted[held]
    return float(np.sum(F * (F / V - 1)) / F.sum())


def findings(
    grid: Grid,
    points: MaterialPoints,
    transfer: Transfer,
    shape_function: ShapeFunction,
    supports: Sequence[Support],
    f_ext: Array,
    domain: Region | None,
    cut: bool = False,
) -> tuple[ModelWarning, ...]:
    """All that can be said before a solve; `domain` if the points were seeded in it, and whether they were cut."""
    found = (
        gap_warning(glued_gaps(grid, points, transfer, domain), shape_function),
        support_warning(grid, points, transfer, supports, f_ext),
        None if cut else uneven_warning(grid, points, shape_function, domain),
        line_warning(grid, points, shape_function),
    )
    return tuple(warning for warning in found if warning is not None)


def energy_warning(
    grid: Grid, points: MaterialPoints, transfer: Transfer, u: Array, strain: Array, moduli: Array
) -> NearMechanism | None:
    """The warning that displacements u (2a,) strain the body far more between the points than their `strain` (p, 3).

    Where points are few, or sit in unlucky places, they do not see motions of the nodes that alternate from one to the
    next. E |eps|^2 is integrated once more, by four Gauss points in each domain and tents through the nodes: the energy
    at lambda = 0, as with B-bar the points mean to see no more of the dilatation than its average. Domains that reach
    into cells without all of their nodes are left out of both sums.
    """
    largest = np.abs(strain).max()
    if largest == 0:
        return None
    strain, u = strain / largest, u / largest  # squares stay in range
    between, whole = _energy_between(grid, points, transfer, u)
    density = points.volume * moduli
    at_points = density * (strain**2 @ NORM)
    between = density * between
    seen = float(at_points[whole].sum())
    ratio = float(between[whole].sum()) / seen if seen > 0 else 1.0
    if ratio <= 1 + UNSEEN:
        return None
    x, y = points.x[np.argmax(np.where(whole, between - at_points, -np.inf))]
    return NearMechanism(
        f"the displacements have {ratio:.3g} times the strain energy that the points see, most of the rest near "
        f"({x:g}, {y:g}): nodes move from one to the next in a way that next to nothing resists. Use more points, at "
        "least two per cell and direction where they lie now, domains that are well below a cell with GIMP, or lay the "
        "grid's lines along the body"
    )


def _energy_between(grid: Grid, points: MaterialPoints, transfer: Transfer, u: Array) -> tuple[Array, Mask]:
    """|eps|^2 (p,) of the tents through nodal values u (2a,), mean of four Gauss points in each domain, and whether
    all of their cells have all nodes (p,)."""
    total = int(np.prod(grid.nodes))
    nodal = np.zeros((total, 2))
    nodal[transfer.nodes] = u.reshape(-1, 2)
    active = np.zeros(total, dtype=bool)
    active[transfer.nodes] = True
    nx, ny = grid.cells
    sides = np.multiply(((-1, -1), (-1, 1), (1, -1), (1, 1)), GAUSS_2)[:, None]
    energy, whole = np.empty(len(points.x)), np.empty(len(points.x), dtype=bool)
    for first in range(0, len(points.x), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        xi = grid.cell_coordinates(points.x[part] + sides * points.half_length[part])  # (4, p, 2)
        cell = np.clip(np.floor(xi).astype(np.intp), 0, (nx - 1, ny - 1))
        s, t = np.moveaxis(xi - cell, -1, 0)[..., None]
        corner = grid.node_index(*np.moveaxis(cell, -1, 0))[..., None] + [0, 1, grid.nodes[1], grid.nodes[1] + 1]
        u00, u01, u10, u11 = np.moveaxis(nodal[corner], 2, 0)
        by_x = ((1 - t) * (u10 - u00) + t * (u11 - u01)) / grid.h[0]
        by_y = ((1 - s) * (u01 - u00) + s * (u11 - u10)) / grid.h[1]
        eps = np.stack([by_x[..., 0], by_y[..., 1], by_x[..., 1] + by_y[..., 0]], axis=-1)
        energy[part], whole[part] = (eps**2 @ NORM).mean(axis=0), active[corner].all(axis=(0, 2))
    return energy, whole

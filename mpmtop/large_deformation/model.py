"""A body discretised for load steps.

State of a point: position x, deformation gradient F and half-lengths l of its domain. In step n, from x, F, l at its
start, the nodal increments u of the reset grid solve

    R_i = sum_p V0_p P(F_p) g_pi - t_n sum_p N_i(x_p, l_p) f_p + alpha E0 (K u)_i = 0,
    F_p = F_p^old + sum_i u_i x g_pi,      g_pi = (F_p^old)^T grad N_i(x_p, l_p),

with the weights of the step's start throughout, so that R is the gradient of an energy, its tangent is symmetric, and
Newton meets no crossing of a cell. Then x += sum_i N_i u_i, and with stretched domains l = l0 U_ii. That is the updated
Lagrangian scheme; in the total one, where nothing crosses, g_pi = grad N_i(X_p, l0_p) and N_i(X_p, l0_p) in all steps.
f_p are dead loads, t_n = n / steps. The last term is a soft background, see `background`.

Sources: Charlton, Coombs and Augarde (2017), Computers & Structures 190:108; Coombs and Augarde (2020), Adv. Engng
Software 146:102828 (AMPLE).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index, Mask
from mpmtop.body import Body, check_load_steps
from mpmtop.errors import InvalidScene, LoadOutsideBody, UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.large_deformation.assembly import Assembly, Stencils, assembly
from mpmtop.large_deformation.background import Background, background
from mpmtop.large_deformation.kinematics import Domains
from mpmtop.large_deformation.law import Hencky, Law
from mpmtop.loads import action
from mpmtop.model import points_and_cell
from mpmtop.points import MaterialPoints
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent

Frame = Literal["updated", "total"]
REMEMBERED = 64 * 2**20
"""Memory [bytes] of assemblies that a model keeps: eight steps of 3,200 points need about half. Beyond it the
factorisation, which grows faster than the number of points, leaves little to gain."""


@dataclass(frozen=True, eq=False)
class Model:
    """All that stays the same while densities change. `force` (p, 2) are the points' dead loads at full load, those of
    the `body`.

    Degree of freedom 2 node + component of the box is `sign` times `unknown`, or held where that is -1, each
    (2 nodes,).
    """

    body: Body
    grid: Grid
    points: MaterialPoints
    shape_function: ShapeFunction
    frame: Frame
    domains: Domains
    law: Law
    young: float
    steps: int
    alpha: float
    force: Array
    unknown: Index
    sign: Array
    background: Background | None

    @cached_property
    def levels(self) -> Array:
        """Load levels t_n (steps,), the last one 1."""
        return np.arange(1, self.steps + 1) / self.steps

    @cached_property
    def unknowns(self) -> int:
        """Number of unknowns of the box."""
        return int(self.unknown.max()) + 1

    def assembly(self, used: Stencils, touched: Mask) -> Assembly:
        """Assembly of a step in which the points have these stencils and touch these nodes (nodes,) of the box.

        Those of the last steps are kept for the adjoint, as far as they are small.
        """
        key = used.first.tobytes() + touched.tobytes()
        if key not in self._recent:
            self._recent[key] = self._assembly(used, touched)
            while len(self._recent) > 1 and sum(a.nbytes for a in self._recent.values()) > REMEMBERED:
                del self._recent[next(iter(self._recent))]
        return self._recent[key]

    @cached_property
    def _recent(self) -> dict[bytes, Assembly]:
        return {}

    def _assembly(self, used: Stencils, touched: Mask) -> Assembly:
        mine = self.unknown[np.repeat(touched, 2)]
        active = np.zeros(self.unknowns, bool)
        active[mine[mine >= 0]] = True
        if not np.any(active):
            raise UnsupportedBody(
                "every node that the points touch is held: let the supports hold a part of the body only"
            )
        place = np.append(np.where(active, np.cumsum(active) - 1, -1), -1)
        m = np.count_nonzero(active)
        soft = sp.csr_array((m, m)) if self.background is None else self.background.condensed(active)
        width = 2 if self.shape_function is tent else 3
        return assembly(self.grid, used, width, place[self.unknown], self.sign, soft)


def discretise(
    body: Body,
    h: float | tuple[float, float] | None = None,
    ppc: int | tuple[int, int] | None = None,
    shape_function: ShapeFunction = gimp,
    *,
    steps: int = 8,
    frame: Frame = "updated",
    domains: Domains = "fixed",
    law: Law | None = None,
    alpha: float = 1e-5,
    points: MaterialPoints | None = None,
    grid: Grid | None = None,
) -> Model:
    """Discretise `body` by cells of size h with ppc points per cell and direction, 2 unless given, for `steps` equal
    load steps.

    `frame` is "updated" or "total"; `domains` of GIMP stay "fixed" or are "stretched" with the points; `law` is
    Hencky's with the material's Poisson's ratio unless given; `alpha` is the part of E0 that the background has, 0 for
    none: void alone then holds what hangs on it, with the digits that are left of its modulus. `grid` is the box that
    the body must not leave, and replaces h; unless given it is the body's and half its longer side all around. `points`
    replaces the seeded points and ppc. The number of steps is part of the discretisation: 8 and 16 are two problems. A
    support that is a line of nodes on the domain's edge holds those behind it, too; a single node is a pin.

    Raises InvalidScene for what is not available in large deformation: plane stress, loads that no point carries, other
    shape functions than tent, gimp and bspline2; and for an argument that another one leaves without effect.
    EmptyDomain, LoadOutsideBody, UnsupportedBody as in small strain.
    """
    _refuse(body, shape_function, steps, frame, domains, alpha, law)
    points, (hx, hy) = points_and_cell(body.domain, h, ppc, points, grid)
    lower, upper = body.domain.bounds
    if grid is None:
        grid = Grid.around(lower, upper, (hx, hy), margin=1 + int(np.ceil(np.max(upper - lower) / 2 / min(hx, hy))))
    unknown, sign = _unknowns(body, grid, shape_function)
    force = _forces(body, grid, points)
    young = float(body.material.young)
    soft = background(grid, unknown, sign, alpha * young) if alpha > 0 else None
    law = Hencky(body.material.poisson) if law is None else law
    return Model(
        body, grid, points, shape_function, frame, domains, law, young, steps, alpha, force, unknown, sign, soft
    )


def in_case(model: Model, body: Body) -> Model:
    """The model under the loads and supports of `body`, its own body's in another load case. Raises as `discretise`."""
    loaded = replace(model, body=body, force=_forces(body, model.grid, model.points))
    if body.supports == model.body.supports:
        return loaded
    unknown, sign = _unknowns(body, model.grid, model.shape_function)
    soft = background(model.grid, unknown, sign, model.alpha * model.young) if model.alpha > 0 else None
    return replace(loaded, unknown=unknown, sign=sign, background=soft)


def _refuse(
    body: Body, shape_function: ShapeFunction, steps: int, frame: str, domains: str, alpha: float, law: Law | None
) -> None:
    if shape_function not in (tent, gimp, bspline2):
        raise InvalidScene(
            f"large deformation with {getattr(shape_function, '__name__', shape_function)}: use tent, gimp or bspline2"
        )
    if body.material.plane != "strain":
        raise InvalidScene("large deformation in plane stress: the laws are those of plane strain, set plane='strain'")
    if not isinstance(steps, int | np.integer) or steps < 1:
        raise InvalidScene(f"{steps} load steps: give at least one, a whole number")
    if frame not in ("updated", "total"):
        raise InvalidScene(f"frame {frame!r}: say 'updated' or 'total'")
    if domains not in ("fixed", "stretched"):
        raise InvalidScene(f"domains {domains!r}: say 'fixed' or 'stretched'")
    if domains == "stretched" and (frame == "total" or shape_function is not gimp):
        raise InvalidScene(
            "stretched domains: only GIMP in the updated frame has domains that move, use domains='fixed'"
        )
    if not 0 <= alpha < 1:
        raise InvalidScene(f"background alpha {alpha}: give a number from 0 to below 1, such as 1e-5")
    if law is not None and law.poisson != body.material.poisson:
        raise InvalidScene(
            f"law with Poisson's ratio {law.poisson} for a material of {body.material.poisson}: give both the same"
        )


def _forces(body: Body, grid: Grid, points: MaterialPoints) -> Array:
    """Dead loads (p, 2) of the points; zero where a body has none, as load cases bring their own."""
    check_load_steps(body, points.x, points.volume, 1e-9 * min(grid.h))
    acts = action(body.loads, points.x, points.volume, 1e-9 * min(grid.h))
    if len(acts.position):
        raise InvalidScene(
            f"a load at {tuple(acts.position[0].tolist())} in large deformation: only points carry loads with them; "
            "give it points to act on, by `PointLoad` or `RegionLoad`"
        )
    force = np.zeros_like(points.x)
    np.add.at(force, acts.points, acts.carried)
    if body.loads and not np.any(force):
        raise LoadOutsideBody("the loads are zero: give a force")
    return force


def _unknowns(body: Body, grid: Grid, shape_function: ShapeFunction) -> tuple[Index, Array]:
    """Unknown and sign of every degree of freedom of the box, see `Model`.

    A clamp stated as a line of nodes on the domain's edge holds those behind it, too, see `_behind`. A B-spline is not
    zero where one line of nodes is: its supports hold all nodes beyond the domain's box whose nearest position of the
    box is held, and the first of them mirror those inside, u_-1 = -u_1. That is `bspline2` with its end closed,
    u_-1 = 2 u_0 - u_1, and free of the body's place.
    """
    position, tol = grid.node_positions(), 1e-9 * min(grid.h)
    spline = shape_function is bspline2
    lower, upper = body.domain.bounds
    nearest = np.clip(position, lower, upper) if spline else position
    held = np.zeros((len(position), 2), dtype=bool)
    for support in body.held:
        inside = support.region.contains(position, tol) | support.region.contains(nearest, tol)
        if not np.any(inside):
            at = support.region.bounds
            raise UnsupportedBody(
                f"the support from {at[0]} to {at[1]} holds no node of the box: move it onto the body"
            )
        held |= inside[:, None] & np.array(support.fixed)
    if not spline:
        held |= _behind(held.reshape(*grid.nodes, 2), grid, (lower, upper), tol).reshape(-1, 2)
    free = np.flatnonzero(~held.ravel())
    unknown, sign = np.full(held.size, -1), np.ones(held.size)
    unknown[free] = np.arange(len(free))
    if spline:
        beyond = np.any((position < lower - tol) | (position > upper + tol), axis=1)
        of, as_ = _mirrored(held.reshape(*grid.nodes, 2), beyond.reshape(grid.nodes))
        unknown[of], sign[of] = unknown[as_], -1
    return unknown, sign


def _behind(held: Mask, grid: Grid, box: tuple[Array, Array], tol: float) -> Mask:
    """Nodes (nx, ny, 2) behind two or more neighbours `held` on a face of the domain's `box`.

    No material is there at the start; where the body presses on its clamp, domains reach over it, and nodes free there
    would let the clamp yield: the prototype's cantilever by a tenth of its deflection. Behind a single node they stay
    free, and the body may turn about it.
    """
    found = np.zeros_like(held)
    for axis in (0, 1):
        lines, (H, found_here) = grid.lines[axis], (a.swapaxes(0, axis) for a in (held, found))
        for face, side in zip((box[0][axis], box[1][axis]), (-1, 1), strict=True):
            beyond = side * (lines - face) > tol
            for row in H[np.abs(lines - face) <= tol]:
                pair, line = row[1:] & row[:-1], np.zeros_like(row)
                line[1:] |= pair
                line[:-1] |= pair
                found_here[beyond] |= line
    return found


def _mirrored(held: Mask, beyond: Mask) -> tuple[Index, Index]:
    """Degrees of freedom of nodes `beyond` the domain that are held, with the next node held and the one after it free
    along some axis; and that free one."""
    dof = np.arange(held.size).reshape(held.shape)
    found: dict[int, int] = {}
    for axis in (0, 1):
        for back in (False, True):
            H, B, d = ((np.flip(a, axis) if back else a).swapaxes(0, axis) for a in (held, beyond, dof))
            some = H[:-2] & H[1:-1] & ~H[2:] & B[:-2, :, None]
            found = dict(zip(d[:-2][some].tolist(), d[2:][some].tolist(), strict=True)) | found
    return np.array(list(found.keys()), np.intp), np.array(list(found.values()), np.intp)

"""What a solver says at its cells and nodes, in one form for pictures and files: of material points or of elements.

A cell is the rectangle that a material point stands for, or an element. Each solver registers its model with `layout`
and `fields`. Tensors are (xx, yy, xy, zz) on the last axis; shear strain is the tensor's, half the engineering one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np

from mpmtop.arrays import Array, Mask


@dataclass(frozen=True, eq=False)
class Layout:
    """Where c cells and n nodes lie, and what acts there.

    x, half_length  (c, 2) centres and half of their sides along the axes [length]
    volume          (c,) [length^2]
    corners         (c, 4, 2) counterclockwise or clockwise
    lines           (m, 2, 2) ends of the lines between cells of the grid, or between elements
    nodes           (n, 2) positions of the nodes that have degrees of freedom
    held            (n, 2) which of their components the supports hold
    load            (n, 2) external force on them
    """

    x: Array
    half_length: Array
    volume: Array
    corners: Array
    lines: Array
    nodes: Array
    held: Mask
    load: Array


@dataclass(frozen=True, eq=False)
class Fields:
    """An analysed design: at c cells, at their corners (c, 4), and at n nodes.

    `young` (c,) is the modulus E(rho) of what the cell is made of, penalised by its density.
    `reaction` (n, 2) is what the supports exert, zero at free components: f_int - f_ext where held, a ghost penalty's
    part of f_int included. Its sum is minus that of the loads. `nodal_displacement` (n, 2) is None where nodes keep
    none, those of a grid that is reset in every load step.
    """

    layout: Layout
    density: Array
    young: Array
    displacement: Array
    corner_displacement: Array
    strain: Array
    stress: Array
    nodal_displacement: Array | None
    reaction: Array


@singledispatch
def layout(model: Any) -> Layout:
    """The layout of a model of either solver. TypeError for anything else."""
    raise TypeError(f"{type(model).__name__} is no model of mpmtop or reference_fem: give problem.model")


@singledispatch
def fields(model: Any, state: Any, rho: Array) -> Fields:
    """The fields of a model of either solver in a `state`, with densities rho (c,). TypeError for anything else."""
    raise TypeError(f"{type(model).__name__} is no model of mpmtop or reference_fem: give problem.model")


def von_mises(stress: Array) -> Array:
    """sqrt(3/2 s:s) (c,) of the deviator s of stresses (c, 4), sigma_zz included."""
    xx, yy, xy, zz = np.moveaxis(stress, -1, 0)
    return np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)


def von_mises_in_plane(stress: Array) -> Array:
    """sqrt(xx^2 - xx yy + yy^2 + 3 xy^2) (c,), without sigma_zz: equal to `von_mises` in plane stress only."""
    xx, yy, xy, _ = np.moveaxis(stress, -1, 0)
    return np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)


SCALARS: dict[str, tuple[str, Callable[[Fields], Array]]] = {
    "density": ("density", lambda f: f.density),
    "young": (r"Young's modulus $E(\rho)$", lambda f: f.young),
    "displacement": ("displacement |u|", lambda f: np.hypot(*f.displacement.T)),
    "displacement_x": ("displacement u_x", lambda f: f.displacement[:, 0]),
    "displacement_y": ("displacement u_y", lambda f: f.displacement[:, 1]),
    "stress_xx": (r"stress $\sigma_{xx}$", lambda f: f.stress[:, 0]),
    "stress_yy": (r"stress $\sigma_{yy}$", lambda f: f.stress[:, 1]),
    "stress_xy": (r"stress $\sigma_{xy}$", lambda f: f.stress[:, 2]),
    "stress_zz": (r"stress $\sigma_{zz}$", lambda f: f.stress[:, 3]),
    "von_mises": ("von Mises stress", lambda f: von_mises(f.stress)),
    "von_mises_in_plane": (r"von Mises stress without $\sigma_{zz}$", lambda f: von_mises_in_plane(f.stress)),
    "strain_xx": (r"strain $\varepsilon_{xx}$", lambda f: f.strain[:, 0]),
    "strain_yy": (r"strain $\varepsilon_{yy}$", lambda f: f.strain[:, 1]),
    "strain_xy": (r"strain $\varepsilon_{xy}$", lambda f: f.strain[:, 2]),
}
"""Scalar fields by name: label and values (c,). Stresses are those of the penalised material, E(rho) D eps."""


def scalar(of: Fields, name: str) -> tuple[str, Array]:
    """Label and values (c,) of a field of `SCALARS`. ValueError for another name."""
    if name not in SCALARS:
        raise ValueError(f"field {name!r}: say one of {', '.join(SCALARS)}")
    label, values = SCALARS[name]
    return label, values(of)


def rectangles(x: Array, half_length: Array) -> Array:
    """Corners (c, 4, 2), counterclockwise, of rectangles of half-length (c, 2) or (2,) about x (c, 2)."""
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return x[:, None, :] + np.broadcast_to(half_length, x.shape)[:, None, :] * corners


def tensor(plane: Array, zz: Array) -> Array:
    """(c, 4), (xx, yy, xy, zz), of (c, 3) in the plane and zz (c,)."""
    return np.column_stack([plane, zz])

"""Export to VTU through meshio, for ParaView and its like; the only module that knows meshio."""

import os
from pathlib import Path

import meshio
import numpy as np

from mpmtop.equilibrium import Equilibrium, Model
from mpmtop.scene import Array


def write_points(path: Path, model: Model, state: Equilibrium, rho: Array) -> None:
    """Material points as vertices: density rho (p,), stress (xx, yy, xy), displacement, half-length and volume."""
    points = model.points
    _write(
        path,
        meshio.Mesh(
            _in_space(points.x),
            [("vertex", np.arange(len(points.x))[:, None])],
            point_data={
                "rho": rho,
                "stress": model.stress(state.moduli, state.strain),
                "displacement": _in_space(model.transfer.interpolate(state.u)),
                "half_length": _in_space(points.half_length),
                "volume": points.volume,
            },
        ),
    )


def write_grid(path: Path, model: Model, state: Equilibrium) -> None:
    """The background grid's cells, all of them, with the displacement of the active nodes (zero elsewhere)."""
    grid = model.grid
    ny = grid.nodes[1]
    i, j = (a.ravel() for a in np.meshgrid(*map(np.arange, grid.cells), indexing="ij"))
    corner = i * ny + j
    cells = np.stack([corner, corner + ny, corner + ny + 1, corner + 1], axis=1)
    position = grid.node_positions()
    displacement = np.zeros_like(position)
    displacement[model.transfer.nodes] = state.u.reshape(-1, 2)
    active = np.zeros(len(position))
    active[model.transfer.nodes] = 1
    data = {"displacement": _in_space(displacement), "active": active}
    _write(path, meshio.Mesh(_in_space(position), [("quad", cells)], point_data=data))


def _in_space(plane: Array) -> Array:
    """Vectors (n, 2) as (n, 3): VTK knows no plane."""
    return np.pad(plane, ((0, 0), (0, 1)))


def _write(path: Path, mesh: meshio.Mesh) -> None:
    """Written beside the target and renamed, so that a reader never meets half a file."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    try:
        mesh.write(partial, file_format="vtu")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)

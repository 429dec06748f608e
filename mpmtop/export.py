"""Export to VTU through meshio, for ParaView and its like, and back; the only module that knows meshio."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar
from xml.etree import ElementTree

import meshio
import numpy as np

from mpmtop.arrays import Array
from mpmtop.at_points import fields_at_points as fields_at_points
from mpmtop.equilibrium import Equilibrium
from mpmtop.fields import Fields, fields, von_mises, von_mises_in_plane
from mpmtop.model import Model
from mpmtop.points import MaterialPoints

VTK_ORDER = [0, 1, 3, 2]  # xx, yy, zz, xy of (xx, yy, xy, zz); yz and xz, which follow, are zero in a plane


class PointDesign(NamedTuple):
    """Densities rho (p,) of material points, or of elements as points at their centres."""

    points: MaterialPoints
    rho: Array


class Step(Protocol):
    """What a series takes of an iterate."""

    @property
    def iteration(self) -> int: ...  # noqa: D102

    @property
    def evaluation(self) -> Any: ...  # noqa: D102


Passed = TypeVar("Passed", bound=Step)


def write_points(path: Path | str, model: Any, state: Any, rho: Array) -> None:
    """A design of either solver: each material point as the rectangle it stands for, or each element.

    Of each cell: `density`, `young`, the modulus E(rho), `displacement`, `stress` and `strain` as symmetric tensors
    (xx, yy, zz, xy, yz, xz), the strain with half the engineering shear; `sigma_zz`; `von_mises`, with sigma_zz, and
    `von_mises_in_plane`, without; `position`, `half_length` and `volume`. Stresses are those of the penalised material.
    Corners have a `displacement`, for "warp by vector". Raises ValueError, which names the field, if a number is not
    finite, and writes nothing.
    """
    at = fields(model, state, rho)
    where = at.layout
    count = len(where.x)
    _write(
        Path(path),
        meshio.Mesh(
            _in_space(where.corners.reshape(-1, 2)),
            [("quad", np.arange(4 * count).reshape(count, 4))],
            point_data={"displacement": _in_space(at.corner_displacement.reshape(-1, 2))},
            cell_data={
                name: [values]
                for name, values in {
                    "density": at.density,
                    "young": at.young,
                    "displacement": _in_space(at.displacement),
                    "stress": _symmetric(at.stress),
                    "strain": _symmetric(at.strain),
                    "sigma_zz": at.stress[:, 3],
                    "von_mises": von_mises(at.stress),
                    "von_mises_in_plane": von_mises_in_plane(at.stress),
                    "position": _in_space(where.x),
                    "half_length": _in_space(where.half_length),
                    "volume": where.volume,
                }.items()
            },
        ),
    )


def write_nodes(path: Path | str, model: Any, state: Any, rho: Array) -> None:
    """The nodes of either solver as vertices: `displacement`, `load`, and `reaction`, a ghost penalty's part included.

    The reactions' sum is minus the loads'. A grid that is reset in every load step has no displacements; its loads are
    those of the points at the start. Raises as `write_points`.
    """
    at = fields(model, state, rho)
    data = _at_nodes(at)
    vertices = [("vertex", np.arange(len(at.layout.nodes))[:, None])]
    in_space = {name: _in_space(values) for name, values in data.items()}
    _write(Path(path), meshio.Mesh(_in_space(at.layout.nodes), vertices, point_data=in_space))


def write_grid(path: Path | str, model: Model, state: Equilibrium) -> None:
    """The background grid's cells, all of them, with `displacement`, `load` and `reaction` of the active nodes."""
    grid = model.grid
    ny = grid.nodes[1]
    i, j = (a.ravel() for a in np.meshgrid(*map(np.arange, grid.cells), indexing="ij"))
    corner = i * ny + j
    cells = np.stack([corner, corner + ny, corner + ny + 1, corner + 1], axis=1)
    data = _at_nodes(fields(model, state, np.zeros(len(model.points.volume))))
    nodal = {name: np.zeros((len(grid.node_positions()), 3)) for name in data}
    for name, values in data.items():
        nodal[name][model.transfer.nodes, :2] = values
    active = np.zeros(len(grid.node_positions()))
    active[model.transfer.nodes] = 1
    mesh = meshio.Mesh(_in_space(grid.node_positions()), [("quad", cells)], point_data=nodal | {"active": active})
    _write(Path(path), mesh)


def _at_nodes(at: Fields) -> dict[str, Array]:
    """What there is at nodes (n, 2), by name."""
    moved = {} if at.nodal_displacement is None else {"displacement": at.nodal_displacement}
    return moved | {"load": at.layout.load, "reaction": at.reaction}


def read_points(path: Path | str) -> PointDesign:
    """Points and densities of a file of `write_points`, bit by bit; elements come as points at their centres.

    Raises ValueError for a file without them.
    """
    file = meshio.read(path, file_format="vtu")
    wanted = ("position", "half_length", "volume", "density")
    missing = [name for name in wanted if name not in file.cell_data]
    if missing:
        raise ValueError(f"{path}: no cell data {', '.join(missing)}; give a file that `write_points` wrote")
    x, half_length, volume, rho = (np.concatenate(file.cell_data[name]) for name in wanted)
    return PointDesign(MaterialPoints(x[:, :2].copy(), volume, half_length[:, :2].copy()), rho)


def series(path: Path | str, model: Any, iterates: Iterable[Passed], every: int = 1) -> Iterator[Passed]:
    """Pass iterates on and write every `every`-th one and the last as `<name>/<iteration>.vtu` beside the `.pvd` at
    `path`, which lists them.

    Each file, the list too, is replaced as a whole: ParaView can open the series while it grows. A resumed run goes on
    with the list, from its own first iteration. For either solver:

        for iterate in series("run.pvd", problem.model, optimize(problem, GCMMA())): ...
    """
    path = Path(path)
    entries: dict[int, str] | None = None
    last: Passed | None = None
    for last in iterates:
        if entries is None:
            entries = {k: file for k, file in _listed(path).items() if k < last.iteration}
        if last.iteration % every == 0:
            _add(path, entries, model, last)
        yield last
    if last is not None and entries is not None and last.iteration not in entries:
        _add(path, entries, model, last)


def _add(path: Path, entries: dict[int, str], model: Any, iterate: Step) -> None:
    """Write an iterate and list it."""
    file = Path(path.stem) / f"{iterate.iteration:05d}.vtu"
    write_points(path.parent / file, model, iterate.evaluation.state, iterate.evaluation.rho)
    entries[iterate.iteration] = file.as_posix()
    collection(path, entries)


def collection(path: Path | str, entries: Mapping[int, str]) -> None:
    """Write a `.pvd` that lists files by their time."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    listed = ElementTree.SubElement(root, "Collection")
    for k, file in entries.items():
        ElementTree.SubElement(listed, "DataSet", timestep=str(k), part="0", file=file)
    _replace(Path(path), ElementTree.ElementTree(root).write)


def _listed(path: Path) -> dict[int, str]:
    """Files of a series by iteration; none if there is no series yet."""
    if not path.exists():
        return {}
    sets = ElementTree.parse(path).getroot().iter("DataSet")
    return {int(entry.attrib["timestep"]): entry.attrib["file"] for entry in sets}


def _in_space(plane: Array) -> Array:
    """Vectors (n, 2) as (n, 3): VTK knows no plane."""
    return np.pad(plane, ((0, 0), (0, 1)))


def _symmetric(tensor: Array) -> Array:
    """(n, 6) in VTK's order, of (xx, yy, xy, zz) (n, 4)."""
    return np.pad(tensor[:, VTK_ORDER], ((0, 0), (0, 2)))


def _write(path: Path, mesh: meshio.Mesh) -> None:
    data = mesh.point_data | {name: parts[0] for name, parts in mesh.cell_data.items()}
    for name, values in ({"coordinates": mesh.points} | data).items():
        finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
        if not finite.all():
            raise ValueError(
                f"{name} is not finite at {np.count_nonzero(~finite)} of {len(finite)} places, the first is number "
                f"{np.argmin(finite)}: {path.name} is not written; check the densities and the analysis"
            )
    _replace(path, lambda partial: mesh.write(partial, file_format="vtu"))


def _replace(path: Path, write: Callable[[Path], None]) -> None:
    """Written beside the target and renamed, so that a reader never meets half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    try:
        write(partial)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)

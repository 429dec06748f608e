"""A body that is known by a list of points, from a scan, a picture or another code: the rectangles that they own."""

import csv
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from mpmtop.arrays import Array, Mask
from mpmtop.errors import InvalidScene

ON_EDGE = 1e-9
"""Of a side: rounding of a position on the edge between two rectangles."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Union of equal rectangles of half-length (2,) about points x (p, 2): a region. Its outline is not known."""

    x: Array
    half_length: tuple[float, float]
    _tree: cKDTree = field(init=False, repr=False)

    def __post_init__(self) -> None:
        x, half = np.asarray(self.x, float), np.asarray(self.half_length, float)
        if x.ndim != 2 or x.shape[1] != 2 or len(x) == 0 or not np.all(np.isfinite(x)):
            raise InvalidScene(f"points of shape {x.shape}: give finite positions (p, 2), at least one")
        if half.shape != (2,) or not np.all(half > 0) or not np.all(np.isfinite(half)):
            raise InvalidScene(f"half-length {self.half_length} of a point: give two finite, positive lengths")
        object.__setattr__(self, "_tree", cKDTree(x / half))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        return self.x.min(axis=0) - self.half_length, self.x.max(axis=0) + self.half_length

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in a rectangle grown by `tol`, or shrunk where it is negative: (n,)."""
        distance = self._tree.query(x / np.asarray(self.half_length), p=np.inf)[0]
        return distance <= 1 + ON_EDGE + tol / min(self.half_length)


def read_cloud(path: Path | str, half_length: tuple[float, float] | None = None) -> Cloud:
    """The region of the points of a file: CSV with columns x and y, or VTU as `export.write_points` writes it.

    Without `half_length` points lie on a lattice, and its spacing is the least distance between two columns and between
    two rows. InvalidScene for a file without points.
    """
    path = Path(path)
    if path.suffix == ".vtu":
        from mpmtop.export import read_points  # meshio, of which a CSV needs nothing

        points = read_points(path).points
        x, own = points.x, points.half_length
        return Cloud(x, half_length or (float(own[:, 0].min()), float(own[:, 1].min())))
    try:
        with path.open(newline="") as file:
            x = np.array([(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)])
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidScene(f"{path}: give a CSV with columns x and y, numbers in every row ({error})") from error
    if len(x) == 0:
        raise InvalidScene(f"{path} holds no point: give a CSV with columns x and y")
    return Cloud(x, half_length or (_spacing(x[:, 0]) / 2, _spacing(x[:, 1]) / 2))


def _spacing(along: Array) -> float:
    """Least distance between two different values."""
    steps = np.diff(np.unique(along))
    steps = steps[steps > ON_EDGE * max(float(np.ptp(along)), np.finfo(float).tiny)]
    if len(steps) == 0:
        raise InvalidScene("points in one row or column have no spacing across it: give `half_length`")
    return float(steps.min())

"""The design grid: a Cartesian grid with quadtree refinement, whose leaves are the design variables (Fig. 5a).

Leaf p of level l and index (i, j) is the half-open box origin + [i, i + 1) x [j, j + 1) root / 2^l and owns the
material point at its centre. A tree is never changed; to refine it is to make another one:

    tree = quadtree(scene.domain, (1.0, 1.0))
    tree = tree.refine(tree.cut_by(hole)).restrict(Difference(scene.domain, hole))
    model = discretise(scene, h, points=tree.points())

Leaves are ordered by their roots, column by column as `points.seed` orders its lattice, and within a root along the Z
of Morton: a tree of given leaves is always the same, however it came about.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index, Mask
from mpmtop.errors import EmptyDomain, InvalidScene, PointOutsideGrid
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Region

CHILDREN = np.array([(0, 0), (0, 1), (1, 0), (1, 1)], dtype=np.intp)
EDGES = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)], dtype=np.intp)
KEY_BITS = 62


@dataclass(frozen=True, eq=False)
class Quadtree:
    """Leaves of a grid of roots: `origin` (2,), size `root` (2,) [length], `level` (n,) and `index` (n, 2) of each."""

    origin: Array
    root: Array
    level: Index
    index: Index

    def __post_init__(self) -> None:
        n = len(self.level)
        if n == 0:
            raise EmptyDomain("a quadtree without a leaf: keep at least one in the domain")
        if self.level.shape != (n,) or self.index.shape != (n, 2) or not self.origin.shape == self.root.shape == (2,):
            raise ValueError(
                f"quadtree: origin {self.origin.shape}, root {self.root.shape}, level {self.level.shape}, index "
                f"{self.index.shape}: give (2,), (2,), (n,) and (n, 2)"
            )
        if not (np.all(np.isfinite([self.origin, self.root])) and np.all(self.root > 0)):
            raise ValueError(
                f"quadtree from {self.origin} with roots of {self.root}: give finite numbers, sizes positive"
            )
        if np.min(self.level) < 0 or np.min(self.index) < 0:
            raise ValueError("quadtree: levels and indices must not be negative: put the origin below all leaves")
        if self.cells[0] * self.cells[1] << 2 * self.finest > 1 << KEY_BITS:
            raise InvalidScene(f"quadtree of {self.cells} roots with leaves of level {self.finest}: refine less often")
        if np.any(self._first[1:] < self._last[:-1]):
            raise ValueError("leaves of a quadtree overlap or are out of order: make it by `quadtree` and `refine`")

    @cached_property
    def finest(self) -> int:
        """The highest level of a leaf."""
        return int(self.level.max())

    @cached_property
    def cells(self) -> tuple[int, int]:
        """Number of roots in x and y, from the origin to the last leaf."""
        nx, ny = 1 + np.max(self.index >> self.level[:, None], axis=0)
        return int(nx), int(ny)

    @cached_property
    def size(self) -> Array:
        """Sides of the leaves, (n, 2) [length]."""
        return self.root / 2.0 ** self.level[:, None]

    @property
    def half_length(self) -> Array:
        """Half of the leaves' sides, (n, 2) [length]."""
        return self.size / 2

    @property
    def centre(self) -> Array:
        """Centres of the leaves, (n, 2)."""
        return self.origin + self.size * (self.index + 0.5)

    @property
    def volume(self) -> Array:
        """Areas of the leaves, (n,) [length^2]."""
        return self.size.prod(axis=1)

    def points(self) -> MaterialPoints:
        """One material point for each leaf, in the leaves' order, so that a design (n,) belongs to both."""
        return MaterialPoints(self.centre, self.volume, self.half_length)

    def within(self, region: Region, tol: float = 0.0) -> Mask:
        """Which leaves have their centre in the region grown by `tol`: (n,)."""
        return region.contains(self.centre, tol)

    def cut_by(self, region: Region) -> Mask:
        """Which leaves the region's boundary cuts, by corners and centre of each: some are inside, some outside: (n,).

        What is on the boundary, to 1e-9 of the finest leaf, counts as neither: a region that ends along the sides of
        leaves cuts none. One that passes between those five positions is not seen: begin with leaves smaller than it.
        """
        sample = self.centre[:, None] + self.half_length[:, None] * np.append(2 * CHILDREN - 1, [[0, 0]], axis=0)
        tol = 1e-9 * float(np.min(self.root)) / 2**self.finest
        inside, near = (region.contains(sample.reshape(-1, 2), t).reshape(-1, 5) for t in (-tol, tol))
        return np.any(inside, axis=1) & ~np.all(near, axis=1)

    def refine(self, leaves: Mask | Index) -> "Quadtree":
        """Each of the leaves, by mask (n,) or list of numbers, cut into its four children, in its place."""
        split = np.zeros(len(self.level), dtype=bool)
        chosen = np.asarray(leaves)
        if chosen.ndim != 1 or (chosen.dtype != bool and np.any(np.less(chosen, 0))):
            raise ValueError(f"leaves to refine: give a mask ({len(split)},) or numbers from 0 to below it")
        try:
            split[chosen] = True
        except IndexError as error:
            raise ValueError(f"leaves to refine: give a mask ({len(split)},) or numbers from 0 to below it") from error
        count = np.where(split, 4, 1)
        divided = np.repeat(split, count)
        level = np.repeat(self.level, count) + divided
        index = np.repeat(self.index, count, axis=0) << divided[:, None]
        index[divided] += np.tile(CHILDREN, (int(split.sum()), 1))
        return replace(self, level=level, index=index)

    def restrict(self, region: Region) -> "Quadtree":
        """The leaves whose centre is in the region; EmptyDomain if there are none."""
        kept = self.within(region)
        if not np.any(kept):
            raise EmptyDomain(
                f"none of {len(kept)} leaves has its centre in the region: refine the tree, or enlarge it"
            )
        return replace(self, level=self.level[kept], index=self.index[kept])

    def balanced(self) -> "Quadtree":
        """The least refinement in which no two leaves that share an edge differ by more than one level."""
        tree = self
        while True:
            level = np.repeat(tree.level, len(EDGES))
            beside = tree._find(level, (tree.index[:, None] + EDGES).reshape(-1, 2))
            coarse = beside[(beside >= 0) & (tree.level[beside] < level - 1)]
            if len(coarse) == 0:
                return tree
            tree = tree.refine(coarse)

    def covers(self, x: Array) -> Mask:
        """Which of the positions x (n, 2) lie in a leaf: (n,). The domain's right and upper ends do not."""
        return self._locate(x) >= 0

    def leaf_of(self, x: Array) -> Index:
        """Number of the leaf that holds each of the positions x (n, 2): (n,); PointOutsideGrid if there is none.

        With it a field (n,) of the leaves is known anywhere: field[tree.leaf_of(x)].
        """
        leaf = self._locate(x)
        if np.any(leaf < 0):
            raise PointOutsideGrid(
                f"{np.count_nonzero(leaf < 0)} of {len(x)} positions lie in no leaf, the first at {x[leaf < 0][0]}: "
                "leave out what the tree does not cover (`covers`)"
            )
        return leaf

    def _locate(self, x: Array) -> Index:
        if np.ndim(x) != 2 or np.shape(x)[1] != 2 or not np.all(np.isfinite(x)):
            raise ValueError(f"positions of shape {np.shape(x)}: give finite ones, (n, 2)")
        cell = np.floor((x - self.origin) / self.root * 2**self.finest)
        cell = np.clip(
            cell, -1, np.multiply(self.cells, 2**self.finest)
        )  # what is outside stays so, and fits an integer
        return self._find(np.full(len(x), self.finest), cell.astype(np.intp))

    def _find(self, level: Index, index: Index) -> Index:
        """The leaf (m,) that holds the lower left corner of each box of `level` (m,) and `index` (m, 2), -1 if none."""
        finer = np.maximum(level - self.finest, 0)
        level, index = level - finer, index >> finer[:, None]
        root = index >> level[:, None]
        outside = np.any((root < 0) | (root >= self.cells), axis=1)
        key = self._key(level, np.where(outside[:, None], 0, index))
        leaf = np.searchsorted(self._first, key, side="right") - 1
        return np.where(outside | (leaf < 0) | (key >= self._last[leaf]), -1, leaf)

    def _key(self, level: Index, index: Index) -> Index:
        """Where boxes (m,) begin on the curve through all boxes of the finest level: the root, then bits x y x y ..."""
        i, j = (index << (self.finest - level)[:, None]).T
        key = (i >> self.finest) * self.cells[1] + (j >> self.finest)
        for bit in range(self.finest - 1, -1, -1):
            key = 4 * key + 2 * (i >> bit & 1) + (j >> bit & 1)
        return key

    @cached_property
    def _first(self) -> Index:
        return self._key(self.level, self.index)

    @cached_property
    def _last(self) -> Index:
        """Where leaves end on the curve, (n,): the first place after."""
        return self._first + (1 << 2 * (self.finest - self.level))


def quadtree(region: Region, size: tuple[float, float]) -> Quadtree:
    """Roots of the given size over the region's bounding box, which it must divide; those with centre outside are left
    out. Raises as `points.seed` does, whose lattice it is."""
    lattice = seed(region, size)
    origin, root = region.bounds[0], 2 * lattice.half_length[0]
    index = np.floor((lattice.x - origin) / root).astype(np.intp)
    return Quadtree(origin, root, np.zeros(len(index), np.intp), index)


def remap(source: Quadtree, target: Quadtree) -> sp.csr_array:
    """Operator (n_target, n_source) between the fields of two trees of one domain: T_ts = V(t and s) / V_t.

    A finer leaf takes the value of the one it came from, a coarser one the mean of its parts weighted by volume; both
    conserve sum V f, and going to a finer tree and back changes nothing. InvalidScene if roots or domains differ.
    """
    if not (np.array_equal(source.origin, target.origin) and np.array_equal(source.root, target.root)):
        raise InvalidScene("fields pass between trees of the same roots only: refine both from one `quadtree`")
    into = target._find(source.level, source.index)  # of every source leaf
    part = np.flatnonzero((into >= 0) & (target.level[into] <= source.level))
    within = source._find(target.level, target.index)  # of every target leaf
    child = np.flatnonzero((within >= 0) & (source.level[within] < target.level))
    share = 0.25 ** (source.level[part] - target.level[into[part]])
    weight = np.append(share, np.ones(len(child)))
    shape = len(target.level), len(source.level)
    matrix = sp.csr_array((weight, (np.append(into[part], child), np.append(part, within[child]))), shape=shape)
    taken = matrix.T @ 0.25**target.level / 0.25**source.level  # of every source leaf; exact, as all are powers of four
    if np.any(matrix.sum(axis=1) != 1) or np.any(taken != 1):
        raise InvalidScene("the two trees do not cover the same domain: restrict both to one region")
    return matrix

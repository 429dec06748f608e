"""The design grid: leaves tile the domain at any refinement, and fields find their way between trees and positions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpmtop.arrays import Array
from mpmtop.errors import EmptyDomain, InvalidScene, PointOutsideGrid
from mpmtop.filter import density_filter
from mpmtop.points import seed
from mpmtop.problem import design_problem
from mpmtop.quadtree import Quadtree, quadtree, remap
from mpmtop.region import Circle, Difference, LevelSet, Polygon, Rectangle
from tests.scenes import cantilever

BODY = Rectangle((1.0, -2.0), (7.0, 2.0))  # 6 x 4
PAPER = Rectangle((0, 0), (30, 15))
SEEDS = st.integers(0, 10**6)


def random_tree(seed: int, times: int = 4, part: float = 0.3) -> Quadtree:
    """The body's 12 roots of 2 x 1, refined at random some times."""
    rng = np.random.default_rng(seed)
    tree = quadtree(BODY, (2.0, 1.0))
    for _ in range(times):
        tree = tree.refine(rng.random(len(tree.level)) < part)
    return tree


def positions(n: int = 500) -> Array:
    return np.random.default_rng(9).uniform(*BODY.bounds, (n, 2))


def leaves(tree: Quadtree) -> set[tuple[int, ...]]:
    return set(map(tuple, np.column_stack([tree.level, tree.index])))


@given(SEEDS)
@settings(max_examples=30)
def test_leaves_tile_the_body(seed: int) -> None:
    """No gap and no overlap: a position is in exactly one leaf, by the leaves' own boxes, and areas add up."""
    tree, x = random_tree(seed), positions()
    assert tree.volume.sum() == 24  # sums of powers of two
    lower, upper = tree.centre - tree.half_length, tree.centre + tree.half_length
    holds = np.all((x[:, None] >= lower) & (x[:, None] < upper), axis=2)
    np.testing.assert_array_equal(holds.sum(axis=1), 1)
    np.testing.assert_array_equal(tree.leaf_of(x), np.argmax(holds, axis=1))
    assert np.all(tree.covers(x))


@given(SEEDS)
@settings(max_examples=30)
def test_a_design_is_found_again_from_positions(seed: int) -> None:
    tree = random_tree(seed)
    points = tree.points()
    design = np.random.default_rng(seed).random(len(points.x))
    shift = np.random.default_rng(seed + 1).uniform(-0.99, 0.99, points.x.shape) * points.half_length
    np.testing.assert_array_equal(design[tree.leaf_of(points.x)], design)
    np.testing.assert_array_equal(design[tree.leaf_of(points.x + shift)], design)  # points may have moved
    np.testing.assert_array_equal(points.volume, np.prod(2 * points.half_length, axis=1))


@given(SEEDS)
@settings(max_examples=30)
def test_order_depends_on_the_leaves_only(seed: int) -> None:
    """Roots refined one after the other, in random order, and all at once: the same tree."""
    tree = quadtree(BODY, (2.0, 1.0))
    chosen = np.random.default_rng(seed).permutation(12)[:7]
    at_once = tree.refine(chosen)
    for x in tree.centre[chosen]:
        tree = tree.refine(tree.leaf_of(x[None] + 1e-3))
    np.testing.assert_array_equal(tree.index, at_once.index)
    np.testing.assert_array_equal(tree.level, at_once.level)
    unchanged = at_once.refine(np.zeros(len(at_once.level), bool)).restrict(BODY)
    np.testing.assert_array_equal(unchanged.index, at_once.index)


def test_roots_are_the_seeded_lattice() -> None:
    for region in (BODY, Circle((3, 2), 1.5)):
        points, seeded = quadtree(region, (0.1, 0.25)).points(), seed(region, (0.1, 0.25))
        np.testing.assert_array_equal(points.x, seeded.x)
        np.testing.assert_array_equal(points.volume, seeded.volume)
        np.testing.assert_array_equal(points.half_length, seeded.half_length)


def test_point_counts_of_the_paper() -> None:
    """Sect. 6.2: 4,050 low and 16,200 high. The row of centres at y = 7.5 makes two readings of the upper half."""
    low = quadtree(PAPER, (1 / 3, 1 / 3))
    assert len(low.points().x) == 4050
    assert len(low.refine(np.ones(4050, bool)).points().x) == 16200
    upper = Rectangle((0, 7.5), (30, 15))
    assert len(low.refine(low.within(upper, tol=-1e-9)).level) == 90 * (23 + 4 * 22) == 9990
    assert len(low.refine(low.within(upper, tol=1e-9)).level) == 90 * (22 + 4 * 23) == 10260


@given(SEEDS)
@settings(max_examples=30)
def test_balance(seed: int) -> None:
    """By brute force over all pairs: leaves that share an edge differ by one level; nothing is refined needlessly."""
    tree = random_tree(seed, times=6, part=0.1)
    balanced = tree.balanced()
    assert largest_jump(balanced) <= 1
    assert balanced.volume.sum() == 24
    assert leaves(balanced.balanced()) == leaves(balanced)
    if largest_jump(tree) <= 1:
        assert leaves(balanced) == leaves(tree)
    assert np.all(balanced.level >= tree.level[tree.leaf_of(balanced.centre)])


def largest_jump(tree: Quadtree) -> int:
    centre, half = tree.centre / tree.root, tree.half_length / tree.root
    gap = np.abs(centre[:, None] - centre) - (half[:, None] + half)
    touch = (np.min(gap, axis=2) < -1e-9) & (np.abs(np.max(gap, axis=2)) < 1e-9)
    assert np.any(touch)
    return int(np.max(np.abs(np.subtract.outer(tree.level, tree.level))[touch]))


def test_balance_of_one_deep_corner() -> None:
    """Beside one leaf of level 5 every level down to the roots appears once more: counted by hand for a 2 x 2 root."""
    tree = quadtree(Rectangle((0, 0), (2, 2)), (1.0, 1.0))
    for _ in range(5):
        tree = tree.refine(tree.leaf_of(np.array([[0.999, 0.999]])))
    assert len(tree.level) == 4 + 5 * 3 and largest_jump(tree) == 5
    # the three other roots share the corner: the right and the upper one are refined towards it down to level 4, the
    # diagonal one to level 3, beside those two
    assert len(tree.balanced().level) == len(tree.level) + 2 * (4 * 3) + 3 * 3
    assert largest_jump(tree.balanced()) == 1


@given(SEEDS, SEEDS)
@settings(max_examples=30)
def test_fields_pass_between_trees(one: int, other: int) -> None:
    """Any two refinements: the integral is conserved, constants and what both can hold pass unchanged."""
    a, b = random_tree(one), random_tree(other)
    T = remap(a, b)
    field = np.random.default_rng(one).integers(0, 100, len(a.level)).astype(float)
    assert b.volume @ (T @ field) == a.volume @ field  # exact in binary: integers over powers of four
    np.testing.assert_array_equal(T @ np.ones(len(a.level)), 1)
    finer = a.refine(b.leaf_of(b.centre)[: len(a.level) // 3])
    np.testing.assert_array_equal(remap(finer, a) @ (remap(a, finer) @ field), field)
    np.testing.assert_array_equal(remap(a, finer) @ field, field[a.leaf_of(finer.centre)])
    common = quadtree(BODY, (2.0, 1.0))
    by_way = remap(b, common) @ (T @ field)
    np.testing.assert_allclose(by_way, remap(a, common) @ field, rtol=1e-14)  # the order of a sum


def test_trees_of_other_domains_are_refused() -> None:
    a = quadtree(BODY, (2.0, 1.0))
    with pytest.raises(InvalidScene, match="same domain"):
        remap(a, a.restrict(Rectangle((1, -2), (5, 2))))
    with pytest.raises(InvalidScene, match="same domain"):
        remap(a.restrict(Rectangle((1, -2), (5, 2))), a)
    left, right = a.restrict(Rectangle((1, -2), (3, 2))), a.restrict(Rectangle((5, -2), (7, 2)))
    with pytest.raises(InvalidScene, match="same domain"):
        remap(left, right)
    with pytest.raises(InvalidScene, match="same roots"):
        remap(a, quadtree(BODY, (1.0, 1.0)))


def test_a_hole_is_refined_and_cut_out() -> None:
    """The area missing of a domain with a hole shrinks with the leaves along its boundary."""
    hole = Circle((4.0, 0.0), 1.3)
    domain = Difference(BODY, hole)
    tree = quadtree(BODY, (0.5, 0.5))
    error, cut = [], []
    for _ in range(6):
        kept = tree.restrict(domain)
        error.append(abs(kept.volume.sum() - (24 - np.pi * 1.3**2)))
        cut.append(np.count_nonzero(tree.cut_by(hole)))
        assert not np.any(hole.contains(kept.centre))
        assert not np.any(kept.covers(np.array([[4.0, 0.0], [0.0, 0.0], [7.0, 0.0]])))  # hole, outside, right end
        tree = tree.refine(tree.cut_by(hole))
    leaf = 0.5 / 2.0 ** np.arange(6)
    assert np.all(np.array(error) < 2 * np.pi * 1.3 * leaf / 2)  # half a leaf along the whole boundary
    # a closed convex curve crosses about 4 / pi (perimeter / side) = 8 r / side boxes
    np.testing.assert_allclose(np.array(cut)[2:], 8 * 1.3 / leaf[2:], rtol=0.1)


def test_what_cuts_a_leaf() -> None:
    tree = quadtree(BODY, (1.0, 1.0))
    assert not np.any(tree.cut_by(Rectangle((2, -1), (4, 1))))  # along the sides of leaves
    assert np.count_nonzero(tree.cut_by(Rectangle((2, -1), (3.25, 1)))) == 2
    assert np.count_nonzero(tree.cut_by(Circle((1.5, -1.5), 0.1))) == 1  # around a centre
    line = LevelSet((-np.inf, -np.inf), (np.inf, np.inf), lambda x: x[:, 1] - 0.3)
    np.testing.assert_array_equal(np.unique(tree.centre[tree.cut_by(line)][:, 1]), [0.5])
    assert np.count_nonzero(tree.cut_by(line)) == 6


def test_leaves_are_refined_by_mask_or_by_number() -> None:
    tree = random_tree(3)
    mask = tree.within(Polygon(((1, -2), (7, -2), (4, 2))))
    assert leaves(tree.refine(mask)) == leaves(tree.refine(np.flatnonzero(mask)))
    assert len(tree.refine(mask).level) == len(mask) + 3 * np.count_nonzero(mask)


def test_filter_averages_over_levels_by_volume() -> None:
    """Refining one side does not draw the average towards it: a step at distance d is seen as by a continuous cone.

    Its cross-section at the centre has area r^2, its volume is pi r^3 / 3: 1/2 - 3 d / (pi r) for small d.
    """
    coarse = quadtree(Rectangle((0, 0), (8, 8)), (0.5, 0.5))
    right = Rectangle((4, 0), (8, 8))
    for tree in (coarse, coarse.refine(coarse.within(right))):
        rho = density_filter(tree.points(), 1.7)(tree.within(right).astype(float))
        near = tree.leaf_of(np.array([[3.75, 3.75], [4.125, 3.625]]))
        distance = 4 - tree.centre[near, 0]
        np.testing.assert_allclose(rho[near], 0.5 - 3 * distance / (np.pi * 1.7), atol=0.01)  # cone sampled at 0.5


def test_a_refined_body_is_analysed() -> None:
    """A uniform design of a mixed tree is as stiff as that of a lattice, to the quadrature of both."""
    domain = cantilever().body.domain
    tree = quadtree(domain, (0.5, 0.5))
    mixed = tree.refine(tree.within(Rectangle((2, 1), (6, 4))))
    lattice, refined = (
        design_problem(cantilever(), 1.0, points=t.points()).analyse(np.full(len(t.level), 0.5)) for t in (tree, mixed)
    )
    assert refined.constraints == pytest.approx(lattice.constraints, rel=1e-13)
    assert refined.objective == pytest.approx(lattice.objective, rel=0.02)


def test_degenerate_trees_are_refused() -> None:
    tree = quadtree(BODY, (2.0, 1.0))
    with pytest.raises(InvalidScene, match="does not divide"):
        quadtree(BODY, (0.7, 1.0))
    with pytest.raises(EmptyDomain, match="enlarge it"):
        tree.restrict(Circle((50, 50), 1.0))
    with pytest.raises(PointOutsideGrid, match="2 of 3 positions"):
        tree.leaf_of(np.array([[0.5, 0.0], [2.0, 0.0], [1e300, 0.0]]))
    with pytest.raises(ValueError, match="finite ones"):
        tree.leaf_of(np.full((1, 2), np.nan))
    with pytest.raises(ValueError, match="finite ones"):
        tree.covers(np.zeros(2))
    for wrong in (np.ones(5, bool), np.array([99])):
        with pytest.raises(ValueError, match="give a mask"):
            tree.refine(wrong)
    index = np.array([[2**30, 2**30]])  # of a root, where keys need 60 bits for them alone
    with pytest.raises(InvalidScene, match="refine less often"):
        Quadtree(np.zeros(2), np.ones(2), np.zeros(1, np.intp), index).refine(np.array([0]))
    start = np.zeros(2), np.ones(2)
    twice = np.zeros((2, 2), np.intp)
    with pytest.raises(ValueError, match="overlap"):
        Quadtree(*start, np.array([0, 1]), twice)
    with pytest.raises(ValueError, match="out of order"):
        Quadtree(*start, np.zeros(2, np.intp), np.array([[1, 0], [0, 0]]))
    with pytest.raises(ValueError, match="not be negative"):
        Quadtree(*start, np.zeros(1, np.intp), np.array([[-1, 0]]))
    with pytest.raises(ValueError, match="sizes positive"):
        Quadtree(np.zeros(2), np.zeros(2), np.zeros(1, np.intp), twice[:1])
    with pytest.raises(ValueError, match=r"give \(2,\)"):
        Quadtree(np.zeros(3), np.ones(2), np.zeros(1, np.intp), twice[:1])
    with pytest.raises(EmptyDomain, match="without a leaf"):
        Quadtree(*start, np.zeros(0, np.intp), twice[:0])

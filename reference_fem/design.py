"""Design: which elements are variables, and the density filter from them to the densities of all elements."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from mpmtop.arrays import Array, Index, Mask
from mpmtop.design import Design, Mirror, Projection
from mpmtop.errors import EmptyDomain, InvalidScene

SAME_PLACE = 1e-6  # of an element's side: rounding of an image, and nothing that is meant
BISECTIONS = 60  # of the interval from 0 to 1: to the last bit of a double


@dataclass(frozen=True, eq=False)
class DesignSpace:
    """Filtered densities r = H x + fixed (e,) of a design x (n,), one variable for each element that is not passive, or
    for all of them that a symmetry makes images of one another.

    solid, void  (e,) whether an element is passive, and with what density, 1 or 0
    active       (a,) the other elements
    variable     (a,) the variable of each of them
    H            (e, n) filter, with empty rows for passive elements
    fixed        (e,) densities of passive elements, and what they add to those of their neighbours
    """

    solid: Mask
    void: Mask
    active: Index
    variable: Index
    H: sp.csr_matrix
    fixed: Array

    @property
    def first(self) -> Index:
        """The first element (n,) of each variable."""
        return self.active[np.unique(self.variable, return_index=True)[1]]


def design_space(design: Design, centres: Array, area: Array, filter_passive: bool) -> DesignSpace:
    """Design space of elements at centres (e, 2), passive where these lie in the passive regions.

    The filter averages active elements only, as if the passive ones were absent; with `filter_passive` all elements
    of the body, passive densities included. Raises InvalidScene where both regions claim an element and EmptyDomain
    where no element is left.
    """
    solid, void = (
        np.zeros(len(centres), bool) if region is None else region.contains(centres)
        for region in (design.passive_solid, design.passive_void)
    )
    for name, region, held in (
        ("passive_solid", design.passive_solid, solid),
        ("passive_void", design.passive_void, void),
    ):
        if region is not None and not held.any():
            raise InvalidScene(f"{name} holds no element's centre: enlarge it, or use smaller elements")
    both = solid & void
    if both.any():
        raise InvalidScene(
            f"{np.count_nonzero(both)} elements lie in both passive_solid and passive_void, the first at "
            f"{centres[both][0]}: take one region out of the other (`Difference`)"
        )
    passive = solid | void
    if passive.all():
        raise EmptyDomain("every element is passive: shrink passive_solid or passive_void to leave something to design")
    active = np.flatnonzero(~passive)
    fixed = solid.astype(float)
    if filter_passive:
        whole = density_filter(centres, area, design.filter_radius)
        fixed[active] = whole[active] @ fixed
        H = whole[active][:, active]
    else:
        H = density_filter(centres[active], area[active], design.filter_radius)
    if passive.any():
        H = sp.csr_matrix(sp.identity(len(centres), format="csc")[:, active] @ H)
    variable = images(design.symmetry, centres[active], area[active])
    if design.symmetry:
        H = sp.csr_matrix(H @ sp.identity(variable.max() + 1, format="csr")[variable])
    return DesignSpace(solid, void, active, variable, H, fixed)


def images(symmetry: tuple[Mirror, ...], centres: Array, area: Array) -> Index:
    """Variable (a,) of elements with centres (a, 2), one for all that are images of one another in the mirrors.

    Every element takes the least number among its images' until no number changes. InvalidScene where the image of an
    element is none, or one of another area.
    """
    number = np.arange(len(centres))
    seen = []
    for mirror in symmetry:
        apart, image = cKDTree(centres).query(mirror.image(centres))
        missing = (apart > SAME_PLACE * np.sqrt(area)) | (abs(area[image] - area) > SAME_PLACE * area)
        if missing.any():
            raise InvalidScene(
                f"symmetry: {np.count_nonzero(missing)} elements, the first at {centres[missing][0]}, have no image of "
                f"their size in {mirror}: move the mirror, or choose elements and passive regions that are symmetric"
            )
        seen.append(image)
    for _ in range(len(centres)):
        least = number.copy()
        for image in seen:
            least = np.minimum(least, least[image])
        if np.array_equal(least, number):
            break
        number = least
    return np.unique(number, return_inverse=True)[1].ravel()


def step(projection: Projection, eta: float, r: Array) -> tuple[Array, Array, Array]:
    """Projected densities and their derivatives by r (e,) and by the threshold eta, see `Projection`."""
    beta = projection.beta
    below, above, here = np.tanh(beta * eta), np.tanh(beta * (1 - eta)), np.tanh(beta * (r - eta))
    rho = (below + here) / (below + above)
    by_r = beta * (1 - here**2) / (below + above)
    # quotient rule: of the numerator, then of the denominator
    by_eta = beta * ((1 - below**2) - (1 - here**2)) - rho * beta * ((1 - below**2) - (1 - above**2))
    return rho, by_r, by_eta / (below + above)


def threshold(projection: Projection, r: Array, area: Array) -> float:
    """The threshold given, or by bisection that at which the projected densities have the volume of r (e,)."""
    if not projection.preserve_volume:
        return projection.threshold
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if area @ step(projection, middle, r)[0] > area @ r else (low, middle)
    return 0.5 * (low + high)


def projection_adjoint(projection: Projection, r: Array, area: Array, by_rho: Array) -> Array:
    """dJ/dr (e,) of dJ/drho. Where the volume is kept, the threshold follows: sum a (drho/dr - 1) dr +
    sum a drho/deta deta = 0."""
    _, by_r, by_eta = step(projection, threshold(projection, r, area), r)
    direct = by_r * by_rho
    if not projection.preserve_volume or not area @ by_eta < 0:
        return direct
    return direct + (by_eta @ by_rho) / (area @ by_eta) * area * (1 - by_r)


def density_filter(x: Array, volume: Array, radius: float) -> sp.csr_matrix:
    """Filter H (p, p), H_ij ~ volume_j max(0, radius - |x_i - x_j|) with rows of sum one, for points x (p, 2).

    A radius below the spacing gives the identity. Its adjoint is the transpose. Source: Bruns and Tortorelli, Comput.
    Methods Appl. Mech. Engng 190 (2001) 3443.
    """
    tree = cKDTree(x)
    pairs = tree.sparse_distance_matrix(tree, radius, output_type="coo_matrix")
    cone = sp.csr_matrix(((radius - pairs.data) * volume[pairs.col], (pairs.row, pairs.col)), shape=pairs.shape)
    return sp.diags(1 / cone.sum(axis=1).A1) @ cone

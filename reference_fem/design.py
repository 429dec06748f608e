"""Design: which elements are variables, and the density filter from them to the densities of all elements."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from mpmtop.arrays import Array, Index, Mask
from mpmtop.design import Design
from mpmtop.errors import EmptyDomain, InvalidScene


@dataclass(frozen=True, eq=False)
class DesignSpace:
    """Densities rho = H x + fixed (e,) of a design x (a,), one variable for each element that is not passive.

    solid, void  (e,) whether an element is passive, and with what density, 1 or 0
    active       (a,) the other elements
    H            (e, a) filter, with empty rows for passive elements
    fixed        (e,) densities of passive elements, and what they add to those of their neighbours
    """

    solid: Mask
    void: Mask
    active: Index
    H: sp.csr_matrix
    fixed: Array


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
    return DesignSpace(solid, void, active, H, fixed)


def density_filter(x: Array, volume: Array, radius: float) -> sp.csr_matrix:
    """Filter H (p, p), H_ij ~ volume_j max(0, radius - |x_i - x_j|) with rows of sum one, for points x (p, 2).

    A radius below the spacing gives the identity. Its adjoint is the transpose. Source: Bruns and Tortorelli, Comput.
    Methods Appl. Mech. Engng 190 (2001) 3443.
    """
    tree = cKDTree(x)
    pairs = tree.sparse_distance_matrix(tree, radius, output_type="coo_matrix")
    cone = sp.csr_matrix(((radius - pairs.data) * volume[pairs.col], (pairs.row, pairs.col)), shape=pairs.shape)
    return sp.diags(1 / cone.sum(axis=1).A1) @ cone

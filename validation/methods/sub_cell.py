"""Bilinear elements on the background grid of the material point method, with a density for each part of an element.

As many unknowns and the same design variables as standard MPM: what is left between the two is quadrature, one point in
the middle of each part there and 2 x 2 Gauss points in each part here, exact for bilinear displacements. Elements
are material points at those Gauss points under tent functions, to which the tests hold scikit-fem.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mpmtop import problem
from mpmtop.arrays import Array
from mpmtop.criteria import PNormStress
from mpmtop.filter import DensityFilter, density_filter
from mpmtop.loads import PositionLoad
from mpmtop.material import von_mises
from mpmtop.model import discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem, Evaluation
from mpmtop.scene import Scene
from mpmtop.shape_functions import tent
from validation.bodies.scenes import SPACING, H
from validation.methods.analyser import Analyser, stress_measure

GAUSS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / np.sqrt(3)
"""Of the half-length of a part."""
PER_PART = len(GAUSS)


def gauss_points(parts: MaterialPoints) -> MaterialPoints:
    """2 x 2 Gauss points in each of p parts, those of a part in succession, (4p,)."""
    x = (parts.x[:, None] + GAUSS * parts.half_length[:, None]).reshape(-1, 2)
    share = np.repeat(parts.volume, PER_PART) / PER_PART
    return MaterialPoints(x, share, np.repeat(parts.half_length, PER_PART, axis=0) / 2)


@dataclass(frozen=True, eq=False)
class SubCellProblem:
    """The design problem of p parts, over that of their 4p Gauss points.

    In a p-norm each Gauss point counts as a quarter, (1/4 sum s^p)^(1/p), so that it equals the paper's if the stress
    is even over a part.
    """

    at_gauss: DesignProblem
    parts: MaterialPoints
    filter_radius: float

    @cached_property
    def filter(self) -> DensityFilter:
        """The density filter on the parts."""
        return density_filter(self.parts, self.filter_radius)

    @cached_property
    def scale(self) -> float:
        """Of the objective, for what a Gauss point counts."""
        stated = self.at_gauss.objective
        return PER_PART ** (-1 / stated.p) if isinstance(stated, PNormStress) else 1.0

    @property
    def x0(self) -> Array:
        """The volume fraction everywhere, (p,)."""
        return self.at_gauss.x0[::PER_PART]

    @property
    def positions(self) -> Array:
        """Places of the design variables, (p, 2)."""
        return self.parts.x

    @property
    def lower(self) -> Array:
        """rho_min everywhere, (p,)."""
        return self.at_gauss.lower[::PER_PART]

    @property
    def upper(self) -> Array:
        """One everywhere, (p,)."""
        return self.at_gauss.upper[::PER_PART]

    @property
    def fingerprint(self) -> str:
        """Of the problem at the Gauss points, and of the filter."""
        return f"{self.at_gauss.fingerprint}, parts, filter radius {self.filter_radius!r}"

    def analyse(self, rho: Array) -> Evaluation:
        """Evaluate densities (p,) of the parts: one solve."""
        evaluation = self.at_gauss.analyse(np.repeat(rho, PER_PART))
        return replace(evaluation, objectives=self.scale * evaluation.objectives, rho=rho)

    def evaluate(self, x: Array) -> Evaluation:
        """One analysis of the design x (p,)."""
        return self.analyse(self.filter(x))

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/dx (p,) and dg/dx (1, p): by the densities at the Gauss points, summed over each part."""
        at_gauss = replace(evaluation, rho=np.repeat(evaluation.rho, PER_PART))
        by_rho = self.scale * self.at_gauss.density_gradient(at_gauss)
        volume = self.parts.volume / (self.at_gauss.design.volume_fraction * self.parts.volume.sum())
        return self.filter.adjoint(of_parts(by_rho)), self.filter.adjoint(volume)[None]


def of_parts(at_gauss: Array) -> Array:
    """Sums (p,) over the Gauss points of each part."""
    return at_gauss.reshape(-1, PER_PART).sum(axis=1)


def elements_of_the_grid(scene: Scene) -> Analyser:
    """The scene by these elements: side h, 2 x 2 parts each, forces at the places of the material points that MPM's
    act on; von Mises stress (p,) of a part is the root mean square of its Gauss points'."""
    parts = seed(scene.body.domain, (SPACING, SPACING))
    acting = [load.act(parts.x, parts.volume, 1e-9 * H).places(parts.x) for load in scene.body.loads]
    loads = tuple(
        PositionLoad((float(x), float(y)), (float(a), float(b)))
        for places, forces in acting
        for (x, y), (a, b) in zip(places, forces, strict=True)
    )
    body = replace(scene.body, loads=loads)
    model = discretise(body, H, points=gauss_points(parts), shape_function=tent)
    # its own filter is never used: the least radius that it takes
    design = replace(scene.design, filter_radius=SPACING / 100)
    sub_cell = SubCellProblem(DesignProblem(model, design, scene.objective), parts, scene.design.filter_radius)

    def stress(evaluation: problem.Evaluation) -> Array:
        solid = np.full(len(model.points.x), model.elastic.young)
        vm = von_mises(model.stress(solid, evaluation.state.strain), model.elastic, stress_measure(scene))
        return np.sqrt(of_parts(vm**2) / PER_PART)

    return Analyser("Q1, grid's elements", scene, sub_cell, parts.x, parts.half_length, stress)

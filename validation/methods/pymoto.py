"""pyMOTO: an analysis, and the cantilever's optimisation with the filter, load and problem of `reference_fem.simp`.

pyMOTO (MIT, github.com/aatmdelissen/pyMOTO) is a package for modular topology optimisation. It takes the best solver it
finds: Intel MKL's PARDISO, CHOLMOD, else SuperLU.
"""

from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any
from unittest.mock import patch

import matplotlib as mpl
import numpy as np
from scipy.spatial import KDTree

from mpmtop.arrays import Array, Index
from mpmtop.loads import action
from mpmtop.scene import Scene
from validation.methods.protocol import Answer, Capability, Case

with patch.object(mpl, "use"):  # pyMOTO asks for a window as it is imported; the report draws without one
    import pymoto


@dataclass(eq=False)
class PyMoto:
    """Compliance of the cantilever `scene` on nx x ny square bilinear elements, one design variable each.

    `step` makes one iteration, `compliance` is that of the design before it.
    """

    scene: Scene
    nx: int
    ny: int
    move: float
    design: pymoto.Signal = field(init=False)
    rho: pymoto.Signal = field(init=False)
    objective: pymoto.Signal = field(init=False)
    optimizer: pymoto.MMA = field(init=False)

    def __post_init__(self) -> None:
        scene = self.scene
        lower, upper = scene.body.domain.bounds
        side = float((upper - lower)[0] / self.nx)
        domain = pymoto.VoxelDomain(self.nx, self.ny, unitx=side, unity=side)
        clamped = domain.get_dofnumber(domain.nodes[0, :].ravel(), [0, 1], ndof=2).ravel()
        self.design = pymoto.Signal("design", np.full(domain.nel, scene.design.volume_fraction))
        stiff, contrast = 1 - scene.design.contrast, scene.design.contrast
        with pymoto.Network() as network:
            self.rho = pymoto.DensityFilter(domain, radius=scene.design.filter_radius / side)(self.design)
            moduli = pymoto.MathExpression(f"{contrast} + {stiff}*inp0^{scene.design.penal}")(self.rho)
            K = pymoto.AssembleStiffness(
                domain, bc=clamped, e_modulus=scene.body.material.young, poisson_ratio=scene.body.material.poisson
            )(moduli)
            f = self._load(domain, side)
            u = pymoto.LinSolve(symmetric=True, positive_definite=True)(K, f)
            self.objective = pymoto.EinSum("i,i->")(u, f)
            volume = pymoto.EinSum("i->")(self.rho)
            bound = scene.design.volume_fraction * domain.nel
            constraint = pymoto.MathExpression(f"inp0/{bound} - 1")(volume)
        self.optimizer = pymoto.MMA(
            self.design,
            [self.objective, constraint],
            network,
            move=self.move,
            xmin=scene.design.rho_min,
            xmax=1.0,
            verbosity=0,
        )

    def _load(self, domain: Any, side: float) -> Array:
        """Nodal forces (2n,): each share of the load at an element's centre, a quarter to each of its nodes."""
        centres = np.array(domain.get_element_position())[:2].T + self.scene.body.domain.bounds[0]
        acts = action(self.scene.body.loads, centres, np.full(len(centres), side**2), 1e-9 * side)
        positions, forces = acts.places(centres)
        element = np.argmin(np.linalg.norm(centres - positions[:, None], axis=2), axis=1)
        f = np.zeros((domain.nnodes, 2))
        np.add.at(f, domain.conn[element], forces[:, None] / 4)
        return f.ravel()

    @property
    def compliance(self) -> float:
        """Objective of the design that was analysed last."""
        return float(self.objective.state)

    @property
    def element_densities(self) -> Array:
        """Physical densities (e,) of that design, in the order of `reference_fem`'s lattice: along y first."""
        return np.asarray(self.rho.state).reshape(self.ny, self.nx).T.ravel()

    def step(self) -> float:
        """Analysis, sensitivities and one MMA update; the compliance of the design analysed comes back."""
        self.optimizer.x, *_ = self.optimizer.step()
        return self.compliance


@dataclass(frozen=True)
class PyMotoMethod:
    """pyMOTO's elements behind the methods' protocol, one for each point; fields at their centres."""

    name: str = "pyMOTO"
    version: str = f"pyMOTO {version('pymoto')}"
    capabilities: frozenset[Capability] = field(
        default=frozenset({"analysis", "gradient", "moduli by point", "body forces", "plane stress"})
    )

    def analyse(self, case: Case) -> Answer:
        """See `Analyses`."""
        material = case.body.material
        domain, element, _, u, work = _network(case)
        stress = pymoto.Stress(domain, 1.0, material.poisson, material.plane)(u).state[:, element] * case.moduli
        at = np.asarray(u.state).reshape(-1, 2)[domain.conn[element]].mean(axis=1)
        return Answer(at, stress.T, float(work.state))

    def gradient(self, case: Case) -> Array:
        """By pyMOTO's own chain of sensitivities; see `Analyses`."""
        _, element, moduli, _, _ = _network(case, differentiated=True)
        by_element: Array = np.asarray(moduli.sensitivity)[element]
        return by_element


def _network(case: Case, *, differentiated: bool = False) -> tuple[Any, Index, Any, Any, Any]:
    """Domain, element (p,) of each point, and the signals of moduli, displacements and compliance of a case."""
    lower, upper = case.body.domain.bounds
    size = 2 * case.points.half_length[0]
    count = np.rint((upper - lower) / size).astype(int)
    domain = pymoto.VoxelDomain(*count.tolist(), unitx=float(size[0]), unity=float(size[1]))
    element = KDTree(np.array(domain.get_element_position())[:2].T + lower).query(case.points.x)[1]
    nodes = np.array(domain.get_node_position())[:2].T + lower
    held = np.zeros(nodes.shape, bool)
    for support in case.body.held:
        held |= np.outer(support.region.contains(nodes, 1e-9 * float(size.min())), support.fixed)
    f = np.zeros(nodes.shape)
    np.add.at(f, domain.conn[element], case.carried[:, None] / 4)  # of bilinear functions at the centre
    by_element = np.empty(len(element))
    by_element[element] = case.moduli
    moduli = pymoto.Signal("moduli", by_element)
    material, free = case.body.material, np.where(held, 0.0, f)
    with pymoto.Network() as network:
        K = pymoto.AssembleStiffness(
            domain, bc=np.flatnonzero(held.ravel()), poisson_ratio=material.poisson, plane=material.plane
        )(moduli)
        u = pymoto.LinSolve(symmetric=True, positive_definite=True)(K, free.ravel())
        work = pymoto.EinSum("i,i->")(u, free.ravel())
    if differentiated:
        work.sensitivity = 1.0
        network.sensitivity()
    return domain, element, moduli, u, work

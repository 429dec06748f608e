"""Kratos' material point method: the points, grid, supports and loads of a case, in its own code.

Kratos Multiphysics (BSD-4, github.com/KratosMultiphysics/Kratos) is a general finite element framework; its
MPMApplication moves points through a grid by an updated Lagrangian formulation. The first step from rest of its linear
strategy is small-strain equilibrium.
"""

import json
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import KratosMultiphysics as km
import KratosMultiphysics.LinearSolversApplication  # registers sparse_lu
import KratosMultiphysics.MPMApplication as mpm
import numpy as np
from KratosMultiphysics.MPMApplication.mpm_static_solver import MPMStaticSolver

from mpmtop.arrays import Array, Index
from validation.methods.protocol import Answer, Capability, Case

km.Logger.GetDefaultOutput().SetSeverity(km.Logger.Severity.WARNING)
km.ParallelUtilities.SetNumThreads(1)

SOLVERS: dict[str, dict[str, object]] = {
    "amgcl": {"solver_type": "amgcl", "krylov_type": "cg", "tolerance": 1e-9, "max_iteration": 1000},
    "sparse_lu": {"solver_type": "LinearSolversApplication.sparse_lu"},
}
"""Conjugate gradients with algebraic multigrid, to the residual `mpmtop` is held to; Eigen's SparseLU, the one direct
solver of the wheels that is meant for large systems."""
SMALL = 1e-5
"""Largest displacement, in cells, from which stress is taken, loads acting both ways: what is left of finite strain in
half the difference is of its square, and rounding is 1e-16 of a deformation gradient near one: 1e-11 of the strain."""
LAWS = {
    "strain": mpm.LinearElasticIsotropicPlaneStrain2DLaw,
    "stress": mpm.LinearElasticIsotropicPlaneStress2DLaw,
}
DISPLACEMENT = (km.DISPLACEMENT_X, km.DISPLACEMENT_Y)


@dataclass(eq=False)
class Kratos:
    """A case with tent functions; `linear_solver` is one of SOLVERS, `scale` multiplies all that acts."""

    case: Case
    linear_solver: str = "amgcl"
    scale: float = 1.0
    parts: km.Model = field(init=False)
    solver: MPMStaticSolver = field(init=False)

    def __post_init__(self) -> None:
        settings = {
            "model_part_name": "Body",
            "domain_size": 2,
            "analysis_type": "linear",
            "time_stepping": {"time_step": 1.0},
            "linear_solver_settings": SOLVERS[self.linear_solver],
        }
        self.parts = km.Model()  # meshes by name
        self.solver = MPMStaticSolver(self.parts, km.Parameters(json.dumps(settings)))
        self.solver.AddVariables()
        self._lay_grid()
        self._hang_loads()
        self._seed_points()
        self.solver.PrepareModelPart()
        self.solver.Initialize()
        self._weigh_points()
        self.solver.AdvanceInTime(0.0)
        self.solver.Predict()  # finds the cell of every point
        self.solver.InitializeSolutionStep()
        # else a second solve would take the first one's matrix
        self.solver._GetSolutionStrategy().SetRebuildLevel(1)

    @property
    def _grid(self) -> Any:
        return self.parts["Background_Grid"]

    def _lay_grid(self) -> None:
        """All cells of the grid; node k of `mpmtop` has the number k + 1."""
        grid, part = self.case.grid, self._grid
        i, j = (index.ravel() for index in np.indices(grid.cells))
        corners = np.stack([grid.node_index(i + a, j + b) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1)
        _quadrilaterals(part, grid.node_positions(), corners, part.CreateNewProperties(0))
        self.solver.AddDofs()
        for number, component, _ in self._held():
            part.GetNode(number).Fix(DISPLACEMENT[component])

    def _held(self) -> list[tuple[int, int, float]]:
        """Numbers of held nodes, their components and values, one by one, as Kratos has it."""
        held = self.case.held
        k, component = np.nonzero(held.fixed)
        number = held.node[k, 0] * self.case.grid.nodes[1] + held.node[k, 1] + 1
        return list(zip(number.tolist(), component.tolist(), held.value[k, component].tolist(), strict=True))

    def _hang_loads(self) -> None:
        """Kratos reads loads that are not at nodes from conditions among the grid's, and makes points of them."""
        part = self._grid.CreateSubModelPart("Loads")
        positions, forces = self.case.acts.places(self.case.points.x)
        first = self._grid.NumberOfNodes() + 1
        for k, (x, force) in enumerate(zip(positions.tolist(), (self.scale * forces).tolist(), strict=True)):
            part.CreateNewNode(first + k, *x, 0.0)
            load = part.CreateNewCondition("MPMGridPointLoadCondition2D1N", k + 1, [first + k], part.GetProperties()[0])
            load.Set(km.BOUNDARY, True)
            load.SetValue(mpm.MATERIAL_POINTS_PER_CONDITION, 1)
            load.SetValue(mpm.MPC_IS_NEUMANN, True)
            load.SetValue(mpm.POINT_LOAD, km.Vector([*force, 0.0]))

    def _seed_points(self) -> None:
        """A quadrilateral for the domain of each point, of which Kratos makes one point at its centre."""
        points, material = self.case.points, self.case.body.material
        part = self.parts["Initial_Body"].CreateSubModelPart("Points")
        moduli, kind = np.unique(self.case.moduli, return_inverse=True)
        properties = []
        for k, young in enumerate(moduli.tolist()):
            solid = part.CreateNewProperties(k + 1)
            solid.SetValue(km.YOUNG_MODULUS, young)
            solid.SetValue(km.POISSON_RATIO, material.poisson)
            solid.SetValue(km.CONSTITUTIVE_LAW, LAWS[material.plane]())
            solid.SetValue(km.DENSITY, 1.0)
            solid.SetValue(km.THICKNESS, 1.0)
            solid.SetValue(mpm.MATERIAL_POINTS_PER_ELEMENT, 1)
            properties.append(solid)
        sides = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        # neighbours share corners, as they would in a mesh from a file; complex, as NumPy is slow to sort pairs
        corners = (points.x[:, None] + sides * points.half_length[:, None]) @ (1, 1j)
        position, node = np.unique(corners.round(9), return_inverse=True)
        positions = np.stack([position.real, position.imag], axis=1)
        _quadrilaterals(part, positions, node.reshape(-1, 4), *(properties[k] for k in kind.ravel()))

    def _weigh_points(self) -> None:
        """Body forces as accelerations of points of unit density."""
        if self.case.body_force is None:
            return
        process, part = self._grid.ProcessInfo, self.parts["Body"]
        acceleration = self.scale * self.case.body_force
        for element, b in zip(part.Elements, acceleration.tolist(), strict=True):
            element.SetValuesOnIntegrationPoints(mpm.MP_VOLUME_ACCELERATION, [km.Vector([*b, 0.0])], process)

    def solve(self) -> Array:
        """Displacements (n, 2) of all nodes of the grid, by assembly and one linear solve from rest."""
        nodes = self._grid.Nodes
        variables = km.VariableUtils()
        variables.SetHistoricalVariableToZero(km.DISPLACEMENT, nodes)
        if self.case.prescribed is not None:
            for number, component, value in self._held():
                self._grid.GetNode(number).SetSolutionStepValue(DISPLACEMENT[component], self.scale * value)
        self.solver.SolveSolutionStep()
        u = np.array(variables.GetSolutionStepValuesVector(nodes, km.DISPLACEMENT, 0, 2))
        return u.reshape(-1, 2)[: np.prod(self.case.grid.nodes)]

    def solve_again(self) -> Any:
        """The linear system of the last `solve` once more, without assembly."""
        strategy = self.solver._GetSolutionStrategy()
        matrix, right_side = strategy.GetSystemMatrix(), strategy.GetSystemVector()
        u = km.Vector(matrix.Size1(), 0.0)
        self.solver._GetLinearSolver().Solve(matrix, u, right_side)
        return u

    def at_points(self) -> tuple[Array, Array]:
        """Displacement (p, 2) and stress (p, 3) of the points after a `solve`, which is thereby at its end."""
        self.solver._GetSolutionStrategy().FinalizeSolutionStep()
        process = self._grid.ProcessInfo
        u, stress = (
            np.array(
                [[*element.CalculateOnIntegrationPoints(what, process)[0]] for element in self.parts["Body"].Elements]
            )
            for what in (mpm.MP_DISPLACEMENT, mpm.MP_CAUCHY_STRESS_VECTOR)
        )
        return u[:, :2] / self.scale, stress[:, :3] / self.scale


def _quadrilaterals(part: Any, position: Array, corners: Index, *properties: Any) -> None:
    """Nodes at position (n, 2) and elements of corners (e, 4), numbered from 1: one by one, as Kratos has it; with one
    of the properties each, or all with the same."""
    for k, (x, y) in enumerate(position.tolist(), 1):
        part.CreateNewNode(k, x, y, 0.0)
    of_each = properties if len(properties) == len(corners) else properties * len(corners)
    for k, nodes in enumerate((corners + 1).tolist(), 1):
        part.CreateNewElement("Element2D4N", k, nodes, of_each[k - 1])


@dataclass(frozen=True)
class KratosMethod:
    """Kratos behind the methods' protocol, by its direct solver; compliance is the work of the loads at the points."""

    name: str = "Kratos"
    version: str = f"Kratos MPMApplication {version('KratosMPMApplication')}"
    capabilities: frozenset[Capability] = field(
        default=frozenset(
            {
                *("analysis", "moduli by point", "body forces", "prescribed displacements", "plane stress"),
                *("any outline", "points anywhere", "quadrature at points"),
            }
        )
    )

    def analyse(self, case: Case) -> Answer:
        """By three solves: the first one tells how small the loads must be for `SMALL` strains; see `Analyses`."""
        given = float(np.abs(case.held.value).max(initial=0.0))  # must be small at once; loads act from rest, any size
        first = SMALL * min(case.grid.h) / given if given > 0 else 1.0
        largest = float(np.abs(Kratos(case, "sparse_lu", first).solve()).max()) / first
        if not 0 < largest < np.inf:
            raise ValueError(f"Kratos: the largest displacement is {largest}: check the case's loads")
        scale = SMALL * min(case.grid.h) / largest
        u, stress = (
            (there + back) / 2 for there, back in zip(*(_scaled(case, s) for s in (scale, -scale)), strict=True)
        )
        return Answer(u, stress, float(np.sum(case.carried * u)))


def _scaled(case: Case, scale: float) -> tuple[Array, Array]:
    kratos = Kratos(case, "sparse_lu", scale)
    kratos.solve()
    return kratos.at_points()

"""Kratos' material point method: the same grid, points, supports and loads as a model of `mpmtop`, in its own code.

Kratos Multiphysics (BSD-4, github.com/KratosMultiphysics/Kratos) is a general finite element framework; its
MPMApplication moves points through a grid by an updated Lagrangian formulation. The first step from rest of its linear
strategy is small-strain equilibrium.
"""

import json
from dataclasses import dataclass, field
from typing import Any

import KratosMultiphysics as km
import KratosMultiphysics.LinearSolversApplication  # registers sparse_lu
import KratosMultiphysics.MPMApplication as mpm
import numpy as np
from KratosMultiphysics.MPMApplication.mpm_static_solver import MPMStaticSolver

from mpmtop.arrays import Array, Index
from mpmtop.loads import action
from mpmtop.model import Model, held_dofs

km.Logger.GetDefaultOutput().SetSeverity(km.Logger.Severity.WARNING)
km.ParallelUtilities.SetNumThreads(1)

SOLVERS: dict[str, dict[str, object]] = {
    "amgcl": {"solver_type": "amgcl", "krylov_type": "cg", "tolerance": 1e-9, "max_iteration": 1000},
    "sparse_lu": {"solver_type": "LinearSolversApplication.sparse_lu"},
}
"""Conjugate gradients with algebraic multigrid, to the residual `mpmtop` is held to; Eigen's SparseLU, the one direct
solver of the wheels that is meant for large systems."""


@dataclass(eq=False)
class Kratos:
    """The solid body of `model`, in plane strain with tent functions; `linear_solver` is one of SOLVERS."""

    model: Model
    linear_solver: str = "amgcl"
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
        grid, part = self.model.grid, self._grid
        position = grid.node_positions()
        i, j = (index.ravel() for index in np.indices(grid.cells))
        corners = np.stack([grid.node_index(i + a, j + b) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1)
        _quadrilaterals(part, position, corners, part.CreateNewProperties(0))
        self.solver.AddDofs()
        held = held_dofs(self.model.body.supports, position, tol=1e-9 * min(grid.h))
        for node, component in np.stack(np.divmod(np.flatnonzero(held), 2), axis=1).tolist():
            part.GetNode(node + 1).Fix((km.DISPLACEMENT_X, km.DISPLACEMENT_Y)[component])

    def _hang_loads(self) -> None:
        """Kratos reads loads that are not at nodes from conditions among the grid's, and makes points of them."""
        model, part = self.model, self._grid.CreateSubModelPart("Loads")
        x = model.points.x
        positions, forces = action(model.body.loads, x, model.points.volume, 1e-9 * min(model.grid.h)).places(x)
        first = self._grid.NumberOfNodes() + 1
        for k, (x, force) in enumerate(zip(positions.tolist(), forces.tolist(), strict=True)):
            part.CreateNewNode(first + k, *x, 0.0)
            load = part.CreateNewCondition("MPMGridPointLoadCondition2D1N", k + 1, [first + k], part.GetProperties()[0])
            load.Set(km.BOUNDARY, True)
            load.SetValue(mpm.MATERIAL_POINTS_PER_CONDITION, 1)
            load.SetValue(mpm.MPC_IS_NEUMANN, True)
            load.SetValue(mpm.POINT_LOAD, km.Vector([*force, 0.0]))

    def _seed_points(self) -> None:
        """A quadrilateral for the domain of each point, of which Kratos makes one point at its centre."""
        points, material = self.model.points, self.model.body.material
        part = self.parts["Initial_Body"].CreateSubModelPart("Points")
        solid = part.CreateNewProperties(1)
        solid.SetValue(km.YOUNG_MODULUS, material.young)
        solid.SetValue(km.POISSON_RATIO, material.poisson)
        solid.SetValue(km.CONSTITUTIVE_LAW, mpm.LinearElasticIsotropicPlaneStrain2DLaw())
        solid.SetValue(km.DENSITY, 1.0)
        solid.SetValue(km.THICKNESS, 1.0)
        solid.SetValue(mpm.MATERIAL_POINTS_PER_ELEMENT, 1)
        sides = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        # neighbours share corners, as they would in a mesh from a file; complex, as NumPy is slow to sort pairs
        corners = (points.x[:, None] + sides * points.half_length[:, None]) @ (1, 1j)
        position, node = np.unique(corners.round(9), return_inverse=True)
        _quadrilaterals(part, np.stack([position.real, position.imag], axis=1), node.reshape(-1, 4), solid)

    def solve(self) -> Array:
        """Nodal displacements (2a,), numbered as those of `mpmtop`, by assembly and one linear solve from rest."""
        nodes = self._grid.Nodes
        variables = km.VariableUtils()
        variables.SetHistoricalVariableToZero(km.DISPLACEMENT, nodes)
        self.solver.SolveSolutionStep()
        u = np.array(variables.GetSolutionStepValuesVector(nodes, km.DISPLACEMENT, 0, 2))
        return u.reshape(-1, 2)[self.model.transfer.nodes].ravel()

    def solve_again(self) -> Any:
        """The linear system of the last `solve` once more, without assembly."""
        strategy = self.solver._GetSolutionStrategy()
        matrix, right_side = strategy.GetSystemMatrix(), strategy.GetSystemVector()
        u = km.Vector(matrix.Size1(), 0.0)
        self.solver._GetLinearSolver().Solve(matrix, u, right_side)
        return u


def _quadrilaterals(part: Any, position: Array, corners: Index, properties: Any) -> None:
    """Nodes at position (n, 2) and elements of corners (e, 4), numbered from 1: one by one, as Kratos has it."""
    for k, (x, y) in enumerate(position.tolist(), 1):
        part.CreateNewNode(k, x, y, 0.0)
    for k, nodes in enumerate((corners + 1).tolist(), 1):
        part.CreateNewElement("Element2D4N", k, nodes, properties)

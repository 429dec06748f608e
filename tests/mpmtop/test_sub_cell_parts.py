"""Several densities and two materials within one cell, which strains as one: a column in closed form."""

import numpy as np
import pytest

from mpmtop.body import Body, Material, Part, Support
from mpmtop.design import Design
from mpmtop.loads import Traction
from mpmtop.model import discretise
from mpmtop.problem import DesignProblem
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, gimp, tent

INF = np.inf
BOX = Rectangle((0, 0), (2, 3))
WALLS = Support(Rectangle((-INF, -INF), (INF, INF)), (True, False))
FOOT = Support(Rectangle((-INF, -INF), (INF, 0)), (False, True))
PENAL, CONTRAST = 3.0, 1e-6


def constrained(material: Material) -> float:
    """sigma_yy / eps_yy between walls."""
    E, nu = material.young, material.poisson
    return E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))


@pytest.mark.parametrize("function", [tent, gimp], ids=lambda f: f.__name__)
@pytest.mark.parametrize("edge", [1.0, 1.25, 1.5, 2.75])
def test_a_cell_has_the_mean_stiffness_of_what_it_holds(function: ShapeFunction, edge: float) -> None:
    """Rows of 4 x 4 points per cell, each of a density, a material that ends on a line of the grid or within a cell.
    Of a column under a pressure of one C = 2 sum_cells h / mean(M rho^p), and dC/drho_p follows; both to rounding."""
    steel, foam = Material(2.0, 0.2), Material(0.1, 0.4)
    load = Traction(Rectangle((0, 3), (2, 3)), (0.0, -1.0))
    body = Body(BOX, (WALLS, FOOT), (load,), steel, (Part(Rectangle((0, edge), (2, 3)), foam),))
    model = discretise(body, 1.0, 4, function)
    problem = DesignProblem(model, Design(0.5, 0.01, PENAL, CONTRAST))
    y, of_row = model.points.x[:, 1], np.random.default_rng(0).uniform(0.2, 1, 12)
    row = np.floor(y * 4).astype(int)
    rho = of_row[row]
    M = np.where(y < edge, constrained(steel), constrained(foam))
    E = M * (CONTRAST + (1 - CONTRAST) * rho**PENAL)
    cell = np.floor(y).astype(int)
    mean = np.bincount(cell, E) / np.bincount(cell)
    found = problem.analyse(rho)
    assert found.objective == pytest.approx(2 * np.sum(1 / mean), rel=1e-11)
    slope = -2 / mean[cell] ** 2 * M * PENAL * (1 - CONTRAST) * rho ** (PENAL - 1) / np.bincount(cell)[cell]
    np.testing.assert_allclose(problem.density_gradient(found), slope, rtol=1e-9)

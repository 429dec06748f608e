"""Topology optimisation with the implicit material point method: bodies, designs, and how they are optimised.

What is stated, of either solver:
    region          Rectangle, Circle, Polygon, HalfPlane, LevelSet, Union, Intersection, Difference
    loads           PointLoad, RegionLoad, PositionLoad
    body            Body(domain, supports, loads, material), Support, Material
    design          Design(volume_fraction, filter_radius, penal, contrast, rho_min, passive_solid, passive_void)
    criteria        Compliance, PNormStress
    scene           Scene(name, body, design, objective)
    errors          InvalidScene and the others: what cannot be answered, and what to change

How a body is discretised:
    shape_functions tent, gimp, bspline2, bspline3
    points          MaterialPoints, seed; quadtree refines them, grid lies behind them
    model           discretise(body, h, ppc, shape_function) -> Model
    equilibrium     equilibrium(model, moduli): u, strains and adjoints, checked; mechanism names what moves freely
    transfer, voigt, material, b_bar, ghost, stiffness, solvers    what these are made of
    diagnose        what misleads about a body: glued gaps, near-mechanisms, points on grid lines

How a design is optimised:
    problem         design_problem(scene, h, ppc, shape_function) -> DesignProblem; plan(problem) says what is skipped
    objectives, filter, variables                                  value and derivatives; from design to density
    optimizers      optimize(problem, rule), GCMMA, MMA, OptimalityCriteria, continuation

What is shown:
    plot            designs, fields, bodies, histories
    export          VTU files and back
    fields, at_points                                              what both show, in one form

large_deformation   load steps in which points cross cells by themselves

What a script needs of these can be imported from here: `from mpmtop import Body, Design, Scene, optimize`. No name is
loaded before it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpmtop import export as export
    from mpmtop import plot as plot
    from mpmtop.body import Body as Body
    from mpmtop.body import Material as Material
    from mpmtop.body import Support as Support
    from mpmtop.criteria import Compliance as Compliance
    from mpmtop.criteria import PNormStress as PNormStress
    from mpmtop.design import Design as Design
    from mpmtop.loads import PointLoad as PointLoad
    from mpmtop.loads import PositionLoad as PositionLoad
    from mpmtop.loads import RegionLoad as RegionLoad
    from mpmtop.model import discretise as discretise
    from mpmtop.optimizers import GCMMA as GCMMA
    from mpmtop.optimizers import MMA as MMA
    from mpmtop.optimizers import OptimalityCriteria as OptimalityCriteria
    from mpmtop.optimizers import continuation as continuation
    from mpmtop.optimizers import optimize as optimize
    from mpmtop.points import MaterialPoints as MaterialPoints
    from mpmtop.points import seed as seed
    from mpmtop.problem import DesignProblem as DesignProblem
    from mpmtop.problem import design_problem as design_problem
    from mpmtop.problem import plan as plan
    from mpmtop.region import Circle as Circle
    from mpmtop.region import Difference as Difference
    from mpmtop.region import HalfPlane as HalfPlane
    from mpmtop.region import Intersection as Intersection
    from mpmtop.region import LevelSet as LevelSet
    from mpmtop.region import Polygon as Polygon
    from mpmtop.region import Rectangle as Rectangle
    from mpmtop.region import Union as Union
    from mpmtop.scene import Scene as Scene
    from mpmtop.shape_functions import bspline2 as bspline2
    from mpmtop.shape_functions import bspline3 as bspline3
    from mpmtop.shape_functions import gimp as gimp
    from mpmtop.shape_functions import tent as tent

__version__ = "0.1.0"

_FROM = {
    "body": ("Body", "Material", "Support"),
    "design": ("Design",),
    "loads": ("PointLoad", "PositionLoad", "RegionLoad"),
    "model": ("discretise",),
    "optimizers": ("GCMMA", "MMA", "OptimalityCriteria", "continuation", "optimize"),
    "points": ("MaterialPoints", "seed"),
    "problem": ("DesignProblem", "design_problem", "plan"),
    "region": (
        *("Circle", "Difference", "HalfPlane", "Intersection"),
        *("LevelSet", "Polygon", "Rectangle", "Union"),
    ),
    "criteria": ("Compliance", "PNormStress"),
    "scene": ("Scene",),
    "shape_functions": ("bspline2", "bspline3", "gimp", "tent"),
}
_HOME = {name: module for module, names in _FROM.items() for name in names}


def __getattr__(name: str) -> object:
    if name in _HOME:
        return getattr(import_module(f"mpmtop.{_HOME[name]}"), name)
    raise AttributeError(f"module 'mpmtop' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])

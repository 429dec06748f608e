"""Topology optimisation with the implicit material point method: bodies, designs, and how they are optimised.

What is stated, of either solver:
    region          Rectangle, Circle, Polygon, HalfPlane, LevelSet, Union, Intersection, Difference
    curves, outline what bounds them, to act on
    cloud           Cloud, read_cloud: a region of points in a file
    loads           PointLoad, RegionLoad, PositionLoad; Traction, Pressure; BodyForce, Weight
    body            Body(domain, supports, loads, material, parts), Material, Part; Support, EdgeSupport, Spring, Bed
    design          Design(volume_fraction, filter_radius, penal, contrast, rho_min, passive_solid, passive_void, ...),
                    Projection, Mirror: the last two of its fields
    criteria        Compliance, PNormStress, Volume, Displacement; AtMost, AtLeast, Worst;
                    one's own: from a Response, a Sensitivity
    scene           Scene(name, body, design, objective, constraints, cases), LoadCase
    errors          InvalidScene and the others: what cannot be answered, and what to change

How a body is discretised:
    shape_functions tent, gimp, bspline2, bspline3
    points          MaterialPoints, seed; cut, along the outline; quadtree refines, crossing moves them, grid lies
                    behind them
    model           discretise(body, h, ppc, shape_function) -> Model
    equilibrium     equilibrium(model, moduli): u, strains and adjoints, checked; mechanism names what moves freely
    transfer, voigt, material, b_bar, ghost, ties, stiffness, solvers, forces    what these are made of
    diagnose        what misleads about a body: glued gaps, near-mechanisms, points on grid lines

How a design is optimised:
    problem         design_problem(scene, h, ppc, shape_function) -> DesignProblem; cases, fingerprint
    planning        plan(problem) says what is computed, shared and skipped
    objectives      value and derivatives of criteria
    filter, projection, symmetry, variables                        from design to density
    optimizers      optimize(problem, rule), GCMMA, MMA, OptimalityCriteria, continuation

What is shown:
    plot            designs, fields, bodies, histories; scenes, by scene_plot
    export          VTU files and back
    fields, at_points                                              what both show, in one form
    page            what the report's pages and a comparison's have in common

comparison          compare(scene): every method on a scene of one's own, with and without crossing, on one page
large_deformation   load steps in which points cross cells by themselves

What a script needs of these can be imported from here: `from mpmtop import Body, Design, Scene, optimize`. No name is
loaded before it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpmtop import export as export
    from mpmtop import plot as plot
    from mpmtop.body import Bed as Bed
    from mpmtop.body import Body as Body
    from mpmtop.body import EdgeSupport as EdgeSupport
    from mpmtop.body import Material as Material
    from mpmtop.body import Part as Part
    from mpmtop.body import Spring as Spring
    from mpmtop.body import Support as Support
    from mpmtop.cloud import Cloud as Cloud
    from mpmtop.cloud import read_cloud as read_cloud
    from mpmtop.comparison.compare import compare as compare
    from mpmtop.criteria import AtLeast as AtLeast
    from mpmtop.criteria import AtMost as AtMost
    from mpmtop.criteria import Compliance as Compliance
    from mpmtop.criteria import Displacement as Displacement
    from mpmtop.criteria import PNormStress as PNormStress
    from mpmtop.criteria import Response as Response
    from mpmtop.criteria import Sensitivity as Sensitivity
    from mpmtop.criteria import Volume as Volume
    from mpmtop.criteria import Worst as Worst
    from mpmtop.design import Design as Design
    from mpmtop.design import Mirror as Mirror
    from mpmtop.design import Projection as Projection
    from mpmtop.loads import BodyForce as BodyForce
    from mpmtop.loads import PointLoad as PointLoad
    from mpmtop.loads import PositionLoad as PositionLoad
    from mpmtop.loads import Pressure as Pressure
    from mpmtop.loads import RegionLoad as RegionLoad
    from mpmtop.loads import Traction as Traction
    from mpmtop.loads import Weight as Weight
    from mpmtop.model import discretise as discretise
    from mpmtop.optimizers import GCMMA as GCMMA
    from mpmtop.optimizers import MMA as MMA
    from mpmtop.optimizers import OptimalityCriteria as OptimalityCriteria
    from mpmtop.optimizers import continuation as continuation
    from mpmtop.optimizers import optimize as optimize
    from mpmtop.planning import plan as plan
    from mpmtop.points import MaterialPoints as MaterialPoints
    from mpmtop.points import seed as seed
    from mpmtop.problem import DesignProblem as DesignProblem
    from mpmtop.problem import design_problem as design_problem
    from mpmtop.region import Circle as Circle
    from mpmtop.region import Difference as Difference
    from mpmtop.region import HalfPlane as HalfPlane
    from mpmtop.region import Intersection as Intersection
    from mpmtop.region import LevelSet as LevelSet
    from mpmtop.region import Polygon as Polygon
    from mpmtop.region import Rectangle as Rectangle
    from mpmtop.region import Union as Union
    from mpmtop.scene import LoadCase as LoadCase
    from mpmtop.scene import Scene as Scene
    from mpmtop.shape_functions import bspline2 as bspline2
    from mpmtop.shape_functions import bspline3 as bspline3
    from mpmtop.shape_functions import gimp as gimp
    from mpmtop.shape_functions import tent as tent

__version__ = "0.1.0"

_FROM = {
    "body": ("Bed", "Body", "EdgeSupport", "Material", "Part", "Spring", "Support"),
    "design": ("Design", "Mirror", "Projection"),
    "loads": ("BodyForce", "PointLoad", "PositionLoad", "Pressure", "RegionLoad", "Traction", "Weight"),
    "cloud": ("Cloud", "read_cloud"),
    "comparison.compare": ("compare",),
    "model": ("discretise",),
    "optimizers": ("GCMMA", "MMA", "OptimalityCriteria", "continuation", "optimize"),
    "points": ("MaterialPoints", "seed"),
    "planning": ("plan",),
    "problem": ("DesignProblem", "design_problem"),
    "region": (
        *("Circle", "Difference", "HalfPlane", "Intersection"),
        *("LevelSet", "Polygon", "Rectangle", "Union"),
    ),
    "criteria": (
        *("AtLeast", "AtMost", "Compliance", "Displacement", "PNormStress", "Response"),
        *("Sensitivity", "Volume", "Worst"),
    ),
    "scene": ("LoadCase", "Scene"),
    "shape_functions": ("bspline2", "bspline3", "gimp", "tent"),
}
_HOME = {name: module for module, names in _FROM.items() for name in names}


def __getattr__(name: str) -> object:
    if name in _HOME:
        return getattr(import_module(f"mpmtop.{_HOME[name]}"), name)
    raise AttributeError(f"module 'mpmtop' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])

"""One iteration of the same optimisation by each code."""

from functools import partial
from typing import NamedTuple

from mpmtop.problem import design_problem
from validation.bodies.scenes import SPACING, H, cantilever
from validation.measures.timing import cpu_seconds, iteration
from validation.methods.analyser import MOVE
from validation.methods.plain_fem import PlainProblem
from validation.methods.pymoto import PyMoto


class Iteration(NamedTuple):
    """CPU seconds of one iteration, the median of repeats, and the compliance of the design that the last analysed."""

    seconds: float
    compliance: float


def iterations(nx: int, ny: int, repeats: int) -> dict[str, Iteration]:
    """Iterations of each code with nx x ny design variables, taken in turn; the filter's radius is three of them."""
    spacing = SPACING * 80 / nx
    scene = cantilever(radius=3 * spacing)
    steps = {
        "mpmtop": iteration(design_problem(scene, 2 * spacing * H, 2)),
        "pyMOTO": PyMoto(scene, nx, ny, MOVE).step,
        "plain scikit-fem": iteration(PlainProblem(scene, nx, ny)),
    }
    compliance = {}

    def step(code: str) -> None:
        compliance[code] = steps[code]()

    seconds = cpu_seconds({code: partial(step, code) for code in steps}, repeats)
    return {code: Iteration(seconds[code], compliance[code]) for code in steps}

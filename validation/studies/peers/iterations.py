"""One iteration of the same optimisation by each code, and the way to a design by pyMOTO."""

from functools import partial
from time import process_time
from typing import NamedTuple

from mpmtop.points import seed
from mpmtop.problem import design_problem
from validation.bodies.scenes import SPACING, H, cantilever
from validation.measures.timing import cpu_seconds, iteration
from validation.methods.analyser import MOVE
from validation.methods.plain_fem import PlainProblem
from validation.methods.pymoto import PyMoto
from validation.methods.tracks import APART, Kept, Track, judged


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


def pymoto_track(nx: int, ny: int, iterations: int) -> Track:
    """The paper's cantilever and radius by pyMOTO's MMA with nx x ny elements, so many iterations, judged as our runs
    are."""
    began = process_time()
    scene = cantilever()
    peer = PyMoto(scene, nx, ny, MOVE)
    kept: list[Kept] = []
    due = 0.0
    for k in range(iterations + 1):
        compliance = peer.step()
        if k >= due or k == iterations:
            due = APART * k
            kept.append((process_time() - began, k + 1, compliance, peer.element_densities))
    points = seed(scene.body.domain, (SPACING * 80 * H / nx, SPACING * 40 * H / ny))  # along y first, as its elements
    return judged(scene, kept, points.x, points.half_length)

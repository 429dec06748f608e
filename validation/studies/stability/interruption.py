"""Optimisations killed by SIGKILL and resumed: `python -m validation.studies.stability.interruption` prints,
as JSON, which of them were killed before their end, and which ended as the run that was not killed, bit for bit.

Every run is a process of its own, forked from this one, and is killed either by itself at a chosen moment or by this
process after some time.
"""

import json
import os
import signal
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, NoReturn

import numpy as np

from mpmtop.body import Body, Support
from mpmtop.design import Design
from mpmtop.loads import PointLoad
from mpmtop.optimizers import GCMMA, MMA, Iterate, UpdateRule, checkpoint, optimize
from mpmtop.points import seed
from mpmtop.problem import DesignProblem, Evaluation, design_problem
from mpmtop.region import Rectangle
from mpmtop.scene import Scene

RULES: dict[str, UpdateRule] = {"MMA": MMA(), "GCMMA": GCMMA()}
ITERATIONS = 5
AT = [f"{where} {k}" for where in ("after iteration", "half-way through writing", "before renaming") for k in range(5)]
AFTER = [f"{2 + 4 * k} ms from the start" for k in range(5)]
MOMENTS = [*AT, *AFTER]


def interrupted() -> DesignProblem:
    """A cantilever of 5 x 2 cells, its points shifted."""
    domain = Rectangle((0.0, 0.0), (5.0, 2.0))
    clamp = Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)))
    scene = Scene("interrupted", Body(domain, (clamp,), (PointLoad((5.0, 1.0), (0.0, -1.0)),)), Design(0.4, 0.8))
    points = seed(scene.body.domain, (0.5, 0.5)).moved((0.1, 0.05))
    return design_problem(scene, 1.0, points=points)


def last_of(iterates: Iterable[Iterate[Evaluation]]) -> Iterate[Evaluation]:
    """The last one."""
    *_, last = iterates
    return last


def killed(*args: Any, **kwargs: Any) -> NoReturn:
    """End this process as a power cut does."""
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("unreachable: SIGKILL cannot be caught")


def half_written(file: Any, **content: Any) -> NoReturn:
    """Some bytes of an archive, and no more."""
    file.write(b"PK\x03\x04" + bytes(200))
    file.flush()
    killed()


def run_and_die(problem: DesignProblem, rule: UpdateRule, path: Path, moment: str) -> None:
    """The run of a process that is killed at the moment, if it comes to that."""
    where, _, k = moment.rpartition(" ")
    for iterate in optimize(problem, rule, checkpoint=path, max_iterations=ITERATIONS, stop=lambda history: False):
        if k.isdigit() and iterate.iteration == int(k):
            if where == "after iteration":
                killed()
            # the next checkpoint is the one it dies of
            name, instead = ("savez", half_written) if "writing" in where else ("replace", killed)
            setattr(checkpoint.np if name == "savez" else checkpoint.os, name, instead)


class Survival(NamedTuple):
    """Whether a run was killed by SIGKILL before its end, and whether, resumed, it ended as the one that was not."""

    killed: bool
    same: bool


def survives(problem: DesignProblem, rule: UpdateRule, moment: str, whole: Iterate[Evaluation]) -> Survival:
    """A run killed at the moment, and resumed, beside the whole one: design, objective and solves."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.npz"
        hit = forked(partial(run_and_die, problem, rule, path, moment), moment)
        end = last_of(optimize(problem, rule, checkpoint=path, max_iterations=ITERATIONS, stop=lambda history: False))
        left = sorted(file.name for file in Path(folder).iterdir())
    same = np.array_equal(end.x, whole.x) and (end.objective, end.solves) == (whole.objective, whole.solves)
    return Survival(hit, same and left == ["run.npz"])


def forked(run: Callable[[], None], moment: str) -> bool:
    """Run in a child process; where the moment is a time, kill it then. Whether SIGKILL is what ended it."""
    child = os.fork()
    if child == 0:
        try:
            run()
        finally:
            os._exit(0)
    if moment.endswith("ms from the start"):
        time.sleep(1e-3 * int(moment.split()[0]))
        os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    return os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL


def main() -> None:
    problem = interrupted()
    found = {}
    for name, rule in RULES.items():
        whole = last_of(optimize(problem, rule, max_iterations=ITERATIONS, stop=lambda history: False))
        for moment in MOMENTS:
            found[f"{name}|{moment}"] = survives(problem, rule, moment, whole)
    print(json.dumps(found))


if __name__ == "__main__":
    main()

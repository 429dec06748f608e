"""A comparison from end to end: asked, estimated, run or taken from what is kept, judged, told on a page."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace as replace_field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mpmtop.comparison.asked import Asked, ask
from mpmtop.comparison.entries import Comparison, Entry
from mpmtop.comparison.files import replace, table, write_files
from mpmtop.comparison.judging import FINER
from mpmtop.comparison.methods import CANNOT, Prepared, one_method, prepare
from mpmtop.comparison.page import page
from mpmtop.comparison.progress import duration, say
from mpmtop.comparison.runs import STOPS, Run, kept, key_of, label, own_error, run_of, slug
from mpmtop.comparison.verdict import ranked
from mpmtop.errors import InvalidScene
from mpmtop.optimizers.protocols import UpdateRule
from mpmtop.scene import Scene

LARGEST = 2_000_000
"""Points: the largest problem that has been measured."""
FINE = 20_000
"""Points up to which the judge's own error is told: four times the elements of order 2 are as dear as the runs."""
OVERHEAD = 1.5
"""Of an analysis: the update, the filter and the checkpoint, which the estimate does not time."""


class Refused(InvalidScene):
    """A comparison that cannot be made, or would take too long."""


class Compared(NamedTuple):
    """What was found, and the page that tells it."""

    found: Comparison
    page: Path


def compare(
    scene: Scene,
    *,
    h: float | tuple[float, float] | None = None,
    ppc: int = 2,
    methods: Iterable[str] = ("fem", "mpm", "gimp", "bspline2"),
    crossing: Iterable[str] | None = None,
    iterations: int = 300,
    load_steps: int | None = None,
    ghost: float = 0.0,
    rule: UpdateRule | None = None,
    out: Path | str | None = None,
    jobs: int = 1,
    hours: float = 1.0,
) -> Compared:
    """Optimise the scene by each method, with and without crossing, judge all designs by the fine reference, and write
    a page that says which method to use: `out`/index.html, files beside it; `out` is named after the scene if left out.

    On cells of side h, or (hx, hy), with ppc x ppc points, chosen as in `ask` if not given; `methods` are some of fem,
    mpm, gimp, bspline2, bspline3; `crossing` some of "none" and the families of `mpmtop.crossing`, as
    "periodic(4, 0.26)", the first of both unless given. `load_steps` makes it large deformation. `jobs` processes run
    beside each other. Runs are kept in `out`: what was interrupted goes on, what is unchanged is not made again.

    Raises InvalidScene, which says what to change, also where more than so many `hours` are estimated.
    """
    asked = ask(
        scene,
        h=h,
        ppc=ppc,
        methods=methods,
        crossing=crossing,
        iterations=iterations,
        load_steps=load_steps,
        ghost=ghost,
        rule=rule,
    )
    folder = Path(out) if out is not None else Path(f"{_file_name(scene.name)}-compared")
    return write(asked, folder, _from_python(asked), jobs=jobs, hours=hours, live=False)


def _file_name(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name.lower()).strip("-") or "scene"


def _from_python(asked: Asked) -> str:
    crossing = ", ".join(map(repr, asked.crossing))
    hx, hy = asked.h
    h = f"{hx:g}" if np.isclose(hx, hy) else f"({hx:g}, {hy:g})"
    return f"mpmtop.compare(scene, h={h}, methods={asked.methods}, crossing=({crossing},))"


def write(asked: Asked, folder: Path, command: str, *, jobs: int, hours: float, live: bool) -> Compared:
    """Make a comparison and write its page and files into the folder; see `compare`."""
    found = gather(asked, folder / "runs", jobs=jobs, hours=hours, live=live)
    designs = write_files(found, folder / "files")
    path = folder / "index.html"
    replace(path, page(found, designs, command, "files").encode())
    return Compared(found, path)


def gather(asked: Asked, folder: Path, *, jobs: int, hours: float, live: bool) -> Comparison:
    """Run what is not kept, and put all of it together."""
    if asked.points > LARGEST:
        raise Refused(
            f"{asked.points:,} points of spacing {asked.spacing[0]:g}: the largest problem measured has {LARGEST:,}; "
            "give a larger h"
        )
    entries = list(_entries(asked))
    if all(entry.refusal for entry in entries):
        raise InvalidScene(entries[0].refusal)
    paths = {id(e): folder / f"{e.slug}-{key_of(asked, e.prepared)}.npz" for e in entries if e.prepared is not None}
    own = [entry for entry in entries if entry.prepared is not None and not entry.same_as]
    runs = {entry.slug: kept(paths[id(entry)]) for entry in own}
    missing = [entry for entry in own if runs[entry.slug] is None]
    refused: dict[str, str] = {}
    if len(missing) < len(own):
        say(f"{len(own) - len(missing)} of {len(own)} runs are taken from {folder}")
    if missing:
        _estimate(asked, missing, jobs, hours)
        folder.mkdir(parents=True, exist_ok=True)
        for entry, run in _run_all(asked, missing, folder, jobs, live):
            if isinstance(run, str):
                refused[entry.slug] = run
            else:
                runs[entry.slug] = run
    whole = tuple(
        replace_field(e, run=runs.get(e.slug), refusal=refused.get(e.slug, e.refusal)) if e.prepared else e
        for e in entries
    )
    if all(entry.run is None for entry in whole):
        raise InvalidScene(next(entry.refusal for entry in whole))
    return Comparison(asked, whole, _judge_error(Comparison(asked, whole), folder))


def _entries(asked: Asked) -> Iterator[Entry]:
    """Every run that is asked for, prepared or refused; GIMP shares that of MPM where both are one."""
    before: dict[tuple[str, str], Prepared] = {}
    for method, crossing in asked.runs:
        try:
            prepared = prepare(asked, method, crossing)
        except CANNOT as error:
            yield Entry(method, crossing, None, None, refusal=str(error))
            continue
        twin = before.get(("mpm", crossing)) if method == "gimp" else None
        same = "mpm" if twin is not None and one_method(prepared, twin) else ""
        before[method, crossing] = prepared
        yield Entry(method, crossing, prepared, None, same_as=same)


def _estimate(asked: Asked, missing: list[Entry], jobs: int, hours: float) -> None:
    """Say how long it may take at most, by one analysis of each run; Refused if that is too long."""
    seconds = 0.0
    for entry in missing:
        assert entry.prepared is not None
        problem = entry.prepared.problem
        start = time.perf_counter()
        try:
            problem.gradient(problem.evaluate(problem.x0))
        except STOPS:
            continue  # the run says so
        seconds += OVERHEAD * (time.perf_counter() - start) * asked.iterations
    at_most = seconds / min(jobs, len(missing))
    points = len(missing[0].prepared.design_points.x) if missing[0].prepared else 0
    say(
        f"{asked.scene.name}: {len(missing)} runs of {points:,} points, at most {asked.iterations} iterations each: "
        f"about {duration(at_most)} at most on {jobs} process{'es' if jobs > 1 else ''}"
    )
    if at_most > 3600 * hours:
        raise Refused(
            f"about {duration(at_most)} are more than {hours:g} h: give a larger h or fewer iterations or methods, "
            f"or allow it with hours={max(1, round(1.2 * at_most / 3600))} (--hours on the command line)"
        )


def _run_all(
    asked: Asked, missing: list[Entry], folder: Path, jobs: int, live: bool
) -> Iterator[tuple[Entry, Run | str]]:
    """Runs as they end, or why there is none, with their CPU times in a file."""
    import joblib  # a third of a second, and of no use to one process

    times: list[dict[str, object]] = []
    tasks = [(entry.method, entry.crossing) for entry in missing]
    by_task = dict(zip(tasks, missing, strict=True))
    if jobs == 1 or len(tasks) == 1:
        results = (_one(asked, *task, folder, live) for task in tasks)
    else:
        with joblib.parallel_config("loky", inner_max_num_threads=1):
            parallel = joblib.Parallel(n_jobs=min(jobs, len(tasks)), return_as="generator_unordered", batch_size=1)
            results = parallel(joblib.delayed(_one)(asked, *task, folder, live) for task in tasks)
    for method, crossing, run, seconds in results:
        times.append({"run": label(method, crossing), "cpu_seconds": f"{seconds:.2f}"})
        replace(folder.parent / "files" / "times.csv", table(times, ("run", "cpu_seconds")))
        yield by_task[method, crossing], run


def _one(asked: Asked, method: str, crossing: str, folder: Path, live: bool) -> tuple[str, str, Run | str, float]:
    """The run and its CPU time; or why not even the start can be analysed."""
    try:
        return method, crossing, *run_of(asked, method, crossing, folder, live)
    except STOPS as error:
        say(f"{label(method, crossing)}: {error}")
        return method, crossing, str(error), 0.0


def _judge_error(found: Comparison, folder: Path) -> float | None:
    """Of the best design; kept as the runs are."""
    best = ranked(found.found)
    if not best or found.asked.load_steps or found.asked.points > FINE:
        return None
    entry = best[0]
    assert entry.prepared is not None and entry.run is not None
    path = folder / f"judge-{slug(entry.method, entry.crossing)}-{key_of(found.asked, entry.prepared)}.txt"
    if path.exists():
        return float(path.read_text())
    if np.isnan(entry.run.numbers.truth):
        return None
    error = own_error(found.asked, entry.prepared, entry.run, FINER)
    replace(path, repr(error).encode())
    return None if np.isnan(error) else error

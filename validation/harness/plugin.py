"""Fixtures of the studies (`report`, `lock`, `progress`) and the writing of the report at the end of a run."""

import gc
import os
import warnings
from pathlib import Path

# Read once, when NumPy loads its BLAS: two threads gain little on a quiet machine and lose much on a busy one.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")
# Some hundred iterations of an optimiser turn a last bit of a sum into a per mille of the objective. With kernels that
# x86-64 processors have had for ten years the report is the same on all of them, and as fast as with their own.
if "PYTEST_XDIST_WORKER" not in os.environ:  # a worker has those of the run
    _processor = Path("/proc/cpuinfo")
    _older = _processor.exists() and "avx2" not in _processor.read_text("utf-8")
    os.environ["OPENBLAS_CORETYPE"] = "Nehalem" if _older else "Haswell"
    os.environ["NPY_DISABLE_CPU_FEATURES"] = "X86_V4 AVX512_ICL AVX512_SPR"
with warnings.catch_warnings(action="ignore", category=ImportWarning):  # NumPy before 2.4 has other names for them
    import numpy as np  # noqa: F401

import pickle
import re
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import matplotlib as mpl
import matplotlib.style
import pytest
from xdist.scheduler import LoadScopeScheduling

from mpmtop.page.drawing import STYLE
from validation.contents import CONTENTS
from validation.harness import asked, lock, progress
from validation.harness.claims import Tally
from validation.harness.heading import Heading, heading_of
from validation.harness.origin import provenance_of
from validation.harness.pages import Measured, publish
from validation.harness.report import Report
from validation.harness.shared import FOLDER
from validation.harness.store import Ran, Study, headed, marked, merge, read
from validation.harness.timed import merge_timed, read_timed

LONGEST = (
    *("l_bracket", "multi_resolution", "large_deformation", "crossing_l_bracket", "hole", "work_precision"),
    *("sensitivity", "stability", "cantilever", "crossing_cantilever", "tasks", "crossing", "shape_functions"),
    *("codes", "loads_and_supports", "scale", "large_designs"),
)
"""Studies that take more than a fiftieth of a run, by their time, in the order in which they start: processes beside
each other end at about the same time. The brackets stand two apart, so that the second one finds the run they share."""
ROOM = "studies"
"""The folder in which every study has one of its own."""


@dataclass
class Run:
    """One pytest session: the recorders of its tests, and the functions they belong to."""

    started: float = field(default_factory=time.perf_counter)
    files: set[str] = field(default_factory=set)
    headings: dict[Path, Heading] = field(default_factory=dict)
    reports: dict[pytest.Function, Report] = field(default_factory=dict)
    received: list[Ran] = field(default_factory=list)  # from the workers of pytest-xdist
    crashed: set[tuple[Path, str]] = field(default_factory=set)  # module and test that ended a worker
    summary: list[str] = field(default_factory=list)

    def heading(self, folder: Path) -> Heading:
        """The heading of a study's page, read once."""
        if folder not in self.headings:
            self.headings[folder] = heading_of(folder)
        return self.headings[folder]


class ByFolder(LoadScopeScheduling):
    """Modules of one folder go to one process of pytest-xdist: a study's sections share what is costly to compute."""

    def _split_scope(self, nodeid: str) -> str:
        return nodeid.partition("::")[0].rpartition("/")[0]


def pytest_xdist_setupnodes() -> None:
    """Workers keep freed memory: glibc gives arrays of some megabytes back and gets them anew, page by page, at every
    step of an optimiser. Only here, as the largest memory of a run is measured in processes without workers."""
    for limit, size in (("MALLOC_MMAP_THRESHOLD_", 2**25), ("MALLOC_TRIM_THRESHOLD_", 2**32)):
        os.environ.setdefault(limit, str(size))


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByFolder:
    config.option.loadscopereorder = False  # by number of tests, which says nothing of their time
    return ByFolder(config, log)


RUN = pytest.StashKey[Run]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--reports", metavar="DIR", help="folder the validation report is written to (default: reports)")
    parser.addoption("--benchmark", action="store_true", help="run the tests marked `benchmark`, too")
    parser.addoption("--quick", action="store_true", help="skip the tests marked `slow`")
    parser.addoption(
        "--group", metavar="NAME", help="run the studies of one group of the contents only: The paper, ..."
    )
    parser.addoption(
        asked.OPTION,
        action="append",
        metavar="CODE",
        help="put a code through all checks, and run nothing else; may be given again: see validation/codes/README.md",
    )
    parser.addoption(asked.TIMEOUT, type=float, default=60.0, metavar="S", help="seconds for a case by a command (60)")


def pytest_configure(config: pytest.Config) -> None:
    mpl.use("Agg")
    mpl.style.use(STYLE)
    config.stash[RUN] = Run()
    _share(config)
    for fixtures in (asked, lock, progress):
        config.pluginmanager.register(fixtures, fixtures.__name__)


def _share(config: pytest.Config) -> None:
    """A folder for the runs that studies share, new in every session whatever a shell or a session around this one has
    set; a worker takes that of its session."""
    given = getattr(config, "workerinput", {}).get(FOLDER)
    folder = given or tempfile.mkdtemp(prefix="mpmtop-")
    environment = pytest.MonkeyPatch()
    environment.setenv(FOLDER, folder)
    config.add_cleanup(environment.undo)
    if not given:
        config.add_cleanup(partial(shutil.rmtree, folder, ignore_errors=True))


def pytest_configure_node(node: Any) -> None:
    """Tell a worker of pytest-xdist which folder is its session's."""
    node.workerinput[FOLDER] = os.environ[FOLDER]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what was not asked for; what the report recorded of it stays. The longest studies go first."""
    _keep_group(config, items)
    left_out = {
        "benchmark": (not config.getoption("--benchmark", False), "run by --benchmark"),
        "slow": (config.getoption("--quick", False), "slow: left out by --quick"),
    }
    for name, (skipped, reason) in left_out.items():
        for item in items:
            if skipped and item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=reason))
    place = {study: k for k, study in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(study_of(item.path.parent), len(place)))


def pytest_collection_finish() -> None:
    """What is loaded by now lives until the end: the collector of cycles, which would look all of it through again and
    again, leaves it alone."""
    gc.freeze()


def _keep_group(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out all studies but those of the group that was asked for. UsageError if the contents have none such."""
    group = config.getoption("--group", None)
    if group is None:
        return
    if group not in CONTENTS.groups:
        raise pytest.UsageError(f"--group {group!r}: the contents have {', '.join(map(repr, CONTENTS.groups))}")
    asked_for = [study_of(item.path.parent) in CONTENTS.groups[group] for item in items]
    config.hook.pytest_deselected(items=[item for item, kept in zip(items, asked_for, strict=True) if not kept])
    items[:] = [item for item, kept in zip(items, asked_for, strict=True) if kept]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Open the test's recorder before its other fixtures, so that a failing one is seen in the report too."""
    if isinstance(item, pytest.Function) and "report" in item.fixturenames:
        if item.cls is not None:
            raise TypeError(f"{item.name} is a method: a section of the report is a plain function, move it out")
        run = item.config.stash[RUN]
        study = study_of(item.path.parent)
        if not study:
            raise ValueError(f"{item.path} records for the report: move it to a folder of its own in validation/{ROOM}")
        run.heading(item.path.parent)  # before minutes are spent on a page that could not be put together
        benchmark = item.get_closest_marker("benchmark") is not None
        run.reports[item] = report = Report(study, item.function.__name__, run.files, benchmark)
        report.cpu = -_cpu_clock()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    outcome = yield
    reports = item.config.stash[RUN].reports
    if isinstance(item, pytest.Function) and item in reports and call.excinfo is not None:
        if call.excinfo.errisinstance(pytest.skip.Exception):
            reports[item].skipped = True  # it did not run: what an earlier run recorded stays
        elif not reports[item].ended_by:
            reports[item].ended_by = call.excinfo.typename
    if item in reports:
        reports[item].wall += call.duration
    if call.when == "teardown" and item in reports:
        reports[item].cpu += _cpu_clock()
    if call.when == "teardown" and item in reports and hasattr(item.config, "workeroutput"):
        # test by test, so that a crash of the worker loses no more than the test that made it crash
        outcome.user_properties.append(("ran", pickle.dumps(_ran(item, reports[item]))))
    return outcome


def pytest_runtest_logreport(report: Any) -> None:
    """Take over what a worker of pytest-xdist recorded of a test, or that the test made it crash."""
    node = getattr(report, "node", None)
    if node is None:
        return
    run: Run = node.config.stash[RUN]
    run.received += [pickle.loads(ran) for name, ran in report.user_properties if name == "ran"]
    if report.when == "???":  # pytest-xdist's word for a test whose worker did not come back
        path, _, function = report.nodeid.partition("::")
        run.crashed.add((node.config.rootpath / path, function.partition("[")[0]))


@pytest.fixture
def report(request: pytest.FixtureRequest) -> Report:
    """The section of this test function; parametrised cases append to the same one.

    A run of some cases only leaves the section with those, until the whole function is run again.
    """
    return request.config.stash[RUN].reports[request.node]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Refuse stores that cannot be read before minutes are spent on what could not be added to them."""
    try:
        read(_directory(session.config))
        read_timed(_directory(session.config))
    except ValueError as error:
        raise pytest.UsageError(str(error)) from error


def _directory(config: pytest.Config) -> Path:
    """Where the report is written."""
    return Path(config.getoption("--reports", None) or config.rootpath / "reports").absolute()


def pytest_sessionfinish(session: pytest.Session) -> None:
    run = session.config.stash[RUN]
    known = run.received + [_ran(item, report) for item, report in run.reports.items()]
    ran = sorted((test for test in known if not test.report.skipped), key=lambda test: test.position)
    if hasattr(session.config, "workeroutput") or not (ran or run.crashed):
        return
    directory = _directory(session.config)
    before = read(directory)
    studies = _studies(run, ran, before)
    seen = {test.report.study: test for test in known}  # also of studies of which all was skipped
    studies = [headed(s, run.heading(seen[s.name].folder)) if s.name in seen else s for s in studies]
    reports = [test.report for test in ran]
    provenance = provenance_of(session.config, directory, time.perf_counter() - run.started)
    timed = read_timed(directory)
    commit = re.sub(r"^([0-9a-f]{10})[0-9a-f]*", r"commit \1", provenance["commit"])
    when = f"{provenance['date'][:10]}, {commit}"
    now = merge_timed(timed, reports, studies, provenance["machine"], when, provenance["command"])
    measured = Measured(timed, now, {(report.study, report.test) for report in reports})
    run.summary = [f"report: {directory / 'index.html'}", *_summary(studies, reports, run.crashed)]
    figures: dict[str, bytes] = {}
    for report in reports:
        figures |= {f"figures/{file}": drawn for file, drawn in (report.files | report.opening.files).items()}
        place = "benchmark" if report.benchmark else "timed"
        figures |= {f"{place}/{file}": drawn for file, drawn in report.timed.files.items()}
    publish(directory, list(before.values()), studies, measured, figures, provenance, CONTENTS)


def _summary(studies: Iterable[Study], reports: Iterable[Report], crashed: Iterable[object]) -> list[str]:
    """What ran in this session, and of the rest nothing."""
    ran = {(report.study, report.test) for report in reports}
    readings = [r for study in studies for r in study.readings if (r.study, r.test) in ran]
    tally = Tally.of(readings)
    paper = sum(tally.paper.values(), Counter())
    locks = [lock for report in reports for lock in report.locks]
    failed = len({(report.study, report.test) for report in reports if report.ended_by}) + len(list(crashed))
    return [
        f"{len(readings)} claims of {len({study for study, _ in ran})} studies ran; statements of the paper: "
        f"{paper['agrees']} agree, {paper['by reading']} by reading, {paper['differs']} differ, {paper['not stated']} "
        f"not stated; our checks: {tally.checks['holds']} of {tally.required} hold; locked values: "
        f"{sum(lock.within for lock in locks)} of {len(locks)} within tolerance; sections that failed: {failed}",
    ]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    for line in config.stash[RUN].summary:
        terminalreporter.write_line(line)


def _ran(item: pytest.Function, report: Report) -> Ran:
    position = item.session.items.index(item)
    root = item.config.rootpath
    path = item.path.relative_to(root) if item.path.is_relative_to(root) else item.path
    return Ran(position, item.path.parent, path.as_posix(), item.function.__doc__, report)


def _studies(run: Run, ran: Iterable[Ran], before: Mapping[str, Study]) -> list[Study]:
    """The studies after this run, by name; those whose modules are gone are left out."""
    by_study: dict[str, list[Ran]] = {}
    for test in ran:
        by_study.setdefault(test.report.study, []).append(test)
    seen = {*(test.folder for test in ran), *(module.parent for module, _ in run.crashed)}
    rooms = {_room(folder) for folder in seen}
    present = {study_of(path.parent) for room in rooms if room for path in room.rglob("test_*.py")}
    studies = {name: study for name, study in before.items() if name in present}
    studies |= {name: merge(before.get(name), runs, run.heading(runs[0].folder)) for name, runs in by_study.items()}
    lost = {(study_of(module.parent), test) for module, test in run.crashed}
    return [marked(studies[name], lost) for name in CONTENTS.ordered(studies)]


def study_of(folder: Path) -> str:
    """Name of the page of the study in a folder: `studies/crossing/cantilever` is crossing_cantilever; "" elsewhere."""
    room = _room(folder)
    return "_".join(folder.relative_to(room).parts) if room else ""


def _room(folder: Path) -> Path | None:
    """The innermost folder of studies around a folder."""
    return next((outer for outer in (folder, *folder.parents) if outer.name == ROOM), None)


def _cpu_clock() -> float:
    """CPU seconds of this process and of those it has started and seen end."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system

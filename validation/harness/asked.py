"""`--code`: what is asked of other people's codes, by name, and where their scorecards are kept."""

import platform
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

OPTION, TIMEOUT = "--code", "--code-timeout"


class Asked(NamedTuple):
    """Codes named on the command line, seconds that a command may take for a case, the folder of kept scorecards,
    of which run a new one is, and the page on which it is shown."""

    codes: tuple[str, ...]
    timeout: float
    folder: Path
    when: str
    machine: str
    page: Path
    say: Callable[[str], None]
    """A line on the terminal at the end of the run."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """A run that names codes is of these alone."""
    if config.getoption(OPTION, None):
        theirs = [item for item in items if "asked" in getattr(item, "fixturenames", ())]
        config.hook.pytest_deselected(items=[item for item in items if item not in theirs])
        items[:] = theirs


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What tests said by `Asked.say`, also in other processes."""
    for ended in (*terminalreporter.getreports("passed"), *terminalreporter.getreports("failed")):
        for said in (line for name, line in ended.user_properties if name == OPTION):
            terminalreporter.write_line(str(said))


@pytest.fixture
def asked(request: pytest.FixtureRequest) -> Asked:
    """What `--code` names; scorecards are kept in `data/codes` of the report."""
    config = request.config
    reports = Path(config.getoption("--reports", None) or config.rootpath / "reports").absolute()
    machine = f"{platform.system()} {platform.machine()}"
    today = datetime.now(UTC).date().isoformat()
    named, seconds = tuple(config.getoption(OPTION, None) or ()), float(config.getoption(TIMEOUT, 60.0))
    say = partial(_say, request.node.user_properties)
    return Asked(named, seconds, reports / "data" / "codes", today, machine, reports / "codes.html", say)


def _say(properties: list[tuple[str, object]], line: str) -> None:
    properties.append((OPTION, line))

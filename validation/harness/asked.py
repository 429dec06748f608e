"""`--code`: what is asked of other people's codes, by name, and where their scorecards are kept."""

import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import pytest

OPTION, TIMEOUT = "--code", "--code-timeout"


class Asked(NamedTuple):
    """Codes named on the command line, seconds that a command may take for a case, the folder of kept scorecards, and
    of which run a new one is."""

    codes: tuple[str, ...]
    timeout: float
    folder: Path
    when: str
    machine: str


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """A run that names codes is of these alone."""
    if config.getoption(OPTION, None):
        theirs = [item for item in items if "asked" in getattr(item, "fixturenames", ())]
        config.hook.pytest_deselected(items=[item for item in items if item not in theirs])
        items[:] = theirs


@pytest.fixture
def asked(request: pytest.FixtureRequest) -> Asked:
    """What `--code` names; scorecards are kept in `data/codes` of the report."""
    config = request.config
    reports = Path(config.getoption("--reports", None) or config.rootpath / "reports").absolute()
    machine = f"{platform.system()} {platform.machine()}"
    today = datetime.now(UTC).date().isoformat()
    named, seconds = tuple(config.getoption(OPTION, None) or ()), float(config.getoption(TIMEOUT, 60.0))
    return Asked(named, seconds, reports / "data" / "codes", today, machine)

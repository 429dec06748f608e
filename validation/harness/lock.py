"""Numbers locked beside a study."""

import csv
import re
from collections.abc import Mapping
from typing import Protocol

import numpy as np
import pytest
from pytest_regressions.num_regression import NumericRegressionFixture

from validation.harness.report import Locked, Report


class Lock(Protocol):
    """Compare numbers with those stored beside the study, to a relative tolerance."""

    def __call__(self, numbers: Mapping[str, float], *, rtol: float) -> None: ...


@pytest.fixture
def lock(num_regression: NumericRegressionFixture, request: pytest.FixtureRequest, report: Report) -> Lock:
    """Regression of numbers, by name, against the CSV in the study's folder `locks`; made anew by --force-regen. Drift
    and tolerance go to the report before a difference ends the test."""

    def check(numbers: Mapping[str, float], *, rtol: float) -> None:
        absent = [name for name, number in numbers.items() if not np.isfinite(number)]
        if absent:
            raise ValueError(f"cannot lock {', '.join(absent)}: not finite")
        stored = request.path.parent / "locks" / (re.sub(r"\W", "_", request.node.name) + ".csv")
        renewed = request.config.getoption("force_regen") or request.config.getoption("regen_all")
        if stored.exists() and not renewed:
            # num_regression compares the columns it is given and passes over one that is no longer computed
            with stored.open(encoding="utf-8", newline="") as lines:
                (row,) = csv.DictReader(lines)
            held = {name: float(number) for name, number in row.items() if name}
            report.locks += [Locked(name, held[name], float(numbers[name]), rtol) for name in numbers if name in held]
            others = f"other numbers than {stored.name} holds: rerun with --force-regen if meant"
            assert set(numbers) == set(held), others
        num_regression.check(
            {name: np.array([number]) for name, number in numbers.items()},
            fullpath=stored,
            default_tolerance={"atol": 0.0, "rtol": rtol},
        )

    return check

"""How far a long iteration has got: whole lines, the same on a terminal, in a log and under pytest-xdist."""

import os
import time
from collections.abc import Iterable, Iterator
from typing import Protocol, TextIO, TypeVar

import pytest

Item = TypeVar("Item")
EVERY = 20.0
"""Least seconds between two lines of an iteration: short ones print none, the longest a few dozen."""
PRINTED = pytest.StashKey[TextIO]()


class ShowProgress(Protocol):
    """Iterate as before, printing label, iteration and elapsed seconds now and then."""

    def __call__(self, iterator: Iterable[Item], label: str) -> Iterator[Item]: ...


def pytest_configure(config: pytest.Config) -> None:
    """Keep standard error as it is before tests are captured."""
    config.stash[PRINTED] = os.fdopen(os.dup(2), "w", encoding="utf-8")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Give it back."""
    config.stash[PRINTED].close()


@pytest.fixture(scope="session")
def progress(pytestconfig: pytest.Config) -> ShowProgress:
    """Count a long iteration: `for design in progress(optimise(scene), "cantilever")`."""
    return Counter(pytestconfig.stash[PRINTED])


class Counter:
    """Iterations counted on a stream."""

    def __init__(self, printed: TextIO) -> None:
        self.printed = printed

    def __call__(self, iterator: Iterable[Item], label: str) -> Iterator[Item]:
        start = last = time.perf_counter()
        for done, item in enumerate(iterator, 1):
            now = time.perf_counter()
            if now - last >= EVERY:
                # below the dots that pytest has printed, and in one write
                self.printed.write(f"\n{label}: iteration {done}, {now - start:.0f} s\n")
                self.printed.flush()
                last = now
            yield item

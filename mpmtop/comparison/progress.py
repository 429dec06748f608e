"""How far a run has come: whole lines, now and then on a terminal, one for each run in a log."""

import sys
import time
from dataclasses import dataclass, field
from typing import Any

from mpmtop.page.numbers import number

EVERY = 2.0
"""Least seconds between two lines of a run on a terminal."""


def say(text: str) -> None:
    """One line on standard error, in one write, so that lines of several processes stay whole."""
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def duration(seconds: float) -> str:
    """Seconds, minutes or hours, in words."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@dataclass
class Progress:
    """Tells of the iterates of one run; `live` on a terminal."""

    label: str
    iterations: int
    live: bool
    first: int | None = None
    start: float = field(default_factory=time.perf_counter)
    last: float = field(default_factory=time.perf_counter)

    def __call__(self, iterate: Any) -> None:
        """An iterate was made."""
        now = time.perf_counter()
        self.first = iterate.iteration if self.first is None else self.first
        done = iterate.iteration - self.first
        if self.live and done and now - self.last >= EVERY:
            left = (now - self.start) / done * (self.iterations - iterate.iteration)
            say(
                f"{self.label}: iteration {iterate.iteration}, objective {number(iterate.objective, 5)}, "
                f"at most {duration(left)} left"
            )
            self.last = now

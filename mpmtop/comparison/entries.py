"""What a comparison found, run by run, in one form for the page, the files and the lock."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpmtop.comparison.asked import METHODS, NONE, Asked
from mpmtop.comparison.methods import Prepared
from mpmtop.comparison.runs import Run, label, slug
from mpmtop.criteria import Compliance, Displacement, PNormStress, Volume, Worst
from mpmtop.scene import Scene


@dataclass(frozen=True, eq=False)
class Entry:
    """A method under a crossing: its run, or the `refusal` that says why there is none.

    `same_as` names the method whose equations are the same here: it shares that one's run.
    """

    method: str
    crossing: str
    prepared: Prepared | None
    run: Run | None
    refusal: str = ""
    same_as: str = ""

    @property
    def label(self) -> str:
        """In words."""
        return label(self.method, self.crossing)

    @property
    def slug(self) -> str:
        """As the name of a file; of a shared run its owner's."""
        return slug(self.same_as or self.method, self.crossing)


@dataclass(frozen=True, eq=False)
class Comparison:
    """All entries of what was asked, in its order, and the judge's own error, None where it was not asked."""

    asked: Asked
    entries: tuple[Entry, ...]
    judge_error: float | None = None

    @property
    def found(self) -> list[Entry]:
        """Those that have a run of their own."""
        return [entry for entry in self.entries if entry.run is not None and not entry.same_as]

    def under(self, crossing: str) -> list[Entry]:
        """Entries with a run, shared ones too, under a crossing."""
        return [entry for entry in self.entries if entry.run is not None and entry.crossing == crossing]

    def seeded(self, method: str) -> Entry | None:
        """The method with its points as seeded, if it has a run."""
        return next((entry for entry in self.under(NONE) if entry.method == method), None)


def measure(scene: Scene) -> str:
    """What the objective is, in words."""
    objective = scene.objective
    if isinstance(objective, Worst):
        return f"worst {_of(objective.criterion)}"
    weighted = len(scene.cases) > 1 and not isinstance(objective, Volume)
    return f"weighted {_of(objective)}" if weighted else _of(objective)


def _of(criterion: object) -> str:
    match criterion:
        case Compliance():
            return "compliance"
        case PNormStress():
            return "p-norm of stress"
        case Volume():
            return "volume"
        case Displacement():
            return "displacement"
    return type(criterion).__name__


def relative(value: float, to: float) -> float:
    """Change of a value relative to another one's size; positive is worse, as objectives are minimised."""
    return (value - to) / abs(to) if to else float(np.nan)


def named(entries: Sequence[Entry]) -> str:
    """Methods in words: "MPM, GIMP and FEM"."""
    return listed([METHODS[entry.method] for entry in entries])


def listed(words: Sequence[str]) -> str:
    """Words in a row, the last two joined by "and"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"

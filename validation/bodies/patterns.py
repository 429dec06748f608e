"""Patterns of crossing drawn where they are used: what moves, how far, and which points change their cell."""

from collections.abc import Sequence

from mpmtop.comparison.pictures import patterns
from mpmtop.crossing import Crossing, Wave, moved
from validation.bodies.manufactured import DeformedWave
from validation.harness.report import Recorder


def define(page: Recorder, crossings: Sequence[Crossing], name: str = "patterns") -> None:
    """Record the strip of the patterns that a page uses, each with its words."""
    words = "; ".join(f"`{crossing}`: {in_words(crossing)}" for crossing in crossings)
    page.figure(
        name,
        patterns(crossings),
        f"The patterns of crossing on this page. Hollow: where points were seeded; blue: moved; orange: moved into "
        f"another cell. {words}.",
    )


def in_words(crossing: Crossing) -> str:
    """What the pattern does, to stand after its name."""
    if isinstance(crossing, DeformedWave):
        wave = Wave(crossing.period, crossing.amplitude)
        return f"{in_words(wave)}, the domains with them so that they tile the body"
    return moved(crossing).removeprefix("With ")

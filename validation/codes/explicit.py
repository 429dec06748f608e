"""Codes that step in time, asked for statics: the load is ramped, motion is damped, and what is left of it is reported.

A code that steps in time has `begin(case)`, a state at rest, and `advance(state, level, steps)`, which makes time steps
under `level` times the case's loads and gives back a `Motion`. How it damps is its own: by a viscous force, or by
stopping whenever the kinetic energy has passed a peak. `relaxed` makes of it a code with `analyse`.

The load rises along a half cosine, which excites no mode much that is faster than the ramp is long. Afterwards the
body swings about its equilibrium with a kinetic energy T that falls as the damping has it; with the strain energy W,
displacements are off by about sqrt(T / W) of themselves, as both are quadratic. A body that is damped so much that it
creeps has next to no kinetic energy on its way: displacements must have come to rest, too.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import NotConverged
from validation.methods.protocol import Answer, Capability, Case, Method


class Motion(NamedTuple):
    """Displacement u (p, 2) and stress (p, 3) of the points, kinetic and strain energy, at one time."""

    u: Array
    stress: Array
    kinetic: float
    stored: float


class Explicit(Method, Protocol):
    """A code that steps in time."""

    def begin(self, case: Case) -> Any:
        """A state at rest, unloaded."""
        ...

    def advance(self, state: Any, level: float, steps: int) -> Motion:
        """Time steps under `level` times the loads, in place; the motion at their end."""
        ...

    def end(self, state: Any) -> None:
        """The state is not needed any more, whatever came of it."""
        ...


@dataclass(frozen=True)
class Relaxed:
    """An explicit code as one of statics: see `relaxed`."""

    code: Explicit
    accuracy: float
    ramp: int
    block: int
    blocks: int

    @property
    def name(self) -> str:
        """The code's."""
        return self.code.name

    @property
    def version(self) -> str:
        """The code's."""
        return self.code.version

    @property
    def capabilities(self) -> frozenset[Capability]:
        """The code's; a gradient, where it has one, is not passed on."""
        return frozenset(self.code.capabilities) & frozenset(STATICS)

    def analyse(self, case: Case) -> Answer:
        """Ramp, then steps in blocks until neither sqrt(T / W) nor the change of the displacements over a block, by the
        largest, has been above a tenth of the accuracy for two of them.

        Raises NotConverged, which says what was left, after as many blocks as were allowed.
        """
        state = self.code.begin(case)
        try:
            return self._settled(case, state)
        finally:
            self.code.end(state)

    def _settled(self, case: Case, state: Any) -> Answer:
        for k in range(1, self.ramp + 1):
            motion = self.code.advance(state, float(1 - np.cos(np.pi * k / self.ramp)) / 2, self.block)
        calm, left = 0, np.inf
        for _ in range(self.blocks):
            before, motion = motion.u, self.code.advance(state, 1.0, self.block)
            left = _left(motion, before)
            calm = calm + 1 if left <= 0.1 * self.accuracy else 0
            if calm == 2:
                return Answer(motion.u, motion.stress, kinetic=motion.kinetic / motion.stored)
        raise NotConverged(
            f"{case.name}: sqrt(kinetic / strain energy), or the change over a block, is {left:.1e} after "
            f"{self.ramp + self.blocks} blocks of {self.block} steps, and should be {0.1 * self.accuracy:.1e}: damp "
            "otherwise, allow more blocks, or ask for less"
        )


STATICS: tuple[Capability, ...] = (
    *("analysis", "quadrature at points", "moduli by point", "body forces", "loads at positions"),
    *("prescribed displacements", "plane stress", "any outline", "points anywhere"),
)


def _left(motion: Motion, before: Array) -> float:
    """The larger of sqrt(T / W) and the change of the displacements from `before`: about their relative error.

    Infinite where it blows up.
    """
    largest = np.abs(motion.u).max()
    if not (np.isfinite(motion.kinetic) and motion.stored > 0 and largest > 0):
        return float("inf")
    change = np.abs(motion.u - before).max() / largest
    return float(max(np.sqrt(motion.kinetic / motion.stored), change))


def relaxed(code: Explicit, accuracy: float = 1e-4, *, ramp: int = 20, block: int = 100, blocks: int = 200) -> Relaxed:
    """The explicit code as one of statics, to a relative accuracy, which its scorecard states.

    `ramp` blocks of `block` time steps each take the load up, and `blocks` at most follow. Take a ramp of a few periods
    of the body's slowest mode: the shorter it is, the longer the damping takes afterwards.
    """
    if not 0 < accuracy < 1 or min(ramp, block, blocks) < 1:
        raise ValueError(f"accuracy {accuracy}, {ramp} + {blocks} blocks of {block} steps: give positive numbers")
    return Relaxed(code, accuracy, ramp, block, blocks)

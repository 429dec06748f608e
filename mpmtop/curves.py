"""Curves that the outlines of regions are made of: straight lines and circles, over a parameter t from 0 to 1."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mpmtop.arrays import Array, Mask


class Curve(Protocol):
    """A smooth piece of an outline."""

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Position (n, 2), unit normal (n, 2), of either sign, and length by t (n,), at parameters t (n,)."""
        ...

    def cuts(self, axis: int, values: Array) -> Array:
        """Parameters (k,) at which the coordinate along `axis` takes one of the values (m,)."""
        ...

    def holds(self, x: Array, tol: float) -> Mask:
        """Which of the positions x (n, 2) are no further than `tol` from the curve: (n,)."""
        ...


@dataclass(frozen=True)
class Line:
    """From `start` to `end`."""

    start: tuple[float, float]
    end: tuple[float, float]

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """See `Curve`."""
        along = np.subtract(self.end, self.start)
        length = np.hypot(*along)
        normal = np.array([along[1], -along[0]]) / length
        # by both ends, so that each is met exactly
        x = np.outer(1 - t, self.start) + np.outer(t, self.end)
        return x, np.tile(normal, (len(t), 1)), np.full(len(t), length)

    def cuts(self, axis: int, values: Array) -> Array:
        """See `Curve`; none along a line across the axis."""
        along = self.end[axis] - self.start[axis]
        t = (values - self.start[axis]) / along if along != 0 else np.empty(0)
        return t[(t > 0) & (t < 1)]

    def holds(self, x: Array, tol: float) -> Mask:
        """See `Curve`."""
        along, arm = np.subtract(self.end, self.start), x - self.start
        t = np.clip(arm @ along / (along @ along), 0, 1)
        return np.hypot(*(arm - t[:, None] * along).T) <= tol


@dataclass(frozen=True)
class Round:
    """All of a circle."""

    centre: tuple[float, float]
    radius: float

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """See `Curve`; t = 0 is the circle's rightmost position."""
        normal = np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)], axis=1)
        return self.centre + self.radius * normal, normal, np.full(len(t), 2 * np.pi * self.radius)

    def cuts(self, axis: int, values: Array) -> Array:
        """See `Curve`."""
        cosine = (values - self.centre[axis]) / self.radius
        angle = np.arccos(cosine[np.abs(cosine) <= 1]) / (2 * np.pi)
        return (
            np.concatenate([angle, -angle]) % 1.0 if axis == 0 else np.concatenate([0.25 - angle, 0.25 + angle]) % 1.0
        )

    def holds(self, x: Array, tol: float) -> Mask:
        """See `Curve`."""
        return np.abs(np.hypot(*(x - self.centre).T) - self.radius) <= tol

"""What tells problems apart: numbers and words, the same on every machine."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from mpmtop.arrays import Array


def words(stated: Any) -> tuple[Any, ...]:
    """Class and fields of something stated, to be hashed by their `repr`: numbers as floats, and so on inwards.

    What is neither a number, a word, a tuple nor a dataclass is told by its class alone: its `repr` may be a place in
    memory.
    """
    if is_dataclass(stated):
        of = ((field.name, words(getattr(stated, field.name))) for field in fields(stated))
        return (type(stated).__name__, *of)
    if isinstance(stated, tuple | list):
        return tuple(words(each) for each in stated)
    if isinstance(stated, str) or stated is None:
        return (stated,)
    if isinstance(stated, int | float | np.number | np.bool_):
        return (float(stated),)
    if isinstance(stated, np.ndarray):
        return tuple(np.ravel(stated).tolist())
    return (type(stated).__name__,)


def digits(numbers: Array) -> Array:
    """Integers that tell numbers apart to 2^-24 of the largest one, and that one's exponent; not their last bits.

    The exponent is that of a number larger by 1e-9, so that a power of two and a bit less have the same.
    """
    largest = float(np.max(np.abs(numbers), initial=0.0))
    exponent = int(np.frexp(largest * (1 + 1e-9))[1])
    return np.append(np.rint(np.ldexp(numbers.ravel(), 24 - exponent)), exponent)

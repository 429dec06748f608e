"""The list of all checks of a shape function: bounds with their reasons, and where to look."""

from functools import partial
from typing import Any

from validation.codes import shape
from validation.codes.card import Check
from validation.codes.shape import ORIGINS, ROUNDING
from validation.methods.protocol import Capability

SHAPE: frozenset[Capability] = frozenset({"shape functions"})
SUMS = "sums of a few products near one, rounded"


def check(name: str, observe: Any, why: str, look: str, at_most: float | None = None) -> Check:
    """One of a shape function."""
    return Check("shape function", name, SHAPE, observe, why, look, at_most)


def checks() -> list[Check]:
    """In the order in which a failure is best looked at."""
    return [*_fields(), *_places(), *_images()]


def _fields() -> list[Check]:
    return [
        check("unity", shape.unity, SUMS, "a branch of N, or a node that is left out", ROUNDING),
        check(
            "reach across cells",
            shape.reach,
            f"{SUMS}; two of them",
            "the stencil: a domain that crosses a grid line has nodes of both cells; are those beyond the point's own "
            "cell cut off, or is half_length taken for the whole length?",
            2 * ROUNDING,
        ),
        check(
            "sum of gradients",
            shape.gradient_sum,
            f"{SUMS}, gradients up to ten per cell",
            "the sign of one branch of the gradient, or a node that is left out",
            10 * ROUNDING,
        ),
        check(
            "linear fields",
            partial(shape.completeness, h=(1.0, 1.0)),
            f"{SUMS}, times node positions up to ten",
            "gradients, if values are right: their size; the node that a weight is given to",
            10 * ROUNDING,
        ),
        check(
            "linear fields on oblong cells",
            partial(shape.completeness, h=(0.25, 2.0)),
            f"{SUMS}, times node positions up to ten and gradients up to four",
            "gradients per cell in place of per length, or one cell size for both axes",
            100 * ROUNDING,
        ),
        check(
            "gradient is the derivative of N",
            shape.derivative,
            "a difference quotient of step 1e-5 cells is right to 1e-11 for cubics, and rounded to 1e-11",
            "the branch that is named; functions whose gradients are not meant as derivatives (diffuse MLS) fail by "
            "construction",
            1e-8,
        ),
    ]


def _places() -> list[Check]:
    return [
        *(
            check(
                f"origin {name}",
                partial(shape.origin, name=name),
                "eps |x| / h, 2e-10 a million cells away, times second derivatives up to ten, and room",
                "where a position is turned into a cell: (x - origin) / h, along both axes",
                1e-8 if "1e6" in name else 1e-11,
            )
            for name in ORIGINS
        ),
        check(
            "points on and beside grid lines",
            shape.near_lines,
            SUMS,
            "floor of a position on a line, or 1e-12 before it: cell and local coordinate must go together",
            10 * ROUNDING,
        ),
        check(
            "grid lines belong to one side",
            shape.convention,
            "a cell is half-open: either side will do, the same along both axes",
            "floor along one axis and ceil - 1, or round, along the other; an inequality that holds equality twice",
            0.0,
        ),
        check(
            "jump of N at a grid line",
            partial(shape.jump, what=slice(0, 1)),
            "a move of 2e-9 cells, times gradients up to ten",
            "two branches that do not meet",
            1e-7,
        ),
        check(
            "jump of grad N at a grid line",
            partial(shape.jump, what=slice(1, 3)),
            "the tent's jumps by two per cell, which is the crossing error",
            "",
        ),
    ]


def _images() -> list[Check]:
    return [
        *(
            check(
                name,
                partial(shape.symmetry, turn=turn),
                f"{SUMS}: no point lies on a line",
                "a branch that treats left and right, or the axes, in two ways",
                10 * ROUNDING,
            )
            for name, turn in (("mirror image", shape.mirrored), ("quarter turn", shape.turned))
        ),
        check(
            "one by one as all together",
            shape.one_by_one,
            "the same operations on the same numbers, but for the order of sums",
            "state kept from point to point, or one point's size taken for all",
            ROUNDING,
        ),
    ]

"""The list of all checks of an analysis: bounds with their reasons, and where to look."""

from functools import partial
from typing import Any

import numpy as np

from mpmtop.arrays import Array
from validation.codes import analysis, cases
from validation.codes.analysis import ANALYSIS, EXACT, FAMILIES, ORIGINS, WEIGHT
from validation.codes.card import Check
from validation.methods.protocol import Capability

IDENTITY = "an identity: condition numbers below 1e5, rounding 1e-16, two digits left"
FORMULA = "the same numbers in another frame: rounding only"


def _exact(
    name: str,
    observe: Any,
    look: str,
    why: str = IDENTITY,
    at_most: float = EXACT,
    needs: frozenset[Capability] = ANALYSIS,
) -> Check:
    return Check("analysis", name, needs, observe, why, look, at_most=at_most, rounding=True)


def _backwards(v: Array) -> Array:
    """By a quarter, the other way."""
    return np.stack([v[..., 1], -v[..., 0]], -1)


def checks() -> list[Check]:
    """In the order in which a failure is best looked at."""
    return [*_fields(), *_frames(), *_energies(), *_accuracy(), *_moved()]


def _fields() -> list[Check]:
    shear = "the stress that is given: of the points, xx, yy, xy, the tensor's shear and not twice that"
    crossing = (
        "also where points are nearer to a grid line than a quarter of a cell, or domains, if there are any, cross it"
    )
    gradients = "the gradients: their sum over the nodes of a point, and times node positions"
    return [
        _exact(
            "rigid motion, uniform points",
            partial(analysis.rigid, name="rigid motion", points=None),
            f"prescribed displacements off zero; then {gradients}",
        ),
        _exact(
            "rigid motion, uneven points",
            partial(analysis.rigid, name="rigid motion, uneven points", points=cases.uneven((6, 4))),
            f"{gradients}, {crossing}",
        ),
        _exact(
            "rigid motion, points on grid lines",
            analysis.on_lines,
            "which cell a point on a grid line belongs to, and whether its gradients are of the same cell",
        ),
        _exact(
            "patch test, uniform points",
            partial(analysis.patch, name="patch test", points=None),
            "volumes; the law (plane strain, engineering shear); supports on nodes that no point touches",
        ),
        Check(
            "analysis",
            "patch test, uneven points",
            ANALYSIS,
            analysis.uneven_patch,
            "volumes that do not follow the points integrate no constant exactly, in any of these methods",
            "",
        ),
        *(
            _exact(
                f"mean stress, {what}",
                lambda code, case=case: analysis.mean_stress(code, case),
                look,
                f"the work of what acts on a linear displacement: {IDENTITY}",
            )
            for what, case, look in (
                ("loads on points", cases.cantilever("cantilever"), f"how forces reach the nodes; {shear}"),
                (
                    "loads on uneven points",
                    cases.cantilever("cantilever, uneven points", cases.uneven((12, 6))),
                    f"as for uniform points, {crossing}",
                ),
                ("body forces", cases.under_weight("cantilever under weight"), "V b of each point"),
                (
                    "loads at positions",
                    cases.pulled_at_end("rod pulled at its end"),
                    "functions at a position on the body's last grid line: those of the cell inside",
                ),
            )
        ),
        _exact("two layers, stretched", analysis.layered, "which modulus belongs to which point"),
        _exact("plane stress", analysis.plane_stress, "the law: E / (1 - nu^2) and nu in plane stress"),
    ]


def _frames() -> list[Check]:
    origin = "where a position is turned into a cell: (x - origin) / h, along both axes, for points, loads and supports"
    units = {
        "millimetres and newtons": cases.in_units(1e3, 1.0, 1e-6),
        "micrometres": cases.in_units(1e6, 1.0, 1.0),
        "forces of 1e9, moduli of 2e11": cases.in_units(1.0, 1e9, 2e11),
    }
    return [
        *(_exact(f"origin {name}", partial(analysis.elsewhere, name=name), origin, FORMULA) for name in ORIGINS),
        _exact(
            "1e6 cells from the origin",
            partial(analysis.mapped, name="cantilever, 1e6 cells away", change=cases.moved((1e6, -1e6))),
            origin,
            "positions are rounded to 1e-10 cells there, points a quarter of a cell wide to 1e-9, times a condition "
            "number below 1e3 of moderate changes",
            at_most=1e-6,
        ),
        _exact(
            "mirror image",
            partial(analysis.mapped, name="cantilever in a mirror", change=cases.MIRRORED),
            "a branch that treats left and right in two ways; no point is on a grid line here",
            FORMULA,
        ),
        _exact(
            "quarter turn",
            partial(analysis.mapped, name="cantilever, turned by a quarter", change=cases.TURNED, back=_backwards),
            "the axes: cells that are not counted alike, the order of nodes",
            FORMULA,
        ),
        _exact(
            "points on grid lines, axes exchanged",
            analysis.transposed_on_lines,
            "half-open cells along one axis and the other way round along the other",
            FORMULA,
        ),
        _exact(
            "points in another order", analysis.reordered, "order of answers; state kept from point to point", FORMULA
        ),
        *(
            _exact(
                name,
                partial(analysis.mapped, name=f"cantilever in {name}", change=change),
                "a tolerance or a penalty that is a length, a force or a stiffness; a mass or damping left in statics",
                FORMULA,
            )
            for name, change in units.items()
        ),
        _exact(
            "twice the load",
            analysis.doubled,
            "finite strain or rotation: make loads small, and answers large again; an iteration ended too early",
            FORMULA,
        ),
    ]


def _energies() -> list[Check]:
    lost = (
        "stress at points that is not the one in the internal force; how forces on points reach the nodes, "
        "sum_p N_i(x_p) f_p; an iteration ended too early; numerical damping"
    )
    return [
        _exact(
            "Betti's reciprocity",
            analysis.reciprocal,
            "how forces on points reach the nodes, sum_p N_i(x_p) f_p with the N that takes displacements back to the "
            "points; a stiffness that is not symmetric",
        ),
        _exact(
            "energy balance, uniform points",
            lambda code: analysis.balance(code, cases.under_weight("cantilever under weight")),
            lost,
            needs=ANALYSIS | {"quadrature at points"},
        ),
        _exact(
            "energy balance, uneven points",
            lambda code: analysis.balance(
                code, cases.under_weight("cantilever under weight, uneven points", cases.uneven((12, 6)))
            ),
            lost,
            needs=ANALYSIS | {"quadrature at points"},
        ),
        Check(
            "analysis",
            "residual kinetic energy",
            ANALYSIS,
            analysis.kinetic,
            "by the strain energy, of codes that step in time: displacements are off by about its root",
            "",
        ),
        _exact("compliance stated", analysis.compliance_stated, "work of half the load, or energy, in place of f . u"),
    ]


def _accuracy() -> list[Check]:
    def check(
        name: str, observe: Any, why: str, look: str, at_most: float | None = None, at_least: float | None = None
    ) -> Check:
        return Check("analysis", name, ANALYSIS, observe, why, look, at_most, at_least)

    half = "whole order of linear functions, less a half for levels that are not yet asymptotic"
    return [
        check(
            "self weight",
            partial(analysis.weighed, unequal=False),
            "h / 4 over the length: constant stress in a cell against a linear one",
            "body force: per volume, times each point's volume",
            at_most=WEIGHT,
        ),
        check(
            "self weight, points of unequal size",
            partial(analysis.weighed, unequal=True),
            "h / 4 over the length, whatever the points' sizes",
            "shares of a body force: by volume, not by number of points",
            at_most=WEIGHT,
        ),
        check(
            "manufactured solution, order of displacement",
            partial(analysis.wave_order, stress=False),
            f"2, the {half}",
            "quadrature: volumes, and the place where a body force acts",
            at_least=1.5,
        ),
        check(
            "manufactured solution, order of stress",
            partial(analysis.wave_order, stress=True),
            f"1, the {half}",
            "the place that a stress is of: the point, not a node",
            at_least=0.5,
        ),
        check(
            "Timoshenko's beam, order of displacement",
            analysis.beam_order,
            f"2, the {half}",
            "locking, where it is much smaller; shear",
            at_least=1.5,
        ),
        check(
            "refinement of the grid",
            analysis.refinement,
            "2 %: 16 cells over the depth of a clamped cantilever, of which bilinear ones miss 1 %, twice that for "
            "the quadrature; and the error falls from level to level",
            "results that change with the grid: a penalty or a load that depends on h",
            at_most=0.02,
        ),
    ]


def _moved() -> list[Check]:
    def report(name: str, observe: Any, why: str) -> Check:
        return Check("analysis", name, ANALYSIS, observe, why, "")

    hair = "loss of the outermost row of cells at both edges, of six: (6 / 5)^3 - 1 is 0.7"
    cut = "a node that hangs on a hair of a point: a threshold on its mass or stiffness, or none where one is needed"
    return [
        *(
            Check(
                "analysis",
                f"{overlap:g} cells over the edge",
                ANALYSIS,
                partial(analysis.small_cut, overlap=overlap),
                hair,
                cut,
                at_most=0.7,
            )
            for overlap in (1e-9, 1e-3)
        ),
        report("points at Gauss points, over bilinear elements", analysis.gauss, "zero for the tent: it is Q1 then"),
        report(
            "jump as one column crosses",
            analysis.column_jump,
            "a move of 2e-4 cells; the tent's jumps by a per cent or so",
        ),
        *(
            report(
                f"compliance, {crossing}, over that as seeded",
                partial(analysis.family, crossing=crossing),
                "what induced crossing does; the body is the same but for the first family",
            )
            for crossing in FAMILIES
        ),
    ]

"""Patterns of crossing beside the paper's four numbers."""

import numpy as np
import pandas as pd
import pytest

from mpmtop.crossing import FAMILIES
from validation import paper
from validation.bodies import scenes
from validation.bodies.sketch import CHOSEN, opening
from validation.bodies.sliced_beam import beam_rises
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.paper import compare, under_a_pattern
from validation.studies.choices import cantilever, patterns
from validation.studies.choices.cantilever import BASES
from validation.studies.choices.patterns import NAMES, said

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

RTOL_ANALYSIS = 1e-6
"""One analysis of a given design, whose rise is a difference of two: condition number 1e5 times rounding 1e-16."""
RTOL_MEAN = 8e-3
"""Of the mean optimum of a family, six members and more: another processor's rounding may take one of them to a
neighbouring optimum, up to 4.5 % away."""
RTOL_TIP = 0.01
"""Of the paper's 13.8 %: its last digit is 0.7 % of it."""


@pytest.mark.slow
def test_tips(report: Report, lock: Lock) -> None:
    """Which pattern of crossing can give both tip displacements, and why

    Every member of every family, by the rise of the solid's tip displacement alone: the paper's are +13.8 % with
    standard MPM and less than 1.8 % with GIMP. **The estimate** is a beam cut into slices of one cell, springs in
    series: a slice that holds the part m of its material is softer by 1/m. Standard MPM counts the points in a slice,
    GIMP what of their domains lies there. Where a column jumps alone (**periodic**) it leaves a gap and makes an
    overlap, and GIMP counts both. Where neighbours move almost alike (**wave**, **bump**) a slice gets as much of the
    domains on one side as it loses on the other, so that GIMP hardly notices, while standard MPM loses a column all the
    same. Under **uniform** there is the lever arm, and the gap at the clamp, which no estimate of slices sees.
    """
    tried = "tried: " + ", ".join(f"{radius:g}" for radius in cantilever.RADII) + " spacings"
    sources = {"load": "tried: the bottom corner, too", "filter radius": tried, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    opening(report, scenes.cantilever(), sources, note="The others are the L-bracket and the plate with a hole.")
    base = BASES[0]
    still = {name: cantilever.tip(base, name) for name in NAMES}
    rows = {
        (family, str(member)): {name: cantilever.tip(base, name, member) / still[name] - 1 for name in NAMES}
        | {f"{name}, beam": rise for name, rise in beam_rises(member).items()}
        for family, members in FAMILIES.items()
        for member in members
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis(["family", "member"])
    standard, gimp = paper.CANTILEVER_CROSSING_TIP_STANDARD, paper.CANTILEVER_CROSSING_TIP_GIMP
    both = (np.abs(table["standard"] / standard.value - 1) <= RTOL_TIP) & (table["GIMP"] <= gimp.value)
    table["meets both"] = np.where(both, "yes", "no")
    percent = [*NAMES, *(f"{name}, beam" for name in NAMES)]
    caption = "Rise of the solid's tip displacement, load at mid-height, and its estimate by a beam in slices."
    report.table("tips", table, caption, 4, percent=percent)
    meeting = [member for _, member in table.index[both]]
    inside = table.drop(index="uniform(s)", level="family")
    alike = {name: float(np.corrcoef(inside[name], inside[f"{name}, beam"])[0, 1]) for name in NAMES}
    whole = inside.loc["periodic(n, 0.26)"]
    report.found(
        f"Of {len(table)} members {len(meeting)} give both tip displacements ({', '.join(meeting) or 'none'}): those "
        "that move neighbours almost alike. A beam in slices, with no fitted number, explains the rises of all "
        f"patterns inside the body (correlation {alike['standard']:.3f} for standard, {alike['GIMP']:.3f} for GIMP). "
        f"Where whole columns jump GIMP's rise is {(whole['GIMP'] / whole['standard']).mean():.2f} of standard's; the "
        "paper's is "
        f"{gimp.value / standard.value:.2f} at most."
    )
    report.so("Induced crossing is as good as its pattern: say how points were moved; bodies move neighbours alike.")
    holds = [
        report.check(
            f"members of any family that give both tip displacements, of {len(table)}: {', '.join(meeting) or 'none'}",
            len(meeting),
            at_least=1,
            source="our reading: 13.8 % to 1 % of it, about its last digit, and at most 1.8 %",
        ),
        *(
            report.check(
                f"rise of the tip displacement and its estimate by a beam in slices, {name}: correlation over all "
                "members but uniform shifts",
                alike[name],
                at_least=0.9,
                source="the reason given",
                why="one that explains four fifths of the variance",
            )
            for name in NAMES
        ),
    ]
    lock({f"{member}, {n}": row[n] for (_, member), row in rows.items() for n in NAMES}, rtol=RTOL_ANALYSIS)
    assert all(holds)


@pytest.mark.benchmark
def test_patterns(report: Report, lock: Lock) -> None:
    """Every pattern beside all four numbers of Sect. 5.2.1

    Tip displacements and optima, standard and GIMP, of every member of every family on both cantilevers: the study's
    own, and the second one, which comes as near to 83.57. **None is picked by what comes out**: the claims below are of
    the second cantilever and of the member of each family whose tip by standard MPM is nearest to 13.8 %, as the study
    of crossing has them for the first; the rest of the table says what else there is. An optimum counts as met within
    its own scatter over rules and starts, which on the second cantilever is wide.
    """
    found, still = patterns.computed(BASES)
    patterns.tabulate(report, found, still)
    patterns.draw(report, found)
    for base in BASES[1:]:  # those of the first are claims of the study of crossing
        for family in FAMILIES:
            compare_calibrated(report, found, base, family, still[base])
    for base in BASES:
        of_base = {member: numbers for (b, _, member), numbers in found.items() if b == base}
        nearest = min(of_base, key=lambda member: of_base[member].distance)
        report.check(
            f"least distance to the paper's four numbers, root mean square; {said(base)}: {nearest}",
            of_base[nearest].distance,
            source="for comparison",
            unit="%",
        )
    lock(
        {
            f"{base.load}, {family}, {name}: mean": float(np.mean([getattr(n, field) for n in of]))
            for base in BASES
            for family in FAMILIES
            for of in [[n for (b, f, _), n in found.items() if (b, f) == (base, family)]]
            for name, field in zip(NAMES, ("standard", "gimp"), strict=True)
        },
        rtol=RTOL_MEAN,
    )


def compare_calibrated(
    report: Report, found: patterns.Patterns, base: cantilever.Base, family: str, still: float
) -> None:
    """The numbers of a family's calibrated member as claims."""
    member = patterns.calibrated(found, base, family)
    numbers = found[base, family, member]
    beam = beam_rises(member)
    reason = (
        f"a beam in slices rises by {beam['standard']:.1%} (standard) and {beam['GIMP']:.1%} (GIMP) under it; which "
        "patterns give the paper's numbers is in the table"
    )
    rise, final = (dict(zip(NAMES, pair, strict=True)) for pair in (numbers[:2], numbers[2:]))
    scatter = paper.OPTIMUM_SCATTER[f"cantilever, {base.load}"]
    compare(report, under_a_pattern(f"{member}; {said(base)}", rise, final, still, scatter, reason))

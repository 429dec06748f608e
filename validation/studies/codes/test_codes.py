"""Codes: one scorecard for each

Every code is asked the same checks: of its shape functions, an analysis, a gradient and load steps, as far as it is
capable of them. Bounds are set by what must hold, with the reason beside each, and not by what a code gave. Another
person's code is put through by `pytest validation --code`, see validation/codes/README.md; what it answered is kept
with date, version and machine. What fails there is a result: it fails no run.
"""

import gc
from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from validation.codes.card import Card, Check, Verdict, scorecard
from validation.codes.checks import every
from validation.codes.kept import Kept, cell, kept, matrix, read, told, write
from validation.codes.named import KEPT, KNOWN, code
from validation.harness.asked import Asked
from validation.harness.report import Report
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.methods.elements import ElementMethod
from validation.methods.plain_fem import PlainFem
from validation.methods.points import PointMethod
from validation.methods.protocol import Method

ASKED = "Which codes do what any code must, and where does one that does not go wrong?"


def ours() -> list[Method]:
    """The codes of this repository."""
    return [*(PointMethod(name, function) for name, function in SHAPE_FUNCTIONS.items()), ElementMethod(), PlainFem()]


def grounds(checks: list[Check]) -> pd.DataFrame:
    """Why each check must hold, and where to look if it does not."""
    rows = {
        f"{c.way}: {c.name}": {"expected": c.expected, "why": c.why, "if it fails, look at": c.look} for c in checks
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("check")


SHORT = {"passes": "✓", "fails": "✗", "not supported": "–", "not stated": "?"}
"""Verdicts in a table that has a column for each code."""
LEGEND = ", ".join(f"{sign} {verdict}" for verdict, sign in SHORT.items()) + "; empty: the card is older than the check"


BESIDE = ("standard", "GIMP")
"""Of our codes, those that stand beside others: what others are. The table of ours has all of them."""


def shown(cards: list[Kept]) -> pd.DataFrame:
    """Checks by code."""
    table = pd.DataFrame.from_dict(matrix(cards), orient="index").rename_axis("check").fillna("")
    return table.replace({f"^{verdict}": sign for verdict, sign in SHORT.items()}, regex=True)


def crossing(cards: list[Kept]) -> plt.Figure:
    """What induced crossing does to the compliance, family by family, of the codes that are capable of it."""
    figure, ax = plt.subplots(figsize=(7, 3.6))
    able = [(card, [row for row in card.of("reported") if row.check.startswith("compliance,")]) for card in cards]
    able = [(card, rows) for card, rows in able if rows]
    for k, (card, rows) in enumerate(able):
        at = np.arange(len(rows)) + 0.6 * ((k + 0.5) / len(able) - 0.5)
        ax.plot(
            at,
            [np.nan if row.observed is None else row.observed for row in rows],
            "os^Dv<>p*hX"[k % 11],
            label=card.code,
        )
        names = [row.check.removeprefix("compliance, ").removesuffix(", over that as seeded") for row in rows]
        ax.set_xticks(range(len(rows)), names, fontsize="small")
    ax.axhline(1.0, color="0.4", linewidth=1)
    ax.set(ylabel="compliance / as seeded")
    ax.legend(fontsize="small")
    return figure


@cache
def our_cards() -> tuple[Card, ...]:
    """Asked once a run."""
    return tuple(scorecard(method, every()) for method in ours())


@pytest.mark.slow
def test_our_codes(report: Report) -> None:
    """The codes of this repository

    Material points with each shape function, the finite element reference, and a plain scikit-fem analysis.
    """
    cards = our_cards()
    report.table("checks", grounds(every()), "What is asked, why it must hold, and what usually causes a failure.")
    report.table(
        "ours", shown([kept(card, "", "") for card in cards]), f"{LEGEND}. Numbers where they tell more than that."
    )
    figure = crossing([kept(card, "", "") for card in cards])
    report.figure("crossing", figure, "The cantilever with points moved by each family; elements have none to move.")
    held = [
        report.check(
            f"checks that {card.code} fails",
            len(card.of("fails")),
            0,
            source="what any code must do",
            reason="; ".join(f"{row.check.name} ({row.where})" for row in card.of("fails")),
        )
        for card in cards
    ]
    sound = [card for card in cards if not card.of("fails")]
    lacks = {card.code: sorted({row.where for row in card.of("not supported")}) for card in cards}
    least = min(lacks, key=lambda code: len(lacks[code]))
    passes = [len(card.of("passes")) for card in cards]
    report.found(
        f"{len(sound)} of {len(cards)} codes pass all that they are asked, {min(passes)} to {max(passes)} checks each; "
        f"{least} lacks least: {', '.join(lacks[least]) or 'nothing'}."
    )
    assert all(held)


def card_tables(report: Report, name: str, card: Kept) -> str:
    """What fails, then what passes or is told, then what is not supported; the name of the first table."""
    parts: dict[str, tuple[str, tuple[Verdict, ...]]] = {
        "fails": ("what fails", ("fails",)),
        "passes": ("what passes, and numbers for comparison", ("passes", "reported", "not stated")),
        "lacks": ("what was not asked: not supported, for want of", ("not supported",)),
    }
    found = {part: (title, card.of(*verdicts)) for part, (title, verdicts) in parts.items() if card.of(*verdicts)}
    for part, (title, rows) in found.items():
        table = [
            {"check": f"{row.way}: {row.check}", "expected": row.expected, "observed": cell(row, digits=True)}
            | {"where": row.where}
            | ({"look at": row.look} if part == "fails" else {})
            for row in rows
        ]
        report.table(f"{name}_{part}", pd.DataFrame(table), f"{card.code}: {title}.")
    return f"codes_{name}_{next(iter(found))}"


@pytest.mark.slow  # with that of our codes: their table has both
@pytest.mark.filterwarnings("default")  # what a code of any author warns of is shown, and fails nothing
def test_other_codes(report: Report, asked: Asked) -> None:
    """Other people's codes

    One scorecard for each, of the run that is named there; those just asked come first.
    """
    now = []
    for named in asked.codes:
        folder = KEPT if named in KNOWN else asked.folder
        now.append(kept(scorecard(code(named, asked.timeout), every()), asked.when, asked.machine))
        write(folder, now[-1])
    gc.collect()  # what a code leaves to be closed is closed, and warned of, here
    first = [card.code for card in now]
    cards = sorted([*read(KEPT), *read(asked.folder)], key=lambda card: card.code not in first)
    if not cards:
        pytest.skip("no other code has been put through: --code")
    for k, card in enumerate(cards):
        report.text(f"**{card.code}**, {card.version}, on {card.when} ({card.machine}): {card.verdict}.")
        if card.of("fails"):
            report.text("\n".join(f"- {row.check}: {told(row)}" for row in card.of("fails")))
        place = card_tables(report, f"card_{k}", card)
        if card.code in first:
            asked.say(f"{card.line}: {asked.page}#table-{place}")
        report.check(f"checks that {card.code} fails", len(card.of("fails")), source="for comparison")
        report.check(f"checks that {card.code} passes", len(card.of("passes")), source="for comparison")
    ran = our_cards() if our_cards.cache_info().currsize else ()  # a run of other codes alone does not ask ours
    everyone = [*(kept(card, "", "") for card in ran), *cards]
    figure = crossing(everyone)
    report.figure(
        "crossing_others", figure, "The same with other people's codes among ours." if ran else "The families."
    )
    beside = [card for card in everyone if card in cards or card.code in BESIDE]
    report.table("matrix", shown(beside), f"Other codes{' beside two of ours' if ran else ''}: {LEGEND}.")

"""The sentences of a comparison: the method to use, what crossing costs in truth, what methods claim, what to mind."""

from typing import NamedTuple

import numpy as np

from mpmtop.comparison.asked import FEM, METHODS, NONE
from mpmtop.comparison.entries import Comparison, Entry, listed, measure, relative
from mpmtop.crossing import moved
from mpmtop.crossing import named as crossing_of
from mpmtop.page.numbers import changed, number

SAME = 0.0125
"""Relative difference below which two designs are equally good: what the update rule and the start alone make of the
optimum of a cantilever (the report's page of open choices). Also the violation of a constraint that is let pass."""
MISLEADS = 0.05
"""Part by which a method's own value may miss the truth before it is warned of: four times that scatter."""


class Verdict(NamedTuple):
    """Sentences of a comparison, "" or none where there is nothing to say."""

    use: str
    crossing: tuple[str, ...]
    claims: str
    cut: str
    mind: tuple[str, ...]

    @property
    def rows(self) -> list[tuple[str, tuple[str, ...]]]:
        """What heads the page: a word and its sentences."""
        every = [
            ("Use", (self.use,)),
            ("Crossing", self.crossing),
            ("Claims", (self.claims,)),
            ("Cut", (self.cut,)),
            ("Mind", self.mind),
        ]
        return [(word, told) for word, sentences in every if (told := tuple(s for s in sentences if s))]


def verdict(found: Comparison) -> Verdict:
    """All that is said of a comparison."""
    return Verdict(_use(found), tuple(_crossings(found)), _claims(found), _cut(found), tuple(_mind(found)))


def truth(entry: Entry) -> float:
    """The true objective of an entry's design."""
    assert entry.run is not None
    return entry.run.numbers.truth


def ranked(entries: list[Entry]) -> list[Entry]:
    """Best first: feasible in truth before infeasible, then by true objective; what was not judged last."""

    def order(entry: Entry) -> tuple[bool, bool, float]:
        assert entry.run is not None
        value = entry.run.numbers.truth
        return bool(np.isnan(value)), entry.run.numbers.violation > SAME, value

    return sorted(entries, key=order)


def _use(found: Comparison) -> str:
    seeded = ranked(found.under(NONE)) or ranked(list(found.found))
    if not seeded:
        return "No method could be asked: see what each says below."
    best = seeded[0]
    what = measure(found.asked.scene)
    alike = same(found)
    good = [e for e in seeded if _feasible(e) == _feasible(best) and relative(truth(e), truth(best)) <= alike]
    own = {entry.slug for entry in good}
    rest = [entry for entry in seeded if entry not in good]
    text = f"{_either(good)}: "
    if len(seeded) == 1:
        text += f"the fine reference finds a true {what} of {number(truth(best), 4)} in its design."
        return text
    text += f"judged by the fine reference, the {what} of "
    text += f"the design is {number(truth(best), 4)}" if len(own) == 1 else f"their designs is {_span(good)}"
    if len(own) > 1:
        text += f", {_equal(found)}"
    text += "."
    if rest:
        worse = (
            f"{METHODS[entry.method]} {changed(relative(truth(entry), truth(best)))}"
            if _feasible(entry)
            else f"{METHODS[entry.method]} violates a constraint by {_violation(entry):.1%}"
            for entry in rest
            if not np.isnan(truth(entry))
        )
        told = "; ".join(worse)
        text += f" Beside the best, {told}." if told else ""
    return text


def same(found: Comparison) -> float:
    """Relative difference below which designs of a comparison are equal: the scatter of optima, or the judge's own
    error where that is larger."""
    return max(SAME, abs(found.judge_error or 0.0))


def _equal(found: Comparison) -> str:
    if same(found) > SAME:
        return f"which is equal for what the judge can tell ({same(found):.1%})"
    return f"which is equal for what rule and start make of an optimum ({SAME:.2%})"


def _violation(entry: Entry) -> float:
    return entry.run.numbers.violation if entry.run else 0.0


def _feasible(entry: Entry) -> bool:
    return _violation(entry) <= SAME


def _either(good: list[Entry]) -> str:
    """Methods to choose among; those that are one method are said to be."""
    own = [entry for entry in good if not entry.same_as]
    words = []
    for entry in own:
        twins = [METHODS[other.method] for other in good if other.same_as == entry.method]
        words.append(f"{METHODS[entry.method]} or {' or '.join(twins)} (one method here)" if twins else "")
        words[-1] = words[-1] or METHODS[entry.method]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def _span(entries: list[Entry]) -> str:
    values = [truth(entry) for entry in entries]
    low, high = number(min(values), 4), number(max(values), 4)
    return low if low == high else f"{low} to {high}"


def _crossings(found: Comparison) -> list[str]:
    """What each family costs in truth, and what the methods say of it."""
    sentences = []
    for crossing in found.asked.crossing:
        if crossing == NONE:
            continue
        pairs = [(entry, found.seeded(entry.method)) for entry in found.under(crossing)]
        both = [(crossed, still) for crossed, still in pairs if still is not None and not np.isnan(truth(crossed))]
        if not both:
            continue
        true = listed([f"{changed(relative(truth(c), truth(s)))} with {METHODS[c.method]}" for c, s in both])
        claim = listed([f"{_own(c, s):+.1%}" for c, s in both])
        best = ranked([c for c, _ in both])[0]
        good = [
            c for c, _ in both if relative(truth(c), truth(best)) <= same(found) and _feasible(c) == _feasible(best)
        ]
        sentences.append(
            f"{moved(crossing_of(crossing))}, the true {measure(found.asked.scene)} of designs is {true} than as "
            f"seeded; the methods themselves report {claim}. If points cross like this, take {_either(good)}."
            if len(both) > 1
            else f"{moved(crossing_of(crossing))}, the true {measure(found.asked.scene)} of the design is {true} than "
            f"as seeded; the method itself reports {claim}."
        )
    return [sentence.replace("unchanged with", "unchanged (to 0.1%) with") for sentence in sentences]


def _own(crossed: Entry, still: Entry) -> float:
    assert crossed.run is not None and still.run is not None
    return relative(crossed.run.own, still.run.own)


def _claims(found: Comparison) -> str:
    """How far the methods' own values are from the truth of the same designs."""
    by = {e: relative(e.run.own, truth(e)) for e in found.found if e.run is not None and not np.isnan(truth(e))}
    if not by:
        return ""
    low, high = min(by, key=by.__getitem__), max(by, key=by.__getitem__)
    if low is high:
        return f"{low.label} itself reports {_beside(low)}."
    return (
        f"The methods' own values miss the truth of the same designs by {by[low]:+.1%} ({low.label} reports "
        f"{_beside(low)}) to {by[high]:+.1%} ({high.label}, {_beside(high)})."
    )


def _beside(entry: Entry) -> str:
    assert entry.run is not None
    return f"{number(entry.run.own, 4)} for {number(truth(entry), 4)}"


def _cut(found: Comparison) -> str:
    """What is left of the designs in black and white."""
    judged = [e for e in found.found if e.run is not None and not np.isnan(e.run.numbers.cut)]
    lost = [e.label for e in found.found if e not in judged]
    torn = f"Cut so, the load hangs on void with {listed(lost)}: take more iterations, or a projection." if lost else ""
    best = _best_cut(judged)
    return f"{best} {torn}".strip() if best else torn.replace("Cut so", "Cut to black and white at its own volume")


def _best_cut(judged: list[Entry]) -> str:
    if not judged:
        return ""
    by = {entry: entry.run.numbers.cut for entry in judged if entry.run is not None}
    best = min(judged, key=by.__getitem__)
    text = f"Cut to black and white at its own volume, the best design is that of {best.label}: {number(by[best], 4)}"
    worst = max(judged, key=by.__getitem__)
    if worst is best:
        return f"{text}."
    return f"{text}; the worst that of {worst.label}, {changed(relative(by[worst], by[best]))}."


def _mind(found: Comparison) -> list[str]:
    """What the scene asks for that a method cannot give, and what is uncertain."""
    asked = found.asked
    said = []
    radius, h = asked.scene.design.filter_radius, max(asked.h)
    if radius < h * (1 - 1e-9) and any(entry.method != FEM for entry in found.entries):
        said.append(
            f"The filter radius {radius:g} is below the cells' side {h:.4g}: points hide stress between them from "
            f"MPM. Take a radius of a cell at least, or h of at most {radius:g}."
        )
    off = [e for e in found.found if e.run and abs(relative(e.run.own, truth(e))) > MISLEADS]
    if off:
        worst = max(off, key=lambda e: abs(relative(e.run.own, truth(e))) if e.run else 0.0)
        assert worst.run is not None
        of = "any method" if len(off) == len(found.found) > 1 else listed([e.label for e in off])
        said.append(
            f"Do not trust the own value of {of}: the truth is up to "
            f"{number(truth(worst) / worst.run.own)} times it ({worst.label})."
        )
    said += [f"{entry.label} cannot be asked: {entry.refusal}." for entry in found.entries if entry.refusal]
    said += [f"{e.label} stopped: {e.run.numbers.error}." for e in found.found if e.run and e.run.numbers.error]
    short = [e for e in found.found if e.run and e.run.numbers.outcome in ("max iterations", "infeasible")]
    if short:
        each = listed([f"{e.label} ({e.run.numbers.outcome})" for e in short if e.run])
        each = "every run" if len(short) == len(found.found) > 1 else each
        said.append(f"Not converged after {asked.iterations} iterations at most: {each}.")
    warned = [entry for entry in found.found if entry.prepared and entry.prepared.findings]
    if warned:
        said.append(f"The model misleads about the body with {listed([e.label for e in warned])}: see Warnings.")
    if found.judge_error is not None:
        said.append(
            f"The judge itself is uncertain by {abs(found.judge_error):.1%}: so much do finer elements change it."
        )
    return said

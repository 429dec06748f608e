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
    crossing = NONE if found.under(NONE) else found.asked.crossing[0]
    seeded = ranked([entry for entry in found.under(crossing) if not entry.same_as]) or ranked(found.found)
    if not seeded:
        return "No method could be asked: see what each says below."
    failed = _failed(found, crossing)
    judged = [entry for entry in seeded if not np.isnan(truth(entry))]
    if not judged:
        return f"No method can be told from another. {failed}"
    best = judged[0]
    what = measure(found.asked.scene)
    good = _good(found, judged)
    text = f"{_either(found, good)}: "
    if len(judged) == 1:
        text += f"the fine reference finds a true {what} of {number(truth(best), 4)} in its design."
    else:
        text += f"judged by the fine reference, the {what} of "
        if len(good) == 1:
            text += f"the design is {number(truth(best), 4)}."
        else:
            text += f"their designs is {_span([truth(e) for e in good])}, {_equal(found)}: take any. "
            text += _nearest(found, good)
    rest = [entry for entry in judged if entry not in good]
    if rest:
        text += f" Beside the best, {'; '.join(_beside_best(found, entry, best) for entry in rest)}."
    return f"{text} {failed}".strip()


def _beside_best(found: Comparison, entry: Entry, best: Entry) -> str:
    if _feasible(entry):
        return f"{_name(found, entry)} {changed(relative(truth(entry), truth(best)))}"
    return f"{_name(found, entry)} violates a constraint by {_violation(entry):.1%}"


def _good(found: Comparison, judged: list[Entry]) -> list[Entry]:
    """Those that are as good as the best, see `same`, best first."""
    best, alike = ranked(judged)[0], same(found)
    return [e for e in ranked(judged) if _feasible(e) == _feasible(best) and relative(truth(e), truth(best)) <= alike]


def _failed(found: Comparison, crossing: str) -> str:
    """Names those of a crossing that have no design, or one that the judge finds no equilibrium in."""
    entries = [entry for entry in found.entries if entry.crossing == crossing and not entry.same_as]
    none = [_name(found, entry) for entry in entries if entry.run is None]
    lost = [_name(found, entry) for entry in entries if entry.run is not None and np.isnan(truth(entry))]
    text = f"There is no design by {listed(none)}, see Mind." if none else ""
    return f"{text} The judge finds no equilibrium in the design by {listed(lost)}.".strip() if lost else text


def _nearest(found: Comparison, good: list[Entry]) -> str:
    """Among equal designs, whose method says best how good they are."""
    miss = {entry: _miss(entry) for entry in good}
    least = min(abs(part) for part in miss.values())
    near = [entry for entry in good if abs(miss[entry]) - least <= same(found)]
    if len(near) == len(good):
        return f"Their own values are about equally near the truth ({listed([f'{miss[e]:+.1%}' for e in near])})."
    told = listed([f"{_name(found, e)} ({miss[e]:+.1%})" for e in near])
    return (
        f"The own value{'s' if len(near) > 1 else ''} of {told} {'are' if len(near) > 1 else 'is'} nearest the truth."
    )


def _miss(entry: Entry) -> float:
    """How far a method's own value is from the truth of the same design."""
    assert entry.run is not None
    return relative(entry.run.own, truth(entry))


def same(found: Comparison) -> float:
    """Relative difference below which designs of a comparison are equal: the scatter of optima, or the judge's own
    error where that is larger."""
    return max(SAME, abs(found.judge_error or 0.0))


def _equal(found: Comparison) -> str:
    if same(found) > SAME:
        return f"which is equal for what the judge can tell (within {same(found):.2%})"
    return f"which is equal for what rule and start make of an optimum (within {SAME:.2%})"


def _violation(entry: Entry) -> float:
    return entry.run.numbers.violation if entry.run else 0.0


def _feasible(entry: Entry) -> bool:
    return _violation(entry) <= SAME


def _name(found: Comparison, entry: Entry) -> str:
    """Its method, and those that are the same equations here: MPM = GIMP."""
    twins = (e.method for e in found.entries if e.crossing == entry.crossing and e.same_as == entry.method)
    return " = ".join(METHODS[method] for method in (entry.method, *twins))


def _label(found: Comparison, entry: Entry) -> str:
    return _name(found, entry) if entry.crossing == NONE else f"{_name(found, entry)}, {entry.crossing}"


def _row(labels: list[str]) -> str:
    """Runs in a row; the commas of a crossing separate none."""
    return "; ".join(labels) if any("," in label for label in labels) else listed(labels)


def _either(found: Comparison, good: list[Entry]) -> str:
    """Methods to choose among."""
    words = [_name(found, entry) for entry in good]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def _span(values: list[float]) -> str:
    low, high = number(min(values), 4), number(max(values), 4)
    return low if low == high else f"{low} to {high}"


def _crossings(found: Comparison) -> list[str]:
    """What each family costs in truth, and what the methods say of it."""
    said = [_crossing(found, crossing) for crossing in found.asked.crossing if crossing != NONE]
    told = [sentence for sentence in said if sentence]
    if told and FEM in found.asked.methods:
        told.append("FEM is not among them: its mesh does not cross.")
    return told


def _crossing(found: Comparison, crossing: str) -> str:
    entries = [entry for entry in found.under(crossing) if not entry.same_as and not np.isnan(truth(entry))]
    pairs = [(entry, found.seeded(entry.method)) for entry in entries]
    both = [(crossed, still) for crossed, still in pairs if still is not None and not np.isnan(truth(still))]
    failed = _failed(found, crossing)
    if not both:
        return f"{moved(crossing_of(crossing))}: {failed}" if failed else ""
    alike = same(found)
    change = {crossed: relative(truth(crossed), truth(still)) for crossed, still in both}
    felt = [f"{changed(part)} with {_name(found, e)}" for e, part in change.items() if abs(part) > alike]
    small = [_name(found, e) for e, part in change.items() if abs(part) <= alike]
    none = f"not distinguishable from none (below {alike:.2%})"
    what = measure(found.asked.scene)
    text = moved(crossing_of(crossing))
    if felt:
        text += f", the true {what} of designs is {listed(felt)} than as seeded"
        text += f"; with {listed(small)} the change is {none}" if small else ""
    else:
        text += f", the change of the true {what} of designs is {none} with {listed(small)}"
    claim = listed([f"{_own(c, s):+.1%} ({_name(found, c)})" for c, s in both])
    text += (
        f"; the method{'s themselves' if len(both) > 1 else ' itself'} report{'' if len(both) > 1 else 's'} {claim}."
    )
    if len(both) > 1:
        good = _good(found, [crossed for crossed, _ in both])
        text += f" If points cross like this, take {_either(found, good)}{', any' if len(good) > 1 else ''}."
        text += f" {_nearest(found, good)}" if len(good) > 1 else ""
    return f"{text} {failed}".strip()


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
    lost = [_label(found, e) for e in found.found if e not in judged]
    torn = f"Cut so, the load hangs on void with {_row(lost)}: take more iterations, or a projection." if lost else ""
    best = _best_cut(found, judged)
    return f"{best} {torn}".strip() if best else torn.replace("Cut so", "Cut to black and white at its own volume")


def _best_cut(found: Comparison, judged: list[Entry]) -> str:
    if not judged:
        return ""
    by = {entry: entry.run.numbers.cut for entry in judged if entry.run is not None}
    best, worst = min(by.values()), max(by.values())
    good = [entry for entry in judged if relative(by[entry], best) <= same(found)]
    begin = "Cut to black and white at its own volume, "
    if len(good) == len(judged) > 1:
        return f"{begin}every design is as good: {_span(list(by.values()))}, within {same(found):.2%}."
    bad = [entry for entry in judged if entry not in good and relative(worst, by[entry]) <= same(found)]
    text = f"{begin}{_those(found, good, 'the best')}: {_span([by[entry] for entry in good])}"
    return f"{text}; {_those(found, bad, 'the worst')}, {changed(relative(worst, best))}." if bad else f"{text}."


def _those(found: Comparison, entries: list[Entry], rank: str) -> str:
    told = _row([_label(found, entry) for entry in entries])
    return f"{rank} design is that of {told}" if len(entries) == 1 else f"{rank} designs are those of {told}"


def _distrust(found: Comparison) -> list[str]:
    """Own values that are better or worse than the truth of the same designs, and what cutting makes worse by far."""
    limit = max(MISLEADS, same(found))
    judged = [e for e in found.found if e.run and not np.isnan(truth(e))]
    better = [e for e in judged if _miss(e) < -limit]
    worse = [e for e in judged if _miss(e) > limit]
    sides = (("optimistic", sorted(better, key=_miss)), ("pessimistic", sorted(worse, key=_miss, reverse=True)))
    told = [
        f"{side} by more than {limit:.1%}: {'; '.join(_times(found, e, truth(e)) for e in those)}"
        for side, those in sides
        if those
    ]
    said = [f"Do not trust own values that are {each}." for each in told]
    cut = [e for e in judged if e.run and min(_lost(e, truth(e)), _lost(e, e.run.own)) > limit]
    if cut:
        each = "; ".join(_times(found, e, e.run.numbers.cut) for e in cut if e.run)
        said.append(
            f"Cut to black and white, worse than grey and than its own value, both by more than {limit:.1%}: {each}."
        )
    return said


def _lost(entry: Entry, to: float) -> float:
    assert entry.run is not None
    return relative(entry.run.numbers.cut, to)


def _times(found: Comparison, entry: Entry, true: float) -> str:
    assert entry.run is not None
    own = entry.run.own
    if own * true <= 0:
        return f"{_label(found, entry)}, {number(own, 4)} for {number(true, 4)}"
    return f"{_label(found, entry)}, the truth is {number(true / own)} times its own value"


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
    said += _distrust(found)
    said += [f"{entry.label} cannot be asked: {entry.refusal}." for entry in found.entries if entry.refusal]
    said += [f"{e.label} stopped: {e.run.numbers.error}." for e in found.found if e.run and e.run.numbers.error]
    said += [f"{e.label}: {e.run.numbers.remark}." for e in found.found if e.run and e.run.numbers.remark]
    short = [e for e in found.found if e.run and e.run.numbers.outcome in ("max iterations", "infeasible")]
    if short:
        each = _row([f"{e.label} ({e.run.numbers.outcome})" for e in short if e.run])
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

"""The loop: what it hands out, when it stops, and that an interrupted run goes on as if nothing had happened."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mpmtop.optimize as loop
from mpmtop.gcmma import GCMMA, MMA, OptimalityCriteria, SingleStepGCMMA, UpdateRule
from mpmtop.optimize import CheckpointError, History, Iterate, design_change, optimize, relative_change
from mpmtop.scene import Array, NotConverged
from validation.interruption import design_problem

RULES: list[UpdateRule] = [MMA(), GCMMA(), GCMMA(warm_start=True), SingleStepGCMMA(), OptimalityCriteria()]


@dataclass(frozen=True, eq=False)
class Values:
    x: Array
    objective: float
    constraints: Array


@dataclass(eq=False)
class Bars:
    """min sum c / x + ripples subject to mean x <= 0.4 and a second, idle constraint if `idle`; counts its calls."""

    c: Array = field(default_factory=lambda: np.linspace(0.1, 2, 30))
    idle: bool = False
    fingerprint: str = "bars"
    evaluations: int = 0
    gradients: int = 0

    @property
    def x0(self) -> Array:
        return np.full(len(self.c), 0.4)

    @property
    def lower(self) -> Array:
        return np.full(len(self.c), 0.05)

    @property
    def upper(self) -> Array:
        return np.ones(len(self.c))

    def evaluate(self, x: Array) -> Values:
        self.evaluations += 1
        g = [np.mean(x) / 0.4 - 1, -1.0 - x[0]]
        return Values(x, float(np.sum(self.c / x + 0.2 * np.sin(9 * x))), np.array(g[: 1 + self.idle]))

    def gradient(self, evaluation: Values) -> tuple[Array, Array]:
        self.gradients += 1
        x, n = evaluation.x, len(self.c)
        dg = np.stack([np.full(n, 1 / (0.4 * n)), -np.eye(n)[0]])
        return -self.c / x**2 + 1.8 * np.cos(9 * x), dg[: 1 + self.idle]


def same(a: Iterate[Values], b: Iterate[Values]) -> bool:
    """Bit for bit, converged and solves included."""
    return (
        (a.iteration, a.solves, a.objective, a.converged) == (b.iteration, b.solves, b.objective, b.converged)
        and np.array_equal(a.x, b.x)
        and np.array_equal(a.constraints, b.constraints)
    )


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_objective_belongs_to_the_design_and_solves_are_counted(rule: UpdateRule) -> None:
    problem = Bars()
    for k, iterate in enumerate(optimize(problem, rule, max_iterations=8, stop=lambda history: False)):
        assert iterate.iteration == k == problem.gradients
        assert iterate.solves == problem.evaluations
        expected = Bars().evaluate(iterate.x)
        assert iterate.objective == iterate.evaluation.objective == expected.objective
        np.testing.assert_array_equal(iterate.constraints, expected.constraints)
        np.testing.assert_array_equal(iterate.evaluation.x, iterate.x)
        if k == 0:
            np.testing.assert_array_equal(iterate.x, problem.x0)
    assert k == 8
    assert not iterate.converged


def test_all_constraints_are_recorded() -> None:
    for iterate in optimize(Bars(idle=True), GCMMA(), max_iterations=5):
        np.testing.assert_array_equal(iterate.constraints[1], -1 - iterate.x[0])


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_the_loop_ends_when_the_rule_is_first_met(rule: UpdateRule) -> None:
    iterates = list(optimize(Bars(), rule))
    J = np.array([iterate.objective for iterate in iterates])
    assert [iterate.converged for iterate in iterates] == [False] * (len(J) - 1) + [True]
    met = [k for k in range(4, len(J)) if np.max(np.abs(J[k] - J[k - 4 : k])) <= 1e-4 * abs(J[k])]
    assert met == [len(J) - 1]


def test_no_update_at_all_and_an_unused_generator() -> None:
    problem = Bars()
    run = optimize(problem, MMA(), max_iterations=0)
    assert problem.evaluations == 0
    (only,) = run
    assert (only.iteration, only.solves, only.converged) == (0, 1, False)
    assert (problem.evaluations, problem.gradients) == (1, 0)


def history(*objective: float, change: float = 1.0) -> History:
    return History(np.array(objective), np.array([0.5, 0.5 + change]), np.array([0.5, 0.5]))


def test_relative_change() -> None:
    rule = relative_change()
    assert not rule(history(1, 1, 1, 1))  # three earlier iterations only
    assert rule(history(9, 1, 1, 1, 1, 1))
    assert rule(history(1.00009, 1, 1, 1, 1))
    assert not rule(history(1.00011, 1, 1, 1, 1))  # the oldest of the four counts
    assert not rule(history(1, 1, 1, 1.00011, 1))  # and the latest
    assert rule(history(-1.00009, -1, -1, -1, -1))
    assert not rule(history(1, 2, 1, 2, 1))
    assert relative_change(tol=0.6, window=1)(history(5, 1, 2))
    assert not relative_change(tol=0.6, window=2)(history(5, 1, 2))


def test_design_change() -> None:
    rule = design_change(0.01)
    assert rule(history(2, 1, change=0.009))
    assert rule(history(2, 1, change=-0.009))
    assert not rule(history(2, 1, change=0.011))
    assert not rule(history(2, change=0.0))  # x0 has no predecessor
    last = list(optimize(Bars(), MMA(), stop=rule))[-2:]
    assert last[1].converged
    assert np.max(np.abs(last[1].x - last[0].x)) <= 0.01


@pytest.mark.parametrize(
    "call", [lambda: relative_change(-1), lambda: relative_change(window=0), lambda: design_change(-1)]
)
def test_stopping_rules_refuse_nonsense(call: Callable[[], Any]) -> None:
    with pytest.raises(ValueError, match="give a tolerance"):
        call()


def test_arguments_are_checked() -> None:
    for wrong in ({"max_iterations": -1}, {"checkpoint_every": 0}):
        with pytest.raises(ValueError, match="give at least 0 and 1"):
            next(optimize(Bars(), MMA(), **wrong))  # type: ignore[arg-type]


@pytest.mark.parametrize("interrupted", [0, 1, 2, 7])
@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_a_resumed_run_is_bit_identical(rule: UpdateRule, interrupted: int, tmp_path: Path) -> None:
    whole = list(optimize(Bars(), rule, max_iterations=12))
    path = tmp_path / "run.npz"
    list(islice(optimize(Bars(), rule, max_iterations=12, checkpoint=path), interrupted + 1))
    rest = list(optimize(Bars(), rule, max_iterations=12, checkpoint=path))
    assert [iterate.iteration for iterate in rest] == list(range(interrupted, len(whole)))
    assert all(same(a, b) for a, b in zip(whole[interrupted:], rest, strict=True))


def test_a_run_interrupted_again_and_again_with_many_constraints(tmp_path: Path) -> None:
    whole = list(optimize(Bars(idle=True), GCMMA()))
    path, last = tmp_path / "new" / "folder" / "run.npz", None
    for _ in range(len(whole)):
        *_, last = islice(optimize(Bars(idle=True), GCMMA(), checkpoint=path), 2)
    assert last is not None
    assert last.converged
    assert same(last, whole[-1])


def test_a_checkpoint_now_and_then_loses_only_what_came_after_it(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    whole = list(optimize(Bars(), MMA()))
    list(islice(optimize(Bars(), MMA(), checkpoint=path, checkpoint_every=3), 6))  # iterations 0 to 5
    rest = list(optimize(Bars(), MMA(), checkpoint=path, checkpoint_every=3))
    assert rest[0].iteration == 3
    assert all(same(a, b) for a, b in zip(whole[3:], rest, strict=True))
    again = Bars()
    (end,) = optimize(again, MMA(), checkpoint=path, checkpoint_every=3)  # the last iterate is always written
    assert same(end, whole[-1])
    assert (again.evaluations, again.gradients) == (1, 0)


def test_more_iterations_may_be_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    list(optimize(Bars(), GCMMA(), checkpoint=path, max_iterations=3))
    *_, last = optimize(Bars(), GCMMA(), checkpoint=path, max_iterations=9)
    *_, whole = optimize(Bars(), GCMMA(), max_iterations=9)
    assert same(last, whole)


@pytest.mark.parametrize("moment", ["half written", "before the rename"])
def test_a_kill_while_writing_leaves_the_old_checkpoint(
    moment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.npz"

    def half(file: Any, **content: Any) -> None:
        file.write(b"PK\x03\x04 half")
        raise KeyboardInterrupt

    def killed(*names: Any) -> None:
        raise KeyboardInterrupt

    def run() -> Iterator[Iterate[Values]]:
        return optimize(Bars(), GCMMA(), checkpoint=path)

    list(islice(run(), 4))
    before = path.read_bytes()
    with monkeypatch.context() as patch:
        if moment == "half written":
            patch.setattr(loop.np, "savez", half)
        else:
            patch.setattr(loop.os, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            list(run())
    assert path.read_bytes() == before
    assert all(same(a, b) for a, b in zip(list(optimize(Bars(), GCMMA()))[3:], run(), strict=True))
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]  # the next write took the partial one away


def test_a_foreign_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    list(islice(optimize(Bars(), GCMMA(), checkpoint=path), 3))
    before = path.read_bytes()
    for problem, rule in (
        (Bars(fingerprint="other bars"), GCMMA()),
        (Bars(), MMA()),
        (Bars(), GCMMA(move=0.2)),
    ):
        with pytest.raises(CheckpointError, match=r"(?s)another problem or update rule.*another file name"):
            next(optimize(problem, rule, checkpoint=path))
    with pytest.raises(CheckpointError, match="the problem has changed"):
        next(optimize(Bars(c=np.linspace(0.1, 3, 30)), GCMMA(), checkpoint=path))
    assert path.read_bytes() == before


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    list(islice(optimize(Bars(), GCMMA(), checkpoint=path), 3))
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[whole.index(b"x_older.npy") + 300] ^= 1  # one bit of an array: the archive's check sum tells
    with path.open("wb") as file:
        np.savez(file, x=np.zeros(3))
    incomplete = path.read_bytes()
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    for content in (b"", whole[: len(whole) // 2], whole[:-1], bytes(flipped), b"text", incomplete, path.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(CheckpointError, match=r"not a complete checkpoint .* delete it to start afresh"):
            next(optimize(Bars(), GCMMA(), checkpoint=path))
        assert path.read_bytes() == content


def test_values_that_are_not_finite_end_the_run_by_name() -> None:
    with pytest.raises(NotConverged, match="iteration 0: objective nan"):
        list(optimize(Bars(c=np.full(30, np.nan)), MMA()))


@pytest.mark.parametrize("k", [0, 2, 5])
def test_kill_9(k: int, tmp_path: Path) -> None:
    """A process killed by SIGKILL in the iteration after the k-th, or wherever it has got to by then, and resumed."""
    path = tmp_path / "run.npz"
    program = (
        "import sys; from pathlib import Path; from mpmtop.gcmma import GCMMA; from mpmtop.optimize import optimize\n"
        "from validation.interruption import design_problem\n"
        "for i in optimize(design_problem(), GCMMA(), checkpoint=Path(sys.argv[1])): print(i.iteration, flush=True)"
    )
    command = [sys.executable, "-c", program, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1]) as process:
        assert process.stdout is not None
        next(line for line in process.stdout if int(line) == k)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    *_, whole = optimize(design_problem(), GCMMA())
    first, *rest = optimize(design_problem(), GCMMA(), checkpoint=path)
    assert first.iteration >= k
    end = [first, *rest][-1]
    assert (end.iteration, end.solves, end.objective) == (whole.iteration, whole.solves, whole.objective)
    np.testing.assert_array_equal(end.x, whole.x)
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]

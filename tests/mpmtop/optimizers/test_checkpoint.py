"""An interrupted run goes on as if nothing had happened; a foreign or damaged file is refused."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpmtop.optimizers import (
    GCMMA,
    MMA,
    CheckpointError,
    Iterate,
    Stage,
    UpdateRule,
    checkpoint,
    continuation,
    optimize,
)
from tests.mpmtop.optimizers.problems import ALL_RULES, Bars, Values, same
from validation.studies.stability.interruption import interrupted


@pytest.mark.parametrize("interrupted", [0, 1, 2, 7])
@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
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
            patch.setattr(checkpoint.np, "savez", half)
        else:
            patch.setattr(checkpoint.os, "replace", killed)
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
        with pytest.raises(CheckpointError, match=r"(?s)another (problem|update rule).*another file name"):
            next(optimize(problem, rule, checkpoint=path))
    with pytest.raises(CheckpointError, match="the problem has changed"):
        next(optimize(Bars(c=np.linspace(0.1, 3, 30)), GCMMA(), checkpoint=path))
    with pytest.raises(CheckpointError, match="from another start"):
        next(optimize(Bars(), GCMMA(), start=0.3, checkpoint=path))
    assert path.read_bytes() == before
    next(optimize(Bars(), GCMMA(), start=0.4 * (1 + 1e-14), checkpoint=path))  # another machine's rounding


@pytest.mark.parametrize(("change", "refused"), [(1e-9, False), (1e-4, True)])
def test_a_changed_objective_is_no_rounding(change: float, refused: bool, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    list(islice(optimize(Bars(), GCMMA(), checkpoint=path), 3))
    other = optimize(Bars(c=np.linspace(0.1, 2, 30) * (1 + change)), GCMMA(), checkpoint=path)
    if refused:
        with pytest.raises(CheckpointError, match="the problem has changed"):
            next(other)
    else:
        assert next(other).iteration == 2


def test_the_path_may_be_text(tmp_path: Path) -> None:
    name = str(tmp_path / "run.npz")
    list(optimize(Bars(), MMA(), checkpoint=name, max_iterations=2))
    assert next(optimize(Bars(), MMA(), checkpoint=name)).iteration == 2


@pytest.mark.parametrize("interrupted", [1, 4, 5, 6, 8])
def test_resumed_stages_are_bit_identical(interrupted: int, tmp_path: Path) -> None:
    """Killed within a stage, at its last iterate and at the next one's first: five iterates of each of three."""

    def run(path: Path | None = None) -> Iterator[Iterate[Values]]:
        stages = [Stage(Bars(c=k * np.linspace(0.1, 2, 30)), GCMMA(), max_iterations=4) for k in (1, 3, 9)]
        return continuation(stages, start=0.3, checkpoint=path)

    whole = list(run())
    assert [i.stage for i in whole] == [0] * 5 + [1] * 5 + [2] * 5
    path = tmp_path / "run.npz"
    list(islice(run(path), interrupted + 1))
    assert all(same(a, b) and a.stage == b.stage for a, b in zip(whole[interrupted:], run(path), strict=True))


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


@pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # a body moved off its clamp on purpose
@pytest.mark.parametrize("k", [0, 2, 5])
def test_kill_9(k: int, tmp_path: Path) -> None:
    """A process killed by SIGKILL in the iteration after the k-th, or wherever it has got to by then, and resumed."""
    path = tmp_path / "run.npz"
    program = (
        "import sys; from pathlib import Path; from mpmtop.optimizers import GCMMA, optimize\n"
        "from validation.studies.stability.interruption import interrupted\n"
        "for i in optimize(interrupted(), GCMMA(), checkpoint=Path(sys.argv[1])): print(i.iteration, flush=True)"
    )
    command = [sys.executable, "-c", program, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3]) as process:
        assert process.stdout is not None
        next(line for line in process.stdout if int(line) == k)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    *_, whole = optimize(interrupted(), GCMMA())
    first, *rest = optimize(interrupted(), GCMMA(), checkpoint=path)
    assert first.iteration >= k
    end = [first, *rest][-1]
    assert (end.iteration, end.solves, end.objective) == (whole.iteration, whole.solves, whole.objective)
    np.testing.assert_array_equal(end.x, whole.x)
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]

"""An explicit code in another language, or interpreter: a command that is asked for time steps line by line.

Its `code.json` has an entry "explicit", see `files.SCHEMA`; `explicit.relaxed` ramps and damps through it.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from validation.codes.answers import NotStated
from validation.codes.command import PATIENCE
from validation.codes.explicit import Motion
from validation.codes.files import CodeFile, folder_of, read_answer, write_case
from validation.codes.process import MOVED, Crashed, Process, TimedOut, words_of
from validation.methods.protocol import Capability, Case


@dataclass(frozen=True, eq=False)
class Talk:
    """A process that has a case, in its folder."""

    process: Process
    case: Case
    folder: tempfile.TemporaryDirectory[str]

    @property
    def where(self) -> Path:
        """The case's folder."""
        return Path(self.folder.name) / folder_of(self.case.name)


class SteppingCommand:
    """A command with the words {case} and {answer} that stays, and reads lines; a case takes `timeout` seconds in all.

    For each line `LEVEL STEPS` it makes STEPS time steps under LEVEL times the forces, writes {answer} anew, and says
    `moved KINETIC STORED`: both energies. It ends with its input.
    """

    def __init__(self, command: str, said: CodeFile, timeout: float) -> None:
        self.command, self.timeout, self.hung = command, timeout, 0
        self.name, self.version = said.name, said.version
        self.capabilities: frozenset[Capability] = said.capabilities

    def begin(self, case: Case) -> Talk:
        """Start it. Raises Crashed if there is no such command, TimedOut after `PATIENCE` that were too slow."""
        if self.hung >= PATIENCE:
            raise TimedOut(f"not asked: {PATIENCE} calls before did not end in {self.timeout:g} s")
        folder = tempfile.TemporaryDirectory()
        where = Path(folder.name) / folder_of(case.name)
        write_case(where, case)
        words = words_of(self.command, str(where), str(where / "answer.csv"))
        return Talk(Process(words, self.timeout, talks=True), case, folder)

    def advance(self, state: Talk, level: float, steps: int) -> Motion:
        """By one line. Raises TimedOut, Crashed, Misanswered."""
        (state.where / "answer.csv").unlink(missing_ok=True)
        try:
            said = state.process.ask(f"{float(level)!r} {steps}")
        except TimedOut:
            self.hung += 1
            raise
        try:
            kinetic, stored = (float(word) for word in said.split())
        except ValueError as error:
            raise Crashed(f"it said `{MOVED}{said.rstrip()[:80]}`: give two numbers, both energies") from error
        answer = read_answer(state.where, state.case)[0]
        if answer.stress is None:
            raise NotStated("stress")
        return Motion(answer.u, answer.stress, kinetic, stored)

    def end(self, state: Talk) -> None:
        """End the process, and take its folder away."""
        state.process.kill()
        state.folder.cleanup()

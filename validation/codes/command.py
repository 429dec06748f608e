"""A code that is a command, or a folder of answers: a question is a folder of files, the answer a table."""

import tempfile
from pathlib import Path

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from validation.codes.adapter import NoAdapter
from validation.codes.answers import Misanswered, NotStated
from validation.codes.files import (
    folder_of,
    functions_name,
    read_answer,
    read_code,
    read_functions,
    read_steps,
    steps_name,
    write_case,
    write_functions,
)
from validation.codes.process import Crashed, Process, TimedOut, words_of
from validation.methods.protocol import Answer, Case, Shape, Step

TIMEOUT = 60.0
"""Seconds for one case unless given: the largest has 2,048 points."""
PATIENCE = 2
"""Commands that may fail to end before no more is asked: a code that hangs costs minutes and not hours."""


class CommandCode:
    """A command with the words {case}, a folder to read, and {answer}, a file to write.

    It is called first with the word `capabilities` for {case}, to write what `code.json` says (see `files.SCHEMA`) into
    {answer}. Every call is ended, with all that it has started, after `timeout` seconds.
    """

    def __init__(self, command: str, timeout: float = TIMEOUT) -> None:
        self.command, self.timeout, self.hung = command, timeout, 0
        if "{case}" not in command or "{answer}" not in command:
            raise NoAdapter(f"--code {command!r}: a command names {{case}} and {{answer}}")
        with tempfile.TemporaryDirectory() as folder:
            said = Path(folder) / "code.json"
            try:
                self._run("capabilities", said)
            except (TimedOut, Crashed) as error:
                raise NoAdapter(f"asked for its capabilities: {error}") from error
            self.said = read_code(said)
        self.name, self.version, self.capabilities, self.accuracy, _ = self.said

    def analyse(self, case: Case) -> Answer:
        """By one call of the command."""
        return self._answer(case)[0]

    def gradient(self, case: Case) -> Array:
        """The column `dcde`, by one call of the command."""
        slope = self._answer(case)[1]
        if slope is None:
            raise NotStated("dcde")
        return slope

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        """By one call of the command."""
        with tempfile.TemporaryDirectory() as folder:
            where = Path(folder) / folder_of(functions_name(x, half_length, grid))
            write_functions(where, x, half_length, grid)
            self._run(str(where), where / "answer.csv")
            return read_functions(where / "answer.csv", len(x))

    def steps(self, case: Case, count: int) -> list[Step]:
        """By one call of the command."""
        with tempfile.TemporaryDirectory() as folder:
            where = Path(folder) / folder_of(steps_name(case, count))
            write_case(where, case, count)
            self._run(str(where), where / "answer.csv")
            return read_steps(where / "answer.csv", case, count)

    def _answer(self, case: Case) -> tuple[Answer, Array | None]:
        with tempfile.TemporaryDirectory() as folder:
            where = Path(folder) / folder_of(case.name)
            write_case(where, case)
            self._run(str(where), where / "answer.csv")
            return read_answer(where, case)

    def _run(self, case: str, answer: Path) -> None:
        """Call the command. Raises TimedOut, Crashed with the last it said."""
        if self.hung >= PATIENCE:
            raise TimedOut(f"not asked: {PATIENCE} calls before did not end in {self.timeout:g} s")
        try:
            Process(words_of(self.command, case, str(answer)), self.timeout).wait()
        except TimedOut:
            self.hung += 1
            raise


class AnsweredFolder:
    """Answers beside the cases that `python -m validation cases DIR` wrote."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name, self.version, self.capabilities, self.accuracy, _ = read_code(folder / "code.json")

    def analyse(self, case: Case) -> Answer:
        """What stands in the case's folder."""
        return read_answer(self._of(case.name), case)[0]

    def gradient(self, case: Case) -> Array:
        """The column `dcde`."""
        slope = read_answer(self._of(case.name), case)[1]
        if slope is None:
            raise NotStated("dcde")
        return slope

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        """What stands in the question's folder."""
        return read_functions(self._of(functions_name(x, half_length, grid)) / "answer.csv", len(x))

    def steps(self, case: Case, count: int) -> list[Step]:
        """What stands in the question's folder."""
        return read_steps(self._of(steps_name(case, count)) / "answer.csv", case, count)

    def _of(self, name: str) -> Path:
        folder = self.folder / folder_of(name)
        if not folder.is_dir():
            raise Misanswered(f"there is no folder {folder.name}: write the cases anew")
        return folder

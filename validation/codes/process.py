"""A command of someone else's as a process: time-limited, and whatever it says costs no memory.

What it writes on either stream is read as it comes. Lines that begin with `MOVED` are passed on to whoever waits for
one; of the rest the last `KEPT` are kept, for messages.
"""

import os
import queue
import shlex
import signal
import subprocess
import threading
import time
from collections import deque
from contextlib import suppress

LONGEST = 65536
"""Bytes of a line that are read at once: a stream without an end of line comes in pieces."""
KEPT = 3
"""Lines: interpreters may say a word of their own after what went wrong."""
MOVED = "moved"
"""First word of the lines by which a code that steps in time answers, see `stepping`."""


class TimedOut(RuntimeError):
    """A command did not end in time."""


class Crashed(RuntimeError):
    """A command ended with an error."""


def words_of(command: str, case: str, answer: str) -> list[str]:
    """The command's words, with those of a case in place of {case} and {answer}."""
    return [word.replace("{case}", case).replace("{answer}", answer) for word in shlex.split(command)]


class Process:
    """A process of `words`, in a session of its own so that what it starts ends with it, for `seconds` in all.

    Raises Crashed if there is no such program.
    """

    def __init__(self, words: list[str], seconds: float, *, talks: bool = False) -> None:
        self.seconds, self._until = seconds, time.monotonic() + seconds
        self._last, self._moved = deque[bytes](maxlen=KEPT), queue.Queue[bytes | None]()
        try:
            self._process = subprocess.Popen(
                words,
                stdin=subprocess.PIPE if talks else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except OSError as error:
            raise Crashed(f"{words[0]}: {error.strerror}") from error
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        while line := self._process.stdout.readline(LONGEST):
            if line.startswith(MOVED.encode()):
                self._moved.put(line)
            elif line.strip():
                self._last.append(line)
        self._moved.put(None)

    def wait(self) -> None:
        """Until it has ended well. Raises TimedOut, or Crashed with the last it said."""
        try:
            code = self._process.wait(max(self._until - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired as error:
            raise self._late() from error
        finally:
            self.kill()
        if code != 0:
            raise self._crashed(code)

    def ask(self, line: str) -> str:
        """Send a line, and wait for one that begins with `MOVED`: the rest of it. Raises as `wait` does."""
        assert self._process.stdin is not None
        with suppress(OSError):  # one that has ended is asked why below
            self._process.stdin.write(f"{line}\n".encode())
            self._process.stdin.flush()
        try:
            answer = self._moved.get(timeout=max(self._until - time.monotonic(), 0.0))
        except queue.Empty as error:
            self.kill()
            raise self._late() from error
        if answer is None:
            raise self._crashed(self._process.wait())
        return answer.decode("utf-8", "replace").removeprefix(MOVED)

    def kill(self) -> None:
        """End it with all that it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._reader.join(1.0)  # one that has left the session may hold the stream open: it is not waited for
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        if not self._reader.is_alive() and self._process.stdout is not None:
            self._process.stdout.close()

    def _late(self) -> TimedOut:
        return TimedOut(f"no end after {self.seconds:g} s")

    def _crashed(self, code: int) -> Crashed:
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        last = "; ".join(line.decode("utf-8", "replace").strip()[:200] for line in self._last)
        return Crashed(f"{how}: {last or 'it said nothing'}")

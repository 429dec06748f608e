"""What `--code` may name: a code known here, a class, a folder of answers, or a command."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from validation.codes.adapter import NoAdapter, load_class
from validation.codes.command import TIMEOUT, AnsweredFolder, CommandCode

KNOWN = {
    "kratos": ("KratosMultiphysics", "validation.methods.kratos:KratosMethod"),
    "pymoto": ("pymoto", "validation.methods.pymoto:PyMotoMethod"),
}
"""Packages of the extra `peers` and the classes behind which they are."""


KEPT = Path(__file__).parents[1] / "data" / "codes"
"""Where the scorecards of these are kept, with the code."""


def code(named: str, timeout: float = TIMEOUT) -> Any:
    """The code named `kratos` or `pymoto`, FILE.py:CLASS or module:CLASS, DIR, or a command with {case} and {answer}.

    NoAdapter says what is wrong with any other name.
    """
    if named in KNOWN:
        package, where = KNOWN[named]
        if find_spec(package) is None:
            raise NoAdapter(f"--code {named}: no {package} here, pip install -e '.[peers]'")
        module, name = where.split(":")
        return getattr(__import__(module, fromlist=[name]), name)()
    if "{case}" in named or "{answer}" in named:
        return CommandCode(named, timeout)
    if Path(named).is_dir():
        return AnsweredFolder(Path(named))
    return load_class(named)

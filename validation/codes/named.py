"""What `--code` may name: a code known here, a class, a folder of answers, or a command."""

import shlex
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from validation.codes.adapter import NoAdapter, load_class
from validation.codes.command import TIMEOUT, AnsweredFolder, CommandCode
from validation.codes.explicit import Relaxed, relaxed
from validation.codes.stepping import SteppingCommand

KNOWN = {
    "kratos": ("KratosMultiphysics", "validation.methods.kratos:KratosMethod"),
    "pymoto": ("pymoto", "validation.methods.pymoto:PyMotoMethod"),
}
"""Packages of the extra `peers` and the classes behind which they are."""


KEPT = Path(__file__).parents[1] / "data" / "codes"
"""Where the scorecards of these are kept, with the code."""
AMPLE = {"ample": "mpm", "ample-gimp": "gimp"}
"""AMPLE, a copy of the user's own, by Octave: `ample:FOLDER` with its tents, `ample-gimp:FOLDER` with its GIMP."""
GEOTAICHI = {"geotaichi": "Linear", "geotaichi-gimp": "GIMP"}
"""GeoTaichi, in an interpreter of its own: `geotaichi:PYTHON` with its tents, `geotaichi-gimp:PYTHON` with its GIMP."""


def code(named: str, timeout: float = TIMEOUT) -> Any:
    """The code named `kratos`, `pymoto`, `ample:FOLDER` or `geotaichi:PYTHON`, FILE.py:CLASS or module:CLASS, DIR, or a
    command with {case} and {answer}.

    NoAdapter says what is wrong with any other name.
    """
    if named in KNOWN:
        package, where = KNOWN[named]
        if find_spec(package) is None:
            raise NoAdapter(f"--code {named}: no {package} here, pip install -e '.[peers]'")
        module, name = where.split(":")
        return getattr(__import__(module, fromlist=[name]), name)()
    kind, _, folder = named.partition(":")
    if kind in AMPLE:
        return commanded(ample(AMPLE[kind], Path(folder)), timeout)
    if kind in GEOTAICHI:
        return commanded(geotaichi(GEOTAICHI[kind], Path(folder)), timeout)
    if "{case}" in named or "{answer}" in named:
        return commanded(named, timeout)
    if Path(named).is_dir():
        return AnsweredFolder(Path(named))
    return load_class(named)


def commanded(command: str, timeout: float) -> CommandCode | Relaxed:
    """The code of a command: of statics, or one that steps in time, ramped and damped."""
    code = CommandCode(command, timeout)
    if code.said.explicit is None:
        return code
    try:
        return relaxed(SteppingCommand(command, code.said, timeout), code.accuracy, **code.said.explicit)
    except ValueError as error:
        raise NoAdapter(f"--code {command!r}: {error}") from error


def geotaichi(function: str, python: Path) -> str:
    """The command by which GeoTaichi answers in an interpreter that has it; NoAdapter where there is none."""
    if not python.is_file():
        raise NoAdapter(f"GeoTaichi: there is no {python}: name the interpreter of an environment that holds it")
    words = [str(python), "-I", str(Path(__file__).with_name("geotaichi.py"))]
    return f"{shlex.join(words)} {{case}} {{answer}} {function}"


def ample(kind: str, folder: Path) -> str:
    """The command by which AMPLE in a folder answers; NoAdapter where it, or Octave, is not there."""
    octave = shutil.which("octave-cli")
    if octave is None:
        raise NoAdapter("AMPLE: no octave-cli here: install GNU Octave")
    if not (folder / "functions" / "detMPs.m").is_file():
        raise NoAdapter(f"AMPLE: {folder} holds no functions/detMPs.m: name the folder of a copy of AMPLE 1.1")
    words = [octave, "--no-gui", "-q", str(Path(__file__).with_name("ample.m")), str(folder.resolve()), kind]
    return f"{shlex.join(words)} {{case}} {{answer}}"

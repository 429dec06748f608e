"""A scene from a file of one's own: Python that makes one `Scene`, and may say how it is to be compared."""

import runpy
import sys
import traceback
import warnings
from pathlib import Path
from typing import Any, NamedTuple

from mpmtop.scene import Scene

SETTINGS = ("h", "ppc", "methods", "crossing", "iterations", "load_steps", "ghost", "rule")
"""Names in a file that say how its scene is compared, as the arguments of `compare` of the same name."""


class SceneFileError(ValueError):
    """A file does not make one scene; the message says why, and what to change."""


class Stated(NamedTuple):
    """The scene of a file, and the settings that stand in it."""

    scene: Scene
    settings: dict[str, Any]


def read_scene(path: Path) -> Stated:
    """Run the file and take its one `Scene`. SceneFileError, one sentence, if that cannot be done."""
    if not path.is_file():
        raise SceneFileError(f"{path}: there is no such file; `python -m mpmtop new {path}` writes one that runs")
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)  # as for a script: files beside it can be imported
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            names = runpy.run_path(str(path), run_name=path.stem)
    except SyntaxError as error:
        raise SceneFileError(f"{error.filename or path}, line {error.lineno}: not Python ({error.msg})") from error
    except (Exception, SystemExit) as error:
        raise SceneFileError(f"{path}, line {_line(error, path)}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(folder)
    return Stated(_one_scene(path, names), {name: names[name] for name in SETTINGS if name in names})


def _line(error: BaseException, path: Path) -> int:
    """The last line of the file that the error went through."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return lines[-1] or 0 if lines else 0


def _one_scene(path: Path, names: dict[str, Any]) -> Scene:
    found = {id(value): value for value in names.values() if isinstance(value, Scene)}
    if len(found) == 1:
        return next(iter(found.values()))
    if not found:
        raise SceneFileError(f"{path}: makes no Scene; let it end with scene = Scene(name, body, design)")
    told = ", ".join(name for name, value in names.items() if isinstance(value, Scene))
    raise SceneFileError(f"{path}: makes {len(found)} scenes ({told}); keep one, and delete the others by `del`")

"""The commands `new`, `compare` and `optimize`: their words, and what they end with."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import mpmtop

DONE, WRONG, MOVED, STOPPED = 0, 1, 3, 130
"""What a command ends with; argparse ends with 2 where it cannot read the command."""
EXAMPLES = {
    "bridge": (),
    "bracket": (),
    "flexible_beam": (),
    "inverter": (),
    "scanned_hook": ("scanned_hook.csv",),
}
"""Scenes to begin with, the first if none is named, and the files that they read."""

TEACH = """\
Does it matter for your design which method you take, and whether points cross cells? Three steps:

  python -m mpmtop new my_scene.py        writes a commented scene that runs; change it to yours
  python -m mpmtop compare my_scene.py    optimises it by FEM, MPM, GIMP and B-splines, as seeded and crossed,
                                          judges every design by a fine reference, and writes one page:
                                          my_scene-compared/index.html
  python -m mpmtop optimize my_scene.py   one design by one method: VTU, picture, history

`python -m mpmtop COMMAND --help` says more. Ends with 0 if all went well, 1 if the scene or a number is wrong, 2 if
the command is, 3 if `--lock` finds that values have moved."""

COMPARE = """\
Optimise the scene of a file by several methods, with and without crossing of its points, judge all designs by the
fine reference, grey and cut to black and white, and write a page that says which method to use.

The file is Python and makes one mpmtop.Scene; it may also set h, ppc, methods, crossing, iterations, load_steps,
ghost and rule (`new` writes one). An interrupted comparison goes on where it was when started again, and what has
not changed is not computed again."""

CROSSING = """\
how points are moved in x before the analysis, in units of a cell's side; several with blanks between, quoted for their
brackets, numbers optional: none, as seeded; uniform(s), all points by s; periodic(n, d), the column left of every n-th
cell boundary by d; wave(n, d), by a sine of length n and amplitude d; bump(n, w, d), by up to d around every n-th
boundary, over a width w; jitter(d), each at random by up to d. Usual: none periodic(4, 0.26). FEM takes no
part: its mesh does not cross"""


def parser() -> argparse.ArgumentParser:
    """The commands."""
    of = argparse.ArgumentParser(
        "python -m mpmtop", description=TEACH, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    of.add_argument("--version", action="version", version=f"mpmtop {mpmtop.__version__}")
    commands = of.add_subparsers(dest="command", required=True, metavar="COMMAND")
    raw = argparse.RawDescriptionHelpFormatter
    new = commands.add_parser("new", help="write a commented scene that runs", description="Write a scene that runs.")
    new.add_argument("file", type=Path, help="file to write, my_scene.py; one that exists is left as it is")
    new.add_argument("--like", choices=EXAMPLES, default="bridge", help="which example (%(default)s)")
    compare = commands.add_parser(
        "compare", help="which method to use for a scene, on one page", description=COMPARE, formatter_class=raw
    )
    _add_common(compare)
    compare.add_argument(
        "--methods", nargs="+", metavar="M", help="some of fem mpm gimp bspline2 bspline3 (first four)"
    )
    compare.add_argument("--crossing", nargs="+", metavar="C", help=CROSSING)
    compare.add_argument("--jobs", type=_count, default=None, help="processes beside each other (all processors)")
    compare.add_argument("--hours", type=float, default=1.0, help="longest time that may be estimated (%(default)g)")
    compare.add_argument(
        "--lock",
        action="store_true",
        help="keep the values in my_scene.lock.csv beside the scene; if it is there, end with 3 where they moved",
    )
    compare.add_argument("--relock", action="store_true", help="keep the values anew")
    optimize = commands.add_parser(
        "optimize", help="one design by one method", description="Optimise the scene of a file by one method."
    )
    _add_common(optimize)
    optimize.add_argument("--method", default="gimp", help="fem, mpm, gimp, bspline2 or bspline3 (%(default)s)")
    optimize.add_argument("--crossing", default="none", metavar="C", help="as of compare, one (%(default)s)")
    optimize.add_argument("--every", type=_count, help="also a picture and a VTU of each N-th iteration, with a .pvd")
    return of


def _add_common(of: argparse.ArgumentParser) -> None:
    of.add_argument("file", type=Path, help="file that makes the scene")
    of.add_argument("--h", type=_sides, help="side of a cell, or two as 0.3,0.2963 (about 3,200 points)")
    of.add_argument("--ppc", type=_count, help="points per cell and direction (2)")
    of.add_argument("--iterations", type=_count, help="at most (300)")
    of.add_argument("--load-steps", type=_count, help="large deformation, in so many steps (small strain)")
    of.add_argument("--ghost", type=float, help="ghost penalty of mpm and gimp (0)")
    of.add_argument("--out", type=Path, help="folder to write to")


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 1 on")
    return int(text)


def _sides(text: str) -> float | tuple[float, float]:
    try:
        sides = tuple(float(part) for part in text.strip("()[] ").split(","))
    except ValueError:
        sides = ()
    if len(sides) not in (1, 2):
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor two with a comma, as 0.3,0.2963")
    return sides[0] if len(sides) == 1 else (sides[0], sides[1])


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns what it ends with."""
    given = parser().parse_args(argv)
    try:
        return {"new": _new, "compare": _compare, "optimize": _optimize}[given.command](given)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return STOPPED
    except (ValueError, OSError, RuntimeError) as error:
        print(f"mpmtop: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG


def _new(given: argparse.Namespace) -> int:
    if given.file.exists():
        raise ValueError(f"{given.file} is there already: give another name, or delete it")
    text = files("mpmtop").joinpath("examples", f"{given.like}.py").read_text("utf-8")
    for read in EXAMPLES[given.like]:
        beside = given.file.with_name(read)
        if not beside.exists():
            beside.write_bytes(files("mpmtop").joinpath("examples", read).read_bytes())
    given.file.write_text(text.replace(f"compare {given.like}.py", f"compare {given.file.name}"), "utf-8")
    print(f"{given.file}: a scene that runs; next, python -m mpmtop compare {given.file}")
    return DONE


def _settings(given: argparse.Namespace, stated: dict[str, Any], also: Sequence[str] = ()) -> dict[str, Any]:
    """Of the file, overridden by those of the command."""
    names = ("h", "ppc", "iterations", "load_steps", "ghost", *also)
    return stated | {name: value for name in names if (value := getattr(given, name)) is not None}


def _compare(given: argparse.Namespace) -> int:
    from mpmtop.comparison.asked import ask
    from mpmtop.comparison.compare import write
    from mpmtop.comparison.files import rows
    from mpmtop.comparison.lock import lock_path, moved_since, write_lock
    from mpmtop.comparison.progress import say
    from mpmtop.comparison.scene_file import read_scene
    from mpmtop.comparison.verdict import verdict

    for name in ("methods", "crossing"):
        if getattr(given, name):
            setattr(given, name, separated(" ".join(getattr(given, name))))
    scene, stated = read_scene(given.file)
    asked = ask(scene, **_settings(given, stated, ("methods", "crossing")))
    folder = given.out or Path(f"{given.file.stem}-compared")
    command = f"python -m mpmtop compare {given.file.name}{_options(given)}"
    jobs = given.jobs or len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    compared = write(asked, folder, command, jobs=jobs, hours=given.hours, live=sys.stderr.isatty())
    for word, sentences in verdict(compared.found).rows:
        for sentence in sentences:
            print(f"{word}: {sentence}")
    print(compared.page)
    lock, told = lock_path(given.file), rows(compared.found)
    if given.relock or (given.lock and not lock.exists()):
        write_lock(lock, told)
        say(f"values kept in {lock}")
    elif lock.exists():
        moved = moved_since(lock, told)
        for sentence in moved:
            say(f"moved since {lock}: {sentence}")
        if given.lock:
            say(f"{lock}: {len(moved)} values moved" if moved else f"{lock}: nothing moved")
            return MOVED if moved else DONE
    return DONE


def separated(text: str) -> list[str]:
    """Names with blanks or commas between them, but for those in brackets."""
    words, depth = [""], 0
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if depth == 0 and letter in ", ":
            words.append("")
        else:
            words[-1] += letter
    return [word for word in words if word]


def _options(given: argparse.Namespace) -> str:
    """Of the command, those that decide what is computed."""
    said = ""
    for name in ("h", "ppc", "iterations", "load_steps", "ghost", "methods", "crossing"):
        value = getattr(given, name)
        if value is not None:
            words = value if isinstance(value, list) else [",".join(f"{part:g}" for part in np.atleast_1d(value))]
            quoted = (f"'{word}'" if "(" in word else word for word in words)
            said += f" --{name.replace('_', '-')} {' '.join(quoted)}"
    return said


def _optimize(given: argparse.Namespace) -> int:
    from mpmtop.comparison.asked import ask
    from mpmtop.comparison.one import optimise
    from mpmtop.comparison.scene_file import read_scene

    scene, stated = read_scene(given.file)
    stated = {name: value for name, value in stated.items() if name not in ("methods", "crossing")}
    asked = ask(scene, **_settings(given, stated) | {"methods": (given.method,), "crossing": (given.crossing,)})
    folder = given.out or Path(f"{given.file.stem}-{given.method}")
    print(optimise(asked, folder, every=given.every, live=sys.stderr.isatty()))
    return DONE

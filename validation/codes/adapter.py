"""A code of one's own by its adapter: a class that says what it is capable of, and has these methods.

`--code my_adapter.py:MyCode` names a class in a file, or `module:MyCode`. It is made without arguments and has
`capabilities`, a set of words of `Capability`; `name`, `version` and `accuracy`, the relative error that its numerics
leave in an answer, are its own to give. For each way that it is capable of it has the method: `analyse(case)` gives
(u, stress) or (u, stress, compliance), u (p, 2) and stress (p, 3) by point, None for what it does not state;
`gradient(case)` (p,); `shape(x, half_length, grid)` (node, N, grad_N); `steps(case, count)` a list of (x, stress).
"""

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any, get_args

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from validation.codes.answers import Misanswered
from validation.codes.words import MEANINGS
from validation.methods.protocol import Answer, Capability, Case, Shape, Step

BEGUN: tuple[Capability, ...] = (
    "analysis",
    "quadrature at points",
    "points anywhere",
    "moduli by point",
    "body forces",
    "prescribed displacements",
)
"""Capabilities that a template states; the others stand in it as comments."""
TEMPLATE = '''"""An adapter: pytest validation --code FILE:Code, in which FILE is this file and Code the class below."""

import numpy as np

# import your code: modules beside this file are found


class Code:
    name = "{name}"
    version = ""
    accuracy = 0.0  # relative error that iterations or damping leave in an answer; 0 for rounding
    capabilities = {{  # take away what your code cannot do: it is then not asked for it
{words}    }}

    def analyse(self, case):
        """(u, stress): displacement (p, 2) and stress (p, 3), xx, yy, xy, at the points in their order."""
        points, grid, material = case.points, case.grid, case.body.material
        points.x, points.volume, points.half_length  # (p, 2), (p,), (p, 2): half the sides of the domains
        grid.origin, grid.h, grid.cells  # node (i, j) is at origin + (i, j) h
        material.poisson, material.plane, case.moduli  # "strain" or "stress"; Young's modulus (p,) by point
        case.carried  # (p, 2) force on each point, body force included: nodal forces are sum_p N_i(x_p) carried_p
        case.held.node, case.held.fixed, case.held.value  # (m, 2) each: indices (i, j), which components, where
        u, stress = np.zeros((len(points.x), 2)), np.zeros((len(points.x), 3))
        return u, stress
'''


def write_template(named: str) -> Path:
    """NAME or PATH, with or without its ".py"; NoAdapter if it is there, or no name of a module."""
    path = Path(named if named.endswith(".py") else f"{named}.py").absolute()
    if not path.stem.isidentifier() or path.exists():
        raise NoAdapter(f"{path}: {'it is there already' if path.exists() else 'no name of a Python module'}")
    words = "".join(
        f'        {"" if word in BEGUN else "# "}"{word}",  # {meaning}\n'
        for word, meaning in sorted(MEANINGS.items(), key=lambda item: item[0] not in BEGUN)
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(TEMPLATE.format(name=path.stem, words=words), "utf-8")
    return path


WAYS = {
    "analysis": "analyse",
    "gradient": "gradient",
    "load steps": "steps",
    "shape functions": "shape",
    "sheared domains": "shape_of_corners",
}
"""The method of each way in."""


class NoAdapter(ValueError):
    """What `--code` names is no adapter; the message says what to change."""


class Adapter:
    """A class of someone else's behind the protocol of methods."""

    def __init__(self, code: Any) -> None:
        self.code = code
        self.name = str(getattr(code, "name", type(code).__name__))
        self.version = str(getattr(code, "version", ""))
        self.accuracy = float(getattr(code, "accuracy", 0.0))
        self.capabilities: frozenset[Capability] = _capabilities(code)

    def analyse(self, case: Case) -> Answer:
        """As the code answers, in the protocol's form."""
        answer = self.code.analyse(case)
        if isinstance(answer, Answer):
            return answer
        if not isinstance(answer, tuple) or len(answer) not in (2, 3):
            raise Misanswered(f"`analyse` gave {type(answer).__name__}: give (u, stress) or (u, stress, compliance)")
        return Answer(*answer)

    def gradient(self, case: Case) -> Array:
        """As the code gives it."""
        slope: Array = self.code.gradient(case)
        return slope

    def steps(self, case: Case, count: int) -> list[Step]:
        """As the code gives them."""
        return [Step(*step) for step in self.code.steps(case, count)]

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        """As the code gives them."""
        return Shape(*self.code.shape(x, half_length, grid))

    def shape_of_corners(self, corners: Array, grid: Grid) -> Shape:
        """As the code gives them."""
        return Shape(*self.code.shape_of_corners(corners, grid))


def _capabilities(code: Any) -> frozenset[Capability]:
    known = get_args(Capability)
    stated = getattr(code, "capabilities", None)
    if stated is None or isinstance(stated, str):
        raise NoAdapter(f"{type(code).__name__} has no set of `capabilities`: give it one of words out of {known}")
    if unknown := sorted(set(stated) - set(known)):
        raise NoAdapter(f"{type(code).__name__}: {unknown} are no capabilities; there are {known}")
    for way, method in WAYS.items():
        if way in stated and not callable(getattr(code, method, None)):
            raise NoAdapter(f"{type(code).__name__} states {way!r} and has no method `{method}`: write it, or do not")
    return frozenset(stated)


def load_class(named: str) -> Adapter:
    """The adapter named FILE.py:CLASS or module:CLASS. NoAdapter if there is none."""
    place, _, name = named.rpartition(":")
    if not place or not name.isidentifier():
        raise NoAdapter(f"--code {named}: name a class, as in my_adapter.py:MyCode")
    if place.endswith(".py"):
        path = Path(place).resolve()
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if not path.is_file() or spec is None or spec.loader is None:
            raise NoAdapter(f"--code {named}: there is no file {path}")
        module = importlib.util.module_from_spec(spec)
        sys.path.insert(0, str(path.parent))  # so that the adapter finds the code beside it
        try:
            spec.loader.exec_module(module)
        finally:
            sys.path.remove(str(path.parent))
    else:
        try:
            module = importlib.import_module(place)
        except ModuleNotFoundError as error:
            raise NoAdapter(f"--code {named}: {error}") from error
    if not hasattr(module, name):
        raise NoAdapter(f"--code {named}: {place} has no {name}")
    return Adapter(getattr(module, name)())

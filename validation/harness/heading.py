"""What the test modules in a study's folder say of its page: how it is headed, and the order of its sections.

`test_<folder>.py` heads the page. A page that has grown long has its further sections in other modules beside it, so a
run of one of them alone must know the others: they are read, not imported.
"""

import ast
from collections import Counter
from dataclasses import dataclass
from inspect import cleandoc
from pathlib import Path
from typing import Any

STATED = ("ASKED", "FOUND", "SO", "THEN")
"""Constants of the module that heads the page."""


@dataclass(frozen=True)
class Heading:
    """Title and introduction are the docstring, "" if there is none, `asked` the constant ASKED, `found` and `so` the
    constants FOUND and SO of the module that heads the page; `tests` the sections in the order of the page: those of
    that module, of the modules that its constant THEN names, and of any other by name."""

    docstring: str
    asked: str
    found: tuple[str, ...]
    so: tuple[str, ...]
    tests: tuple[str, ...]


def heading_of(folder: Path) -> Heading:
    """The heading of the page of a study.

    Raises ValueError if no module heads the page, if one of its constants is computed or THEN names no module beside
    it, and if two sections of the page have one name: claims and locks are told apart by it.
    """
    main = folder / f"test_{folder.name}.py"
    if not main.exists():
        raise ValueError(
            f"no {main.name} in {folder}: the module of that name heads the page, rename one or the folder"
        )
    tree = ast.parse(main.read_text("utf-8"))
    stated = _constants(tree, main)
    then = tuple(stated.get("THEN", ()))
    others = sorted(path.stem for path in folder.glob("test_*.py") if path != main)
    if lost := [name for name in then if name not in others]:
        raise ValueError(f"THEN of {main} names {lost[0]!r}: no such module beside it")
    order = [*then, *(name for name in others if name not in then)]
    trees = [tree, *(ast.parse((folder / f"{name}.py").read_text("utf-8")) for name in order)]
    tests = [node.name for tree in trees for node in tree.body if isinstance(node, ast.FunctionDef)]
    tests = [name for name in tests if name.startswith("test_")]
    if twice := [name for name, count in Counter(tests).items() if count > 1]:
        raise ValueError(f"two sections in {folder} are called {twice[0]!r}: claims and locks need different names")
    found, so = (tuple(stated.get(name, ())) for name in ("FOUND", "SO"))
    return Heading(ast.get_docstring(tree) or "", cleandoc(stated.get("ASKED", "")), found, so, tuple(tests))


def _constants(tree: ast.Module, path: Path) -> dict[str, Any]:
    """The constants of a module that say something of its page."""
    found = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id in STATED:
            try:
                found[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError as error:
                raise ValueError(f"{node.targets[0].id} of {path} is computed: write its text out") from error
    return found

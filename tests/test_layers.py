"""The architecture: who may import whom."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mpmtop

ROOT = Path(__file__).parent.parent
ORDER = [
    *("page", "page.numbers", "page.once", "page.drawing", "page.templates"),
    *("arrays", "errors", "curves", "region", "outline", "loads", "body", "design", "criteria", "scene"),
    *(
        "grid",
        "points",
        "cut",
        "crossing",
        "quadtree",
        "shape_functions",
        "voigt",
        "transfer",
        "b_bar",
        "ghost",
        "ties",
        "material",
    ),
    *("gaps", "diagnose"),
    *("stiffness", "solvers.pattern", "solvers.checked", "solvers.banded", "solvers.superlu", "solvers.dissection"),
    *(
        "solvers.fronts",
        "solvers.elimination",
        "solvers.sparse_cholesky",
        "solvers.stencil",
        "solvers.multigrid",
        "solvers.multigrid_cg",
        "solvers",
    ),
    *("forces", "model", "mechanism", "equilibrium", "objectives"),
    *("filter", "projection", "symmetry", "variables", "cases", "fingerprint", "problem", "planning"),
    *(f"optimizers.{name}" for name in ("protocols", "subproblem", "state", "mma", "gcmma", "optimality_criteria")),
    *(f"optimizers.{name}" for name in ("start", "stopping", "checkpoint", "loop")),
    *("optimizers", "fields", "at_points", "export", "cloud", "scene_plot", "plot"),
    *(
        f"large_deformation.{name}"
        for name in ("law", "kinematics", "background", "assembly", "model", "step", "newton", "steps")
    ),
    *(f"large_deformation.{name}" for name in ("adjoint", "objectives", "at_points", "problem")),
    "large_deformation",
    *(
        f"comparison.{name}"
        for name in ("asked", "progress", "crossed", "methods", "judging", "runs", "entries", "pictures")
    ),
    *(f"comparison.{name}" for name in ("files", "verdict", "page", "lock", "scene_file", "compare", "one", "command")),
    *("comparison", "__main__"),
]
EXTRA = {
    "export": {"meshio"},
    "scene_plot": {"matplotlib"},
    "plot": {"matplotlib", "IPython"},
    "page.once": {"matplotlib"},
    "page.drawing": {"matplotlib", "cycler"},
    "page.templates": {"jinja2"},
}
"""What a module may import beside numpy and scipy."""
BOTH = {"reference_fem", "matplotlib", "jinja2", "joblib"}
"""What a comparison may, too: it is on top of both solvers, as a user is, and neither knows of it."""
LIBRARIES = {"mpmtop": {"numpy", "scipy"}, "reference_fem": {"numpy", "scipy", "skfem", "mpmtop"}}
STATED = ("arrays", "errors", "region", "outline", "loads", "body", "design", "criteria", "scene")
STATEMENT = {f"mpmtop.{name}" for name in STATED}
ALGEBRA = {"mpmtop.solvers.pattern", "mpmtop.solvers.sparse_cholesky"}
"""A matrix on a pattern and its factorisation: no mechanics, checked by SuperLU and by dense equations."""
UNTOLD = {"__init__", "__main__", "arrays"}
"""Modules that the contents do not name: the package itself, its commands, and types."""
STANDARD = sys.stdlib_module_names


def imports(path: Path) -> set[str]:
    """Full names of all modules that the file imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module or "")
    return found


def modules(package: str) -> list[Path]:
    """All but the package itself and its examples, which are scripts of a user."""
    found = (ROOT / package).rglob("*.py")
    return sorted(
        p for p in found if p.parent.name != "examples" and (p.parent.name != package or p.stem != "__init__")
    )


def name_of(path: Path) -> str:
    """Dotted name below mpmtop; a subpackage's `__init__` has the subpackage's."""
    parts = path.relative_to(ROOT / "mpmtop").with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def test_every_module_has_its_place() -> None:
    assert {name_of(p) for p in modules("mpmtop")} == set(ORDER)


@pytest.mark.parametrize("path", modules("mpmtop"), ids=name_of)
def test_mpmtop_imports_go_one_way(path: Path) -> None:
    allowed = {f"mpmtop.{name}" for name in ORDER[: ORDER.index(name_of(path))]}
    for name in imports(path):
        top = name.split(".")[0]
        at_top = name_of(path).startswith("comparison.")
        extra = BOTH if at_top else EXTRA.get(name_of(path), set())
        known = top in LIBRARIES["mpmtop"] | STANDARD | extra or (at_top and name == "mpmtop")
        assert name in allowed or known, f"{name_of(path)} imports {name}"


@pytest.mark.parametrize("path", modules("reference_fem"), ids=lambda p: p.stem)
def test_reference_fem_is_independent(path: Path) -> None:
    for name in imports(path):
        top = name.split(".")[0]
        if top == "mpmtop":
            shared = STATEMENT | {"mpmtop.optimizers.protocols", "mpmtop.fields"} | ALGEBRA
            assert name in shared, f"{path.stem} imports {name}"
        else:
            assert top in LIBRARIES["reference_fem"] | STANDARD | {"reference_fem"}, f"{path.stem} imports {name}"


ROOMS: dict[str, set[str]] = {
    "contents": {"harness"},
    "harness": {"contents"},
    "paper": {"harness"},
    "measures": set(),
    "oracles": set(),
    "bodies": {"measures", "harness"},
    "methods": {"measures", "bodies", "harness"},
    "codes": {"methods", "bodies", "measures"},
    "studies": {"harness", "paper", "measures", "oracles", "bodies", "methods", "codes"},
    "conftest": {"harness"},
    "__main__": {"harness", "contents", "codes"},
    "examples": set(),
}
"""What a room of `validation` may import besides itself, and either solver, but for those that know no mechanics."""
KNOW_NO_MECHANICS = {"__main__", "contents", "harness", "paper", "conftest"}


def room_of(name: str) -> str:
    """Room of a module of `validation` by its dotted name; that of a study is its folder."""
    _, room, *inner = name.split(".")
    return ".".join([room, *inner[:-1]]) if room == "studies" else room


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def of_validation(path: Path) -> set[str]:
    """Modules of `validation` that the file imports; `from validation.bodies import column` names a module."""
    found = imports(path)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (ROOT / (node.module or "").replace(".", "/")).is_dir():
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {
        name for name in found if name.startswith("validation.") and (ROOT / name.replace(".", "/")).is_dir() is False
    }


@pytest.mark.parametrize(
    "path", sorted(p for p in ROOT.glob("validation/**/*.py") if p != ROOT / "validation" / "__init__.py"), ids=dotted
)
def test_rooms_of_validation(path: Path) -> None:
    """Studies import the rooms, never one another; no room imports a study, and the harness neither solver."""
    room = room_of(dotted(path))
    kind = room.split(".")[0]
    for name in of_validation(path):
        other = room_of(name)
        assert other == room or other in ROOMS[kind], f"{dotted(path)} imports {name}"
    tops = {name.split(".")[0] for name in imports(path) if not name.startswith("mpmtop.page.")}
    assert "tests" not in tops
    if kind in KNOW_NO_MECHANICS:
        assert not tops & {"mpmtop", "reference_fem"}, f"{dotted(path)} knows mechanics"


def test_the_face_is_light_and_reads_as_contents() -> None:
    """`import mpmtop` loads no library and no module of its own; each of its names comes from where it lives, in the
    stub for type checkers as at run time; what the contents name exists."""
    loaded = (
        "import sys, mpmtop; print(sorted(m for m in sys.modules if m.split('.')[0] in {'numpy', 'scipy', 'mpmtop'}))"
    )
    printed = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True, cwd=ROOT)
    assert printed.stdout.strip() == "['mpmtop']"
    tree = ast.parse((ROOT / "mpmtop" / "__init__.py").read_text())
    stub = {
        alias.name: str(node.module)
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    lazy = {name: f"mpmtop.{module}" for name, module in mpmtop._HOME.items()}
    assert stub == lazy | {"export": "mpmtop", "plot": "mpmtop"}
    for name in lazy:
        assert getattr(mpmtop, name).__name__ == name
    contents = (mpmtop.__doc__ or "").split("What a script needs")[0]
    assert all(re.search(rf"\b{name}\b", contents) for name in lazy)
    assert all(re.search(rf"\b{p.stem}\b", contents) for p in (ROOT / "mpmtop").glob("*.py") if p.stem not in UNTOLD)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        mpmtop.nothing  # noqa: B018


def test_the_readme_s_examples_run(tmp_path: Path) -> None:
    """On a quarter of their body, so that they take a second."""
    example = "".join(part.split("```")[0] for part in (ROOT / "README.md").read_text().split("```python\n")[1:])
    smaller = example.replace("40.0", "10.0").replace("20.0", "5.0").replace("(10.0, 10.0)", "(10.0, 2.5)")
    subprocess.run(
        [sys.executable, "-c", smaller], check=True, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    assert (tmp_path / "beam.vtu").exists() and (tmp_path / "beam.png").exists()


LONGEST_MODULE, LONGEST_FUNCTION = 350, 60
"""Lines. What is longer is not read at one sitting. Recorded sections of studies may be longer by a quarter: what a
section asks, measures and tells is one text."""


@pytest.mark.parametrize("package", ["mpmtop", "reference_fem", "validation", "tests"])
def test_modules_fit_in_one_reading(package: str) -> None:
    long = []
    for path in modules(package):
        text = path.read_text()
        name = path.relative_to(ROOT)
        long += [f"{name}: {n} lines"] if (n := len(text.splitlines())) > LONGEST_MODULE else []
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                section = package == "validation" and node.name.startswith("test_")
                if lines > LONGEST_FUNCTION * (1.25 if section else 1):
                    long.append(f"{name}: {node.name} has {lines} lines")
    assert not long


@pytest.mark.parametrize("path", sorted((ROOT / "mpmtop" / "examples").glob("*.py")), ids=lambda p: p.stem)
def test_examples_import_what_a_user_does(path: Path) -> None:
    """The face of the library, NumPy and the standard library."""
    assert all(name == "mpmtop" or name.split(".")[0] in STANDARD | {"numpy"} for name in imports(path))


def test_the_library_loads_no_drawing_and_no_elements_until_they_are_used() -> None:
    """Whatever a script takes from the face but `compare`; the face alone within a second of processor time."""
    names = [name for name in mpmtop._HOME if name != "compare"]
    script = f"""
import sys, time
import mpmtop
print(time.process_time())
for name in {names!r}: getattr(mpmtop, name)
print(sorted(m for m in ("matplotlib", "skfem", "meshio", "jinja2", "joblib", "pandas") if m in sys.modules))
"""
    printed = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    seconds, loaded = printed.stdout.splitlines()
    assert float(seconds) < 1.0 and loaded == "[]"

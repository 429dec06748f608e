"""The page of the examples in `mpmtop/examples`: each compared, with its picture and what came out."""

import sys
from pathlib import Path

from mpmtop.comparison.asked import NONE, ask
from mpmtop.comparison.command import EXAMPLES
from mpmtop.comparison.compare import write
from mpmtop.comparison.entries import Comparison
from mpmtop.comparison.scene_file import read_scene
from mpmtop.comparison.verdict import ranked, verdict

FOLDER = Path(__file__).parent.parent / "mpmtop" / "examples"
HEAD = """# Scenes that are not the paper's

Each is a file to begin with: `python -m mpmtop new my_scene.py --like NAME`, then
`python -m mpmtop compare my_scene.py`. Below, the best design in truth of each, and what the comparison said; written
by `python -m validation.examples FOLDER`. They lie in the library so that `new` has them wherever it is installed.
"""


def write_examples(kept: Path, jobs: int) -> None:
    """Compare every example, in a folder where comparisons are kept, and write the page and its pictures."""
    parts = [HEAD]
    for name in EXAMPLES:
        scene, settings = read_scene(FOLDER / f"{name}.py")
        command, folder = f"python -m mpmtop compare {name}.py", kept / name
        found = write(ask(scene, **settings), folder, command, jobs=jobs, hours=1.0, live=False).found
        best = ranked(found.under(NONE))[0]
        (FOLDER / f"{name}.png").write_bytes((folder / "files" / f"{best.slug}.png").read_bytes())
        parts.append(told(name, found, best.label))
    (FOLDER / "README.md").write_text("\n".join(parts), "utf-8")


def told(name: str, found: Comparison, best: str) -> str:
    """An example's section."""
    lines = [f"## {found.asked.scene.name}: `{name}.py`\n", f"![Design by {best}]({name}.png)\n"]
    lines += [f"- **{word}.** {sentence}" for word, sentences in verdict(found).rows for sentence in sentences]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write_examples(Path(sys.argv[1]), jobs=2)

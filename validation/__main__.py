"""`python -m validation diff A B [-o PAGE]`: what moved between the reports in two folders, as a page.

`python -m validation pages [DIR]`: the pages of a report anew from its stores, no study runs.

`python -m validation readme`: the findings of `reports/` into README.md.
`python -m validation cases DIR`: all that a code is asked, as files.

`python -m validation adapter NAME`: a class to begin with, in NAME.py; NAME may be a path.
"""

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from mpmtop.page.numbers import number
from validation.contents import CONTENTS
from validation.harness.claims import Tally
from validation.harness.diff import compare
from validation.harness.overview import DESIGNS, Overview
from validation.harness.pages import rendered_diff, replace, republish
from validation.harness.store import read

ROOT = Path(__file__).parents[1]


BEGIN, END = "<!-- findings: written by `make validate`, from the report -->\n", "<!-- end of findings -->"


def with_findings(readme: str, directory: Path) -> str:
    """The README with the front page's figure and sentences between its two marks, from the stores in a report."""
    studies = read(directory)
    overview = Overview([studies[name] for name in CONTENTS.ordered(studies)], CONTENTS)
    picture = f"![Designs side by side, own and true objective over each]({directory.name}/{DESIGNS})"
    headline = Tally.of([reading for study in overview.studies for reading in study.readings]).headline()
    findings = [
        f"**{topic}.** {sentence}"
        for topic, sentences in overview.answers.items()
        for sentence in [told for told, _ in sentences] + [headline] * (topic == "The paper" and bool(headline))
        if topic != CONTENTS.advice
    ]
    advice = " ".join(sentence for sentence, _ in overview.answers.get(CONTENTS.advice, []))
    text = f"{picture}\n\n" * bool(overview.bodies)
    text += "".join(f"{number}. {sentence}\n" for number, sentence in enumerate(findings, 1))
    text += f"\n**{CONTENTS.advice}.** {advice}\n" * bool(advice)
    before, _, rest = readme.partition(BEGIN)
    if not rest:
        raise ValueError(f"README.md has no line {BEGIN.strip()}: put it where the findings belong")
    return before + BEGIN + text + END + rest.partition(END)[2]


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page and say in a line what is on it; 1 if anything moved."""
    parser = argparse.ArgumentParser(prog="python -m validation", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    diff = commands.add_parser("diff", help="compare the reports in two folders")
    diff.add_argument("before", type=Path)
    diff.add_argument("after", type=Path)
    diff.add_argument("-o", "--output", type=Path, default=Path("diff.html"), help="the page (default: diff.html)")
    commands.add_parser("readme", help="write the findings of reports/ into README.md")
    pages = commands.add_parser("pages", help="write the pages of a report anew from its stores")
    pages.add_argument("folder", type=Path, nargs="?", default=ROOT / "reports", help="default: reports")
    cases = commands.add_parser("cases", help="write all that a code is asked, as files")
    cases.add_argument("folder", type=Path)
    adapter = commands.add_parser("adapter", help="write NAME.py, an adapter to fill in")
    adapter.add_argument("name", metavar="NAME", help="of the file, or its path, as in /home/me/checks/mine.py")
    given = parser.parse_args(arguments)
    if given.command in ("cases", "adapter"):  # what the report's own commands need not wait for
        from validation.codes.adapter import NoAdapter, write_template
        from validation.codes.checks import every
        from validation.codes.files import write_cases
    if given.command == "cases":
        print(
            f"{given.folder}: {write_cases(given.folder, every())} cases, and SCHEMA.md, which says how to answer them"
        )
        return 0
    if given.command == "adapter":
        try:
            path = write_template(given.name)
            print(f"wrote {path}; fill in its class Code, then, in {ROOT}:")
            code, report = shlex.quote(f"{path}:Code"), shlex.quote(str(path.parent / "report"))
            print(f"pytest validation --code {code} --reports {report}")
        except NoAdapter as error:
            parser.error(str(error))
        return 0
    if given.command == "pages":
        republish(given.folder, CONTENTS)
        return 0
    if given.command == "readme":
        readme = ROOT / "README.md"
        replace(readme, with_findings(readme.read_text("utf-8"), ROOT / "reports"))
        return 0
    try:
        found = compare(given.before, given.after)
    except ValueError as error:
        parser.error(str(error))
    replace(given.output, rendered_diff(found))
    largest = max((abs(moved.change) for moved in found.claims if moved.change is not None), default=0.0)
    print(
        f"{given.output}: {found.compared:,} numbers compared; moved: {len(found.claims)} claims (by {number(largest)} "
        f"of themselves at most), {len(found.verdicts)} verdicts, {len(found.cells)} cells, {len(found.locks)} locked "
        f"values, {len(found.figures)} figures"
    )
    return int(not found.same)


if __name__ == "__main__":
    sys.exit(main())

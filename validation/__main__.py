"""`python -m validation diff A B [-o PAGE]`: what moved between the reports in two folders, as a page."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from validation.harness.diff import compare
from validation.harness.pages import rendered_diff, replace
from validation.harness.show import number


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page and say in a line what is on it; 1 if anything moved."""
    parser = argparse.ArgumentParser(prog="python -m validation", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    diff = commands.add_parser("diff", help="compare the reports in two folders")
    diff.add_argument("before", type=Path)
    diff.add_argument("after", type=Path)
    diff.add_argument("-o", "--output", type=Path, default=Path("diff.html"), help="the page (default: diff.html)")
    given = parser.parse_args(arguments)
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

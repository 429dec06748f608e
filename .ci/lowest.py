"""The lowest versions that pyproject.toml admits, as constraints: `name==bound` for each dependency of the tests."""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
extras = project["optional-dependencies"]
for requirement in (*project["dependencies"], *extras["test"], *extras["cluster"]):
    if requirement.startswith(project["name"] + "["):
        continue  # an extra of our own
    bound = re.match(r"([\w.-]+)\s*>=\s*([\w.]+)", requirement)
    if bound is None:
        sys.exit(f"{requirement!r} in pyproject.toml has no lower bound: give the lowest version that works, name>=...")
    print("{}=={}".format(*bound.groups()))

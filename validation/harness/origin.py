"""Where a report comes from: commit, command, date, machine, packages."""

import importlib.metadata
import os
import platform
import re
import shlex
import subprocess
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import pytest

PACKAGES = ("mpmtop", "numpy", "scipy", "scikit-fem", "meshio", "pandas", "matplotlib", "pytest")


def provenance_of(config: pytest.Config, directory: Path, seconds: float) -> dict[str, str]:
    """Where the report comes from: shown at the foot of the HTML pages only, as it differs from run to run."""
    root = config.rootpath
    # The report is what the run changes: only a change elsewhere makes its numbers another commit's.
    others = [f":(exclude){directory.relative_to(root)}"] if directory.is_relative_to(root) else []
    commit = _git(root, "rev-parse", "HEAD")
    changes = _git(root, "status", "--porcelain", "--", ".", *others)
    packages = []
    for name in PACKAGES:
        with suppress(importlib.metadata.PackageNotFoundError):
            packages.append(f"{name} {importlib.metadata.version(name)}")
    return {
        "commit": (commit or "not a git checkout") + (" with uncommitted changes" if changes else ""),
        "command": shlex.join(["pytest", *map(str, config.invocation_params.args)]),
        "date": datetime.now(UTC).isoformat(sep=" ", timespec="seconds"),
        "duration": f"{seconds:.1f} s",
        "python": platform.python_version(),
        "packages": ", ".join(packages),
        "machine": f"{platform.system()} {platform.machine()}, {_processor()}, {os.cpu_count()} logical cores, "
        f"BLAS threads: {os.environ['OPENBLAS_NUM_THREADS']}, "
        f"kernels: {os.environ.get('OPENBLAS_CORETYPE', 'the processor')}",
    }


def _git(root: Path, *arguments: str) -> str:
    """Output of a git command, "" where git or the repository is missing."""
    try:
        done = subprocess.run(["git", "-C", root, *arguments], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()


def _processor() -> str:
    """Model of the processor: Linux tells it here only, other systems through `platform`."""
    try:
        model = re.search(r"model name\s*: (.+)", Path("/proc/cpuinfo").read_text())
    except OSError:
        model = None
    return model[1] if model else platform.processor() or "processor unknown"

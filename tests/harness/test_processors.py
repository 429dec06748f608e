"""Committed files of the report are the same on every processor: short studies, started with the kernels of two."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mpmtop.page.drawing import numbered
from tests.harness.studies import ROOT, committed

STUDIES = ("removal", "errata", "locking")
KERNELS = ("Haswell", "Nehalem")
"""Processors whose kernels OpenBLAS sums with: with fused multiply and add in vectors of four, and without in two."""


@pytest.mark.slow
def test_another_processor_writes_the_same_files(tmp_path: Path) -> None:
    for kernel in KERNELS:
        environment = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
        environment.pop("PYTEST_XDIST_WORKER", None)  # a run of its own, also beside other tests
        studies = [f"validation/studies/{study}" for study in STUDIES]
        options = ["-q", "-n", "0", "-p", "no:cacheprovider", "--reports", str(tmp_path / kernel)]
        command = [sys.executable, "-m", "pytest", *studies, *options]
        subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    first, second = (committed(tmp_path / kernel) for kernel in KERNELS)
    assert first.keys() == second.keys()
    assert len(first) > 2 * len(STUDIES)
    assert not [file for file in first if first[file] != second[file]]


def test_clips_are_named_by_their_order() -> None:
    """Matplotlib's own names hang on the last bits of a layout."""
    one, other = (
        b'<clipPath id="p%b"/><clipPath id="p%b"/><g clip-path="url(#p%b)"/>' % names
        for names in ((b"de9162181f", b"82d9da8905", b"82d9da8905"), (b"3cbcc91b9a", b"6d44b3c802", b"6d44b3c802"))
    )
    assert numbered(one, "a") == numbered(other, "a") != numbered(one, "b")
    assert b"de9162181f" not in numbered(one, "a")

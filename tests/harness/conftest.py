"""The report of two studies."""

from pathlib import Path

import pytest

from tests.harness.studies import CROSSING, LOCKED, OTHER, run, write_study


@pytest.fixture(scope="package")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder of two studies that were run once, and what pytest printed."""
    folder = tmp_path_factory.mktemp("studies")
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = benchmark\n")
    write_study(folder, "crossing", CROSSING)
    write_study(folder, "other", OTHER)
    (folder / LOCKED).parent.mkdir()
    (folder / LOCKED).write_text(",kept,dropped\n0,1.0,2.0\n")
    return folder, run(folder)

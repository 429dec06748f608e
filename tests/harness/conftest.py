"""The report of two studies, and a browser."""

import shutil
import subprocess
from collections.abc import Callable
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


BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
FLAGS += "--disable-component-update --disable-sync --window-size=2000,1000"


@pytest.fixture(scope="package")
def browse(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """What a browser prints of a page, with options of its command line."""
    browser = next((path for path in map(shutil.which, BROWSERS) if path), None)
    if browser is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is installed: the pages are not tried in a browser")
    profile = f"--user-data-dir={tmp_path_factory.mktemp('profile')}"

    def browsed(page: Path, *options: str) -> str:
        command = [browser, *FLAGS.split(), profile, *options, page.as_uri()]
        return subprocess.run(command, capture_output=True, text=True, timeout=600, check=True).stdout

    return browsed

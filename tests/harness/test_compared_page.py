"""The page of a comparison in a browser: on a phone, a screen, in the dark, on paper, without a network."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mpmtop.comparison.compare import compare
from tests.harness.test_browser import measured
from tests.mpmtop.comparison.scenes import BEAM

pytestmark = pytest.mark.slow
PICTURES = 2 * 4 + 3
"""Each of four designs, grey and cut; histories, the scene, the patterns."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a few iterations, moved to where none of its files are."""
    folder = tmp_path_factory.mktemp("compared")
    made = compare(BEAM, h=1.0, iterations=4, methods=("fem", "mpm", "gimp"), out=folder / "out").page
    return made.rename(folder / "alone.html")


@pytest.mark.parametrize("width", [390, 1300])
def test_it_fits_phone_and_screen(page: Path, browse: Callable[..., str], tmp_path: Path, width: int) -> None:
    found = measured(browse, page, tmp_path, width, "--host-resolver-rules=MAP * 127.0.0.1:9")
    assert found["needed"] == found["shown"] <= width
    assert len(found["drawn"]) == PICTURES
    assert all(size > 50 for size in found["drawn"])  # px; a picture that failed to load measures 0 or an icon's 16
    assert not found["bare"]
    if width == 1300:
        assert not found["cut"]


def test_it_prints_and_turns_dark(page: Path, browse: Callable[..., str], tmp_path: Path) -> None:
    browse(page, f"--print-to-pdf={tmp_path / 'page.pdf'}")
    assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF")
    dark = measured(browse, page, tmp_path, 1300, "--blink-settings=preferredColorScheme=0")
    assert dark["ground"] == "rgb(20, 24, 30)"

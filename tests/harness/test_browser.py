"""The pages in a real browser."""

import html
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest_plugins = ["pytester"]

MEASURE = """<!DOCTYPE html><title>not measured</title>
<iframe style="width:{width}px;height:800px;border:0" srcdoc="{page}"></iframe>
<script>
addEventListener("load", () => {{
  const page = document.querySelector("iframe").contentDocument, root = page.documentElement;
  for (const fold of page.querySelectorAll("details")) fold.open = true;
  const drawn = [...page.images].map(i => i.naturalWidth && Math.min(i.clientWidth, i.clientHeight));
  const cut = [...page.querySelectorAll(".scroll")].filter(t => t.scrollWidth > t.clientWidth + 1);
  const bare = [...page.querySelectorAll("input, select")].filter(i => !i.labels.length).length;
  const form = page.querySelector(".filters");
  let filtered = null;
  if (form) {{
    form.elements.state.value = "differs";
    form.dispatchEvent(new Event("input"));
    filtered = [...page.querySelectorAll("tbody.stand")].filter(row => row.offsetParent).map(row => row.dataset.kind);
    form.elements.text.value = "no such words";
    form.dispatchEvent(new Event("input"));
    filtered.push(form.querySelector("output").textContent);
  }}
  document.title = JSON.stringify({{shown: root.clientWidth, needed: root.scrollWidth, drawn: drawn,
    cut: cut.map(table => table.getAttribute("aria-label")), bare: bare, filtered: filtered,
    ground: getComputedStyle(page.body).backgroundColor}});
}});
</script>"""


def measured(browse: Callable[..., str], page: Path, folder: Path, width: int, *options: str) -> dict[str, Any]:
    """Of a page in a window of a width: widths shown and needed, sizes of pictures, tables that are cut, fields without
    a label, kinds of the claims that differ after filtering by that, and what filtering by other words says."""
    framed = folder / f"{page.stem}_{width}.html"
    framed.write_text(MEASURE.format(page=html.escape(page.read_text()), width=width))
    title = re.search(r"<title>(.*?)</title>", browse(framed, "--dump-dom", *options))
    assert title is not None
    found: dict[str, Any] = json.loads(html.unescape(title[1]))
    return found


@pytest.mark.parametrize(("name", "pictures"), [("index", 1), ("claims", 0), ("crossing", 2)])
@pytest.mark.parametrize("width", [390, 1300])
def test_pages_fit_phone_and_screen(
    studied: tuple[Path, str], browse: Callable[..., str], tmp_path: Path, name: str, pictures: int, width: int
) -> None:
    found = measured(browse, studied[0] / "reports" / f"{name}.html", tmp_path, width)
    assert found["shown"] <= width
    assert found["needed"] == found["shown"], f"{name} scrolls sideways"
    assert len(found["drawn"]) == pictures
    assert all(size > 50 for size in found["drawn"])  # px; a picture that failed to load measures 0 or an icon's 16
    assert not found["bare"]
    if width == 1300:
        assert not found["cut"]
    assert found["filtered"] == (["result", "0 of 4"] if name == "claims" else None)


def test_pages_print_and_turn_dark(studied: tuple[Path, str], browse: Callable[..., str], tmp_path: Path) -> None:
    page = studied[0] / "reports" / "crossing.html"
    browse(page, f"--print-to-pdf={tmp_path / 'page.pdf'}")
    pdf = (tmp_path / "page.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/Image" in pdf  # the figure's points
    grounds = {
        scheme: measured(browse, page, tmp_path, 1300, f"--blink-settings=preferredColorScheme={value}")["ground"]
        for scheme, value in (("dark", 0), ("light", 1))
    }
    assert grounds == {"dark": "rgb(20, 24, 30)", "light": "rgb(255, 255, 255)"}

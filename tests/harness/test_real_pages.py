"""Every page of the committed report in a browser: what is cut, out of sight, a wall of words or without a name.

The pages are written anew from the stores, and one browser looks at all of them: as wide as a laptop, a large screen
and a phone; dark; and with the rules of print on the width of its paper.
"""

import html
import json
import re
import shutil
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from validation.__main__ import BEGIN, END
from validation.contents import CONTENTS
from validation.harness.overview import DESIGNS
from validation.harness.pages import republish

ROOT = Path(__file__).parents[2]
REPORTS = ROOT / "reports"
LAPTOP, SCREEN, PHONE, PAPER = 1300, 1920, 390, 673
"""Widths [CSS px]; PAPER is A4 less the margins that the pages ask for, 178 mm."""
WORDS = 120
"""Words above the first figure, median over the pages: what is read in half a minute."""
MEGABYTE = 1e6
LOOK = """<!DOCTYPE html><title>not looked at</title><body><script>
const found = {};
const visible = node => {
  for (const fold of node.querySelectorAll("details"))
    for (const part of [...fold.childNodes]) if (part.nodeName !== "SUMMARY") part.remove();
  return node.textContent.split(/\\s+/).filter(Boolean).length;
};
function wordsAbove(page) {
  const figure = page.querySelector("main .card img, main .gallery img, main canvas, main .track");
  if (!figure) return null;
  const range = page.createRange();
  range.selectNodeContents(page.querySelector("main"));
  range.setEndBefore(figure.closest("figure, table, .gallery"));
  return visible(range.cloneContents());
}
function look(page, view) {
  const images = [...page.images];  // those of a slider are hidden behind its canvas
  const root = page.documentElement, shown = [...page.querySelectorAll("main *")].filter(e => e.clientWidth > 1);
  return {
    sideways: root.scrollWidth - root.clientWidth,
    cut: [...page.querySelectorAll(".scroll")].filter(t => t.scrollWidth > t.clientWidth + 1)
      .map(t => t.getAttribute("aria-label")),
    clipped: shown.filter(e => e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX === "hidden")
      .map(e => e.textContent.trim().slice(0, 60)),
    shrunk: images.filter(i => !i.closest("[hidden]") && i.naturalWidth && i.clientWidth < 0.6 * i.width)
      .map(i => i.alt),
    broken: images.filter(i => !i.naturalWidth || (!i.closest("[hidden]") && i.clientHeight < 20)).map(i => i.alt),
    ground: getComputedStyle(page.body).backgroundColor,
    unturned: [...page.querySelectorAll(".card, .gallery img")]
      .filter(e => getComputedStyle(e).filter === "none").length,
  };
}
function above(page) {
  const failed = page.querySelector("main > p.failed"), top = e => e.getBoundingClientRect().top;
  return failed ? top(failed.nextElementSibling) - top(failed) : 0;
}
function turn(page, kind, on, off) {
  for (const sheet of page.styleSheets) for (const rule of sheet.cssRules)
    if (rule.media && rule.media.mediaText.includes(kind)) rule.media.mediaText = on;
    else if (rule.media && off && rule.media.mediaText.includes(off)) rule.media.mediaText = "speech";
}
const settled = () => new Promise(done => setTimeout(done, 0));
async function all() {
  for (const [name, source] of Object.entries(PAGES)) {
    const frame = document.createElement("iframe");
    frame.style = "border:0;width:LAPTOPpx;height:900px";
    frame.src = source;
    document.body.append(frame);
    await new Promise(done => frame.onload = done);
    const page = frame.contentDocument, nav = page.querySelector("nav"), here = nav.querySelector("[aria-current]");
    const names = [...page.querySelectorAll("[id]")].map(e => e.id);
    const result = found[name] = {
      words: wordsAbove(page),
      height: [...page.querySelectorAll(".designs")]
        .map(e => e.getBoundingClientRect().bottom - above(page))[0] ?? null,
      inSight: here ? here.getBoundingClientRect().bottom <= nav.getBoundingClientRect().bottom + 1 : null,
      bare: [...page.querySelectorAll("input, select, canvas, output, .scroll, img")]
        .filter(e => !(e.labels?.length || e.getAttribute("aria-label") || e.alt || e.getAttribute("aria-live")))
        .length,
      tables: page.querySelectorAll("table").length,
      twice: names.filter((id, k) => names.indexOf(id) !== k),
      ids: names,
      links: [...page.querySelectorAll("a[href]")].map(a => a.getAttribute("href")),
      views: {},
    };
    for (const fold of page.querySelectorAll("details")) fold.open = true;
    for (const width of [LAPTOP, SCREEN, PHONE]) {
      frame.style.width = width + "px";
      await settled();
      result.views[width] = look(page, width);
    }
    frame.style.width = "LAPTOPpx";
    turn(page, "prefers-color-scheme: dark", "all");
    await settled();
    result.views.dark = look(page);
    turn(page, "print", "all", "screen");
    frame.style.width = "PAPERpx";
    await settled();
    result.views.print = look(page);
    frame.remove();
  }
  document.title = JSON.stringify(found);
}
all();
</script>"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The committed report with its HTML pages."""
    folder = tmp_path_factory.mktemp("report") / "reports"
    shutil.copytree(REPORTS, folder, ignore=shutil.ignore_patterns("*.html", "timed", "provenance.json", "timings.md"))
    republish(folder, CONTENTS)
    return folder


@pytest.fixture(scope="module")
def pages(report: Path, browse: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a browser finds on each page, by its name."""
    sources = {page.stem: page.as_uri() for page in sorted(report.glob("*.html"))}
    text = LOOK.replace("PAGES", json.dumps(sources))
    for name, width in {"LAPTOP": LAPTOP, "SCREEN": SCREEN, "PHONE": PHONE, "PAPER": PAPER}.items():
        text = text.replace(name, str(width))
    looking = tmp_path_factory.mktemp("browser") / "look.html"
    looking.write_text(text)
    # virtual time: the browser waits for nothing but its own work, and stops the script that hangs
    dumped = browse(looking, "--dump-dom", "--allow-file-access-from-files", "--virtual-time-budget=600000")
    title = re.search(r"<title>(.*?)</title>", dumped, re.DOTALL)
    assert title is not None
    found: dict[str, Any] = json.loads(html.unescape(title[1]))
    assert found.keys() == sources.keys()
    return found


def of_views(pages: dict[str, Any], what: str, *views: object) -> dict[str, Any]:
    """What is found in views of the pages, without the pages where there is nothing."""
    return {
        f"{name}, {view}": page["views"][str(view)][what]
        for name, page in pages.items()
        for view in views
        if page["views"][str(view)][what]
    }


def test_no_table_is_cut(pages: dict[str, Any]) -> None:
    """On a laptop, a large screen and paper; on a phone a wide table scrolls by itself and the page does not."""
    assert sum(page["tables"] for page in pages.values()) > 200  # it has looked at them
    assert not of_views(pages, "cut", LAPTOP, SCREEN)
    assert not of_views(pages, "sideways", LAPTOP, SCREEN, PHONE, "print")


def test_no_text_is_clipped(pages: dict[str, Any]) -> None:
    assert not of_views(pages, "clipped", LAPTOP, SCREEN, PHONE, "print")


def test_figures_load_and_keep_their_letters(pages: dict[str, Any]) -> None:
    """Letters of 11 px at full size are 6.6 px at 0.6 of it: below that nobody reads them."""
    assert not of_views(pages, "broken", LAPTOP, SCREEN, PHONE, "dark", "print")
    assert not of_views(pages, "shrunk", LAPTOP, SCREEN)


def test_the_list_of_pages_shows_where_one_is(pages: dict[str, Any]) -> None:
    unlisted = {"timings"}  # a page of this machine, listed once something has run on it
    assert [name for name, page in pages.items() if page["inSight"] is not True and name not in unlisted] == []


def test_no_page_begins_with_a_wall(pages: dict[str, Any]) -> None:
    words = {name: page["words"] for name, page in pages.items() if page["words"] is not None}
    assert statistics.median(words.values()) <= WORDS, words


def test_the_front_page_is_one_screen(pages: dict[str, Any]) -> None:
    """But for the line that a run has which does not confirm what is kept."""
    assert pages["index"]["height"] <= 900


def test_pages_turn_dark_with_their_figures(pages: dict[str, Any]) -> None:
    assert {page["views"]["dark"]["ground"] for page in pages.values()} == {"rgb(20, 24, 30)"}
    assert not of_views(pages, "unturned", "dark")
    assert {page["views"]["print"]["ground"] for page in pages.values()} == {"rgb(255, 255, 255)"}


def test_what_a_reader_works_with_has_a_name(pages: dict[str, Any]) -> None:
    assert {name: page["bare"] for name, page in pages.items() if page["bare"]} == {}


def test_links_lead_somewhere(report: Path, pages: dict[str, Any]) -> None:
    """Every link inside the report, to its row too; no two things have one name."""
    assert {name: page["twice"] for name, page in pages.items() if page["twice"]} == {}
    dead = []
    for name, page in pages.items():
        for link in page["links"]:
            file, _, anchor = link.partition("#")
            if "://" in link or link.startswith("data:"):
                continue
            target = Path(file).stem if file else name
            there = (report / file).exists()
            if not there or (anchor and "=" not in anchor and anchor not in pages[target]["ids"]):
                dead.append(f"{name}: {link}")
    assert not dead


def test_the_readme_has_the_findings_in_five_sentences() -> None:
    """Their numbers are held to the stores by `test_the_readme_says_what_the_report_found`."""
    findings = (ROOT / "README.md").read_text("utf-8").partition(BEGIN)[2].partition(END)[0]
    assert len(re.findall(r"^\d+\. ", findings, re.MULTILINE)) == 5
    assert f"reports/{DESIGNS})" in findings


def test_sizes(report: Path) -> None:
    """What a mail or a slow line can carry: a page 2 MB, the report 25 MB."""
    large = {page.name: size for page in report.glob("*.html") if (size := page.stat().st_size) > 2 * MEGABYTE}
    assert not large
    assert sum(file.stat().st_size for file in report.rglob("*") if file.is_file()) <= 25 * MEGABYTE

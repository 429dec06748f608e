"""What moves on a page, in a browser: fields on a slider, designs put in another order."""

import html
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from validation.harness.contents import Contents
from validation.harness.pages import Measured, pages
from validation.harness.report import Report
from validation.harness.store import Section, Study

X = np.stack(np.meshgrid(np.arange(4) + 0.5, np.arange(2) + 0.5), axis=-1).reshape(-1, 2)
HALF = np.array([0.5, 0.5])
MOVE = """<!DOCTYPE html><title>not tried</title><iframe srcdoc="{page}"></iframe><script>
addEventListener("load", async () => {{
  const page = document.querySelector("iframe").contentDocument, range = page.querySelector("input[type=range]");
  for (let k = 0; k < 50 && page.querySelector(".slide").hidden; k++) await new Promise(done => setTimeout(done, 20));
  const shown = () => [...page.querySelectorAll("canvas")].map(canvas =>
    [canvas.getContext("2d").getImageData(0, 0, 1, 1).data[0], canvas.getAttribute("aria-label")]);
  const first = shown();
  range.value = 1;
  range.dispatchEvent(new Event("input"));
  const methods = () => [...page.querySelectorAll(".gallery figure")].map(figure => figure.dataset.method);
  const order = [methods()];
  for (const key of ["own", "true"]) {{
    const input = page.querySelector(`.switch input[value=${{key}}]`);
    input.checked = true;
    input.dispatchEvent(new Event("change", {{bubbles: true}}));
    order.push(methods());
  }}
  document.title = JSON.stringify({{first: first, second: shown(), said: range.getAttribute("aria-valuetext"),
    label: range.labels[0].textContent.trim(), all: page.querySelector(".all").hidden, order: order,
    over: [...page.querySelectorAll(".over")].map(e => e.textContent),
    spoken: page.querySelector(".switch output").textContent}});
}});
</script>"""


def page_of(folder: Path) -> str:
    """A page with two designs and a slider over two places."""
    report = Report("study", "test_it", set())
    for method, own, true in (("MPM", 1.0, 3.0), ("FEM", 1.5, 2.0)):
        report.design(method, X, HALF, np.ones(8), body="strip", method=method, measure="C", own=own, true=true)
    fields = {"tent": [np.zeros(8), np.ones(8)], "GIMP": [np.full(8, 0.2), np.full(8, 0.6)]}
    said = {"tent": ["own 1", "own 2"], "GIMP": ["own 3", "own 4"]}
    report.frames("slide", X, HALF, fields, [0.0, 0.25], "Designs", slides="distance / h", said=said)
    (folder / "figures").mkdir()
    for name, drawn in report.files.items():
        (folder / "figures" / name).write_bytes(drawn)
    study = Study("study", "Study", "", [Section("test_it", "It", "", "", [], report.blocks)])
    return pages([study], Measured([], []), folder, {}, Contents())["study.html"]


def test_sliders_and_orders(browse: Callable[..., str], tmp_path: Path) -> None:
    """Pixels, labels and what a screen reader is told follow the slider; all places are shown without scripts."""
    page = page_of(tmp_path)
    assert re.search(r'<div class="slide" hidden>', page)
    assert not re.search(r'<div class="scroll all"[^>]* hidden', page)
    moving = tmp_path / "moving.html"
    moving.write_text(MOVE.format(page=html.escape(page)))
    title = re.search(r"<title>(.*?)</title>", browse(moving, "--dump-dom", "--virtual-time-budget=20000"))
    assert title is not None
    found = json.loads(html.unescape(title[1]))
    assert found["first"] == [[255, "tent: own 1"], [204, "GIMP: own 3"]]
    assert found["second"] == [[0, "tent: own 2"], [102, "GIMP: own 4"]]
    assert (found["said"], found["label"], found["all"]) == ("0.25", "distance / h", True)
    assert found["order"] == [["MPM", "FEM"], ["MPM", "FEM"], ["FEM", "MPM"]]
    assert found["over"] == ["least", "+50 %"]
    assert found["spoken"] == "FEM has the least"

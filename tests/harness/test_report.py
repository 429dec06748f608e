"""The validation report: studies run by pytest itself, their files, and the pages in a real browser."""

import io
import json
from typing import Literal

import matplotlib as mpl
import matplotlib.pyplot as plt
import matplotlib.style
import numpy as np
import pandas as pd
import pytest
from matplotlib._mathtext import Parser
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure

from mpmtop.page.drawing import STYLE, drawn, numbered
from mpmtop.page.numbers import changed, digits3, number, per_cent
from validation.harness.blocks import Table, raster
from validation.harness.claims import Reading, Statement, Tally, stands
from validation.harness.report import Locked, Report
from validation.harness.show import cell, show
from validation.harness.store import Section, Study
from validation.measures.drawing import draw_design, draw_points

pytest_plugins = ["pytester"]


def test_readings_of_one_sentence_count_once() -> None:
    said = Statement("Sect. 6.1", "slower", "trend")
    printed = Statement("Fig. 9", "83.57", "calibrated", 83.57)
    misprint = Statement("Eq. (7)", "1 - d²", "erratum")
    report = Report("study", "test", set())
    report.check("one reading", 1.0, at_least=1.05, source=said)
    report.check("another", 1.7, at_least=1.05, source=said)
    report.check("only reported", 1.0, source=said)
    report.check("fitted", 84.57, printed.value, rtol=0.03, source=printed)
    report.check("printed", 0.125, 0.125, source=misprint)
    report.check("ours", 1.0, at_most=2.0, source="our bound")
    report.check("ours, too", 1.0, source="for comparison")
    readings = [Reading(claim, "study", "test") for claim in report.claims]
    assert [(len(stand.readings), stand.state) for stand in stands(readings)][:2] == [(3, "by reading"), (1, "agrees")]
    tally = Tally.of(readings)
    assert {kind: dict(states) for kind, states in tally.paper.items() if states} == {
        "trend": {"by reading": 1},
        "calibrated": {"agrees": 1},
    }
    assert (dict(tally.checks), dict(tally.errata)) == ({"holds": 1, "reported": 1}, {"holds": 1})
    assert tally.headline().endswith("results: 0 met without fitting, 1 met by fitting, 0 not met.")


def test_a_place_in_the_paper_needs_what_is_stated_there() -> None:
    places = ("Sect. 6.1: stiffer", "Sects. 2 and 3", "Fig. 9", "Figs. 9, 10", "Eq. (7)", "Eqs. (7, 8)", "Table 2")
    for place in (*places, "Appendix: identical", "Appendix, Eq. A.1"):
        with pytest.raises(ValueError, match="give the Statement"):
            Report("study", "test", set()).check("claim", 1.0, source=place)
    for own in ("our bound", "Svanberg (2002), Sect. 5", "Section of ours", "Tables", "Figure", ""):
        assert Report("study", "test", set()).check("claim", 1.0, source=own)


@pytest.mark.parametrize(
    ("stated", "now", "rtol", "drift", "within"),
    [
        (2.0, 2.1, 0.06, 0.05, True),
        (-2.0, -2.2, 0.05, -0.1, False),
        (0.0, 0.0, 0.0, 0.0, True),
        (0.0, 1.0, 0.5, np.inf, False),
    ],
)
def test_drift(stated: float, now: float, rtol: float, drift: float, within: bool) -> None:
    lock = Locked("number", stated, now, rtol)
    assert lock.drift == pytest.approx(drift)
    assert lock.within == within


def test_designs_are_one_pixel_for_each_smallest_point() -> None:
    """Rows from the top; a coarse rectangle covers as many pixels as it is larger; nothing outside the body."""
    x = np.array([(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (3.0, 1.0)])
    half = np.array([(0.5, 0.5)] * 3 + [(1.0, 1.0)])
    grey, opacity = np.moveaxis(raster(x, half, np.array([0.0, 1.0, 0.2, 0.6])), -1, 0)
    assert grey.tolist() == [[204, 0, 102, 102], [255, 0, 102, 102]]
    assert opacity.tolist() == [[255, 0, 255, 255], [255, 255, 255, 255]]


@pytest.mark.parametrize(
    ("observed", "expectation", "verdict", "stated"),
    [
        (1.02, {"expected": 1.0, "rtol": 0.03}, "agrees", 1.0),
        (-1.04, {"expected": -1.0, "rtol": 0.03}, "differs", -1.0),
        (3200, {"expected": 3200}, "agrees", 3200),
        (np.float64(0.0181), {"at_most": 0.018}, "differs", "<= 0.018"),
        (12.0, {"at_least": 10, "at_most": 20}, "agrees", ">= 10 and <= 20"),
        (np.bool_(True), {"expected": False}, "differs", False),
        ("tent", {"expected": "tent"}, "agrees", "tent"),
        (np.inf, {"at_most": 1.0}, "differs", "<= 1"),
        (np.nan, {}, "differs", ""),
        (2.0, {}, "not stated", ""),
    ],
)
def test_verdicts(observed: float, expectation: dict[str, float], verdict: str, stated: object) -> None:
    report = Report("study", "test", set())
    assert report.check("claim", observed, **expectation, source="source") == (verdict != "differs")
    assert (report.claims[0].verdict, report.claims[0].expected) == (verdict, stated or stated)
    json.dumps(report.claims[0].observed, allow_nan=False)


@pytest.mark.parametrize(
    "expectation",
    [{"rtol": 0.1}, {"expected": 0.0, "rtol": 0.1}, {"expected": True, "rtol": 0.1}, {"expected": 1.0, "at_most": 1.0}],
)
def test_meaningless_expectations_are_refused(expectation: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="'claim'"):
        Report("study", "test", set()).check("claim", 1.0, **expectation, source="source")


def test_names_are_files_of_their_own() -> None:
    taken: set[str] = set()
    frame = pd.DataFrame({"a": [1.23456789, None], "b": [np.int64(3), 4]}, index=pd.Index(["x", "y"], name="case"))
    report = Report("study", "test", taken)
    report.table("t", frame, "caption", digits=3)
    (table,) = report.blocks
    assert (table.columns, table.rows) == (["case", "a", "b"], [["x", 1.23, 3], ["y", None, 4]])  # type: ignore[union-attr]
    with pytest.raises(ValueError, match="already recorded"):
        Report("study", "other", taken).table("t", frame, "caption")
    with pytest.raises(ValueError, match="file name"):
        report.table("../t", frame, "caption")
    with pytest.raises(ValueError, match="rename"):
        Report("index", "test", taken)


def test_cells() -> None:
    assert [show(value) for value in (None, True, 3, 3.0, 1e-6, 2.5e20, "x")] == [
        "–",
        "yes",
        "3",
        "3",
        "10⁻⁶",
        "2.5·10²⁰",
        "x",
    ]
    assert [number(value) for value in (84.5735, 1204.0, 16200, 1234567.0, 0.01, 9.97171e-7, -0.0, np.inf)] == [
        *("84.6", "1200", "16,200", "1.23·10⁶", "0.01", "9.97·10⁻⁷", "0", "∞"),
    ]
    assert [per_cent(0.0366), per_cent(-0.5, 2, sign=True), per_cent(0.138, sign=True)] == [
        *("3.66\u00a0%", "-50\u00a0%", "+13.8\u00a0%"),
    ]
    assert cell("|u| over\n two lines") == r"\|u\| over two lines"


def test_a_formula_is_set_once_for_all_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    formulas: list[str] = []
    parse = Parser.parse
    monkeypatch.setattr(Parser, "parse", lambda parser, s, *how: formulas.append(s) or parse(parser, s, *how))

    def plotted() -> Figure:
        figure, ax = plt.subplots()
        ax.plot([0.0131, 0.0137], [1, 2])
        ax.set(xticks=np.linspace(0.0131, 0.0137, 60), title="$x^{17}_{23}$")  # more than Matplotlib keeps
        return figure

    with mpl.rc_context(), mpl.style.context(STYLE):
        first = drawn(plotted(), "first")
        assert 60 < len(formulas) == len(set(formulas))
        formulas.clear()
        assert drawn(plotted(), "first") == first
        assert not formulas
        svg = io.BytesIO()
        with mpl.rc_context({"svg.hashsalt": "first"}):
            plotted().savefig(svg, format="svg", metadata={"Date": None, "Creator": "mpmtop"})
        assert numbered(svg.getvalue(), "first") == first
        plt.close("all")


def hard_to_lay_out(layout: Literal["constrained", "none"]) -> Figure:
    """Axes of unequal length that share ticks, twins, an offset, minor ticks, an image that is resampled, a bar of
    colours, titles over an offset and over ticks at the top, a legend outside."""
    figure, axes = plt.subplots(2, 2, sharex="col", figsize=(7, 5), width_ratios=(3, 1), layout=layout)
    k = np.arange(1.0, 40.0)
    axes[0, 0].semilogy(k, 10**-k, label="error")
    axes[0, 0].twinx().plot(k, 1e6 + k, label="own")
    axes[0, 0].set_title("over\nall", linespacing=1.5)
    axes[1, 0].plot(k, 1e-7 * k, label="true")
    axes[1, 0].secondary_yaxis("right", functions=(np.cbrt, lambda root: root**3)).set_ylabel("root")
    axes[1, 0].set(aspect=2e8, xlabel="k")
    axes[1, 0].tick_params("x", rotation=30)
    axes[1, 0].text(20, 2e-6, "all", rotation=30, rotation_mode="anchor", wrap=True)
    image = axes[0, 1].imshow(np.outer(k, k), interpolation="bilinear")
    axes[0, 1].xaxis.tick_top()
    axes[0, 1].set_title("an image")
    figure.colorbar(image, ax=axes[:, 1], label="$k^2$")
    figure.legend(loc="outside lower center")
    return figure


@pytest.mark.parametrize(
    ("layout", "letters", "box", "lost"),
    [("constrained", "it", "tight", ""), ("none", "rm", "standard", ""), ("constrained", "it", "tight", "LAID")],
)
def test_a_figure_is_drawn_as_matplotlib_draws_it(
    layout: Literal["constrained", "none"], letters: str, box: str, lost: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after others that had the same texts in other letters, and where Matplotlib has lost what is asked once."""
    if lost:
        monkeypatch.setattr(f"mpmtop.page.once.{lost}", None)
    drawings: list[Figure] = []
    draw = Figure.draw

    def counted(figure: Figure, renderer: RendererBase) -> None:
        drawings.append(figure)
        draw(figure, renderer)

    with mpl.rc_context(), mpl.style.context([STYLE, {"mathtext.default": letters, "savefig.bbox": box}]):
        svg = io.BytesIO()
        with mpl.rc_context({"svg.hashsalt": "hard"}):
            hard_to_lay_out(layout).savefig(svg, format="svg", metadata={"Date": None, "Creator": "mpmtop"})
        figure = hard_to_lay_out(layout)
        monkeypatch.setattr(Figure, "draw", counted)
        assert drawn(figure, "hard") == numbered(svg.getvalue(), "hard")
        plt.close("all")
    assert drawings == [figure]


def test_points_are_drawn_small_and_without_seams() -> None:
    x = np.stack(np.meshgrid(np.arange(180) + 0.5, np.arange(90) + 0.5), axis=-1).reshape(-1, 2) / 6
    half_length = np.full_like(x, 1 / 12)
    with mpl.rc_context():
        mpl.style.use(STYLE)
        figure, ax = plt.subplots()
        drawn = draw_points(ax, x, half_length, np.ones(len(x)), vmin=0, vmax=2, label="stress")
        assert drawn.get_clim() == (0, 2)
        report = Report("study", "test", set())
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
        left, bottom, right, top = ax.transData.transform([(1, 1), (29, 14)]).astype(int).ravel()
        inside = pixels[pixels.shape[0] - top : pixels.shape[0] - bottom, left:right].reshape(-1, 4)
        assert len(np.unique(inside, axis=0)) == 1
        draw_design(plt.figure().add_subplot(), x, half_length, np.random.default_rng(0).random(len(x)))
        report.figure("noise", plt.gcf(), "the least compressible design of the finest scene")
    assert len(report.files["study_noise.svg"]) < 200_000  # what a page of several figures can carry


def test_claims_of_a_section_have_names_of_their_own() -> None:
    report = Report("study", "test", set())
    report.check("jump", 1.0, source="ours")
    with pytest.raises(ValueError, match="two claims"):
        report.check("jump", 2.0, source="ours")


def test_rows_of_sections_make_one_table_and_sentences_take_measured_values() -> None:
    reports = [Report("study", f"test_{k}", set()) for k in range(2)]
    for k, report in enumerate(reports):
        report.opening.table(f"part_{k}", pd.DataFrame({"error": [0.5 + k]}), "caption", part_of="whole")
    reports[0].check("error of | it", 0.25, source="ours")
    sections = [Section(r.test, "", "", "", r.claims, r.blocks, opening=r.opening.blocks) for r in reports]
    found = ["Takes {seconds, all} s, error {error of | it}.", "Takes {never measured} s."]
    study = Study("study", "", "", sections, found=found)
    (table,) = study.opening
    assert isinstance(table, Table)
    assert (table.file, table.rows) == ("study_whole", [[0.5], [1.5]])
    assert study.filled("found", {"seconds, all": 5.021}) == ["Takes 5.02 s, error 0.25."]
    assert study.filled("found", {}) == []


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (0.0366, "3.7% higher"),
        (-0.002, "0.2% lower"),
        (-0.0001, "unchanged"),
        (0.0, "unchanged"),
        (3.0, "higher by a factor of 4.0"),
    ],
)
def test_changes_in_words(ratio: float, words: str) -> None:
    assert changed(ratio) == words


def test_designs_beside_each_other_have_as_many_digits() -> None:
    assert [digits3(value) for value in (85.05, 90.0, 1.2, 7.494, 146.0, 1204.0, 0.5, 1.5e-9)] == [
        *("85.0", "90.0", "1.20", "7.49", "146", "1200", "0.500", "1.5·10⁻⁹"),
    ]

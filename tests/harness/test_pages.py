"""The pages of a report: what stands first, what is shown of measured times, what moved between two reports."""

import html
import json
import re
import shutil
from pathlib import Path

import pytest

from tests.harness.studies import LOCKED, ROOT, claims, committed, is_text, rerun, tables
from validation.__main__ import BEGIN, END, main, with_findings
from validation.harness.rows import KEPT
from validation.harness.store import read

pytest_plugins = ["pytester"]


def test_failing_tests_keep_their_claims(studied: tuple[Path, str]) -> None:
    folder, printed = studied
    rows = claims(folder / "reports")
    assert tuple(rows[0]) == KEPT
    shown = ("study", "kind", "claim", "observed", "expected", "rtol", "verdict", "reason")
    reason = "GIMP is smooth, see [the optimum](#test_optimum)"
    assert [tuple(row[name] for name in shown) for row in rows] == [
        ("crossing", "result", "jump, tent | solid", "0.137", "0.138", "0.02", "agrees", ""),
        ("crossing", "result", "jump, GIMP | solid", "0.02", "0.138", "0.02", "differs", reason),
        ("crossing", "check", "not a number", "nan", "<= 1", "", "fails", ""),
        ("crossing", "check", "speed-up", "", ">= 2", "", "holds", ""),
        ("other", "check", "radius", "3.0", "", "", "reported", ""),
    ]
    assert {row["stated"] for row in rows if row["kind"] == "result"} == {"a jump of 13.8 %"}
    assert "5 claims of 2 studies ran; statements of the paper: 0 agree, 1 by reading, 0 differ" in printed
    assert "our checks: 1 of 2 hold; locked values: 1 of 1 within tolerance; sections that failed: 2" in printed
    assert f"report: {folder / 'reports' / 'index.html'}" in printed
    page = (folder / "reports" / "crossing.md").read_text()
    assert "`test_optimum` ended with RuntimeError" in page
    assert r"| jump, GIMP \| solid. *Most likely reason:* GIMP is smooth" in page
    assert "test_skipped" not in page


@pytest.mark.parametrize("suffix", ["md", "html"])
def test_what_the_paper_says_stands_apart_from_our_checks(studied: tuple[Path, str], suffix: str) -> None:
    paper = ["The paper’s words", "Our reading", "We get", "Deviation", "Verdict", "Counts as agreement"]
    ours = ["Check", "We get", "Required", "Verdict", "Why"]
    listed = tables(studied[0] / "reports" / f"claims.{suffix}")
    assert [[word.replace("'", "’") for word in rows[0]] for rows in listed] == [paper, ours, ours]
    readings, checks, other = ([row[-5:-1] for row in rows[1:]] for rows in listed)
    assert [row[-3:] for row in readings] == [
        ["13.7\u00a0%", "-0.72\u00a0%", "✓ agrees"],
        ["2\u00a0%", "-86\u00a0%", "✗ differs"],
    ]
    assert [row[0] for row in checks] == ["not a number", "speed-up"]
    assert [row[-1].split()[-1] for row in checks] == ["fails", "holds"]
    assert other == [["radius", "3", "–", "○ reported"]]
    crossing = studied[0] / "reports" / f"crossing.{suffix}"
    assert [[word.replace("'", "’") for word in rows[0]] for rows in tables(crossing)[:2]] == [paper, ours]


@pytest.mark.parametrize("suffix", ["md", "html"])
def test_the_answer_comes_first(studied: tuple[Path, str], suffix: str) -> None:
    """What was asked, found and follows, before anything else; on the front page by topic, the printed results too."""
    texts = {
        name: html.unescape((studied[0] / "reports" / f"{name}.{suffix}").read_text()) for name in ("index", "crossing")
    }
    page = texts["crossing"]
    order = [
        "Does a column that",
        "With tent the tip jumps by 13.7%.",
        "Keep points as seeded.",
        "scene",
        "introduction",
    ]
    places = [page.index(words) for words in order]
    assert places == sorted(places)
    front = texts["index"]
    for words in ("With tent the tip jumps by 13.7%.", "Keep points as seeded.", "a jump of 13.8 %", "by reading"):
        assert words in front
    assert "Of the 1 numbers that the paper prints as results: 0 met without fitting" in front


def test_what_failed_and_drifted_is_on_the_front_page(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    front = (studied[0] / "reports" / "index.html").read_text()
    assert "Sections that failed: <b>2</b>" in front
    assert "<b>1</b> of <b>1</b> within their tolerance, largest drift 0" in front
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    (pytester.path / LOCKED).write_text(",kept\n0,1.25\n")
    assert "locked values: 0 of 1 within tolerance" in rerun(pytester, "-k", "locked")
    front = (pytester.path / "reports" / "index.html").read_text()
    assert "Locked values of the sections run here: <b>0</b> of <b>1</b>" in front
    assert "1 of 1 locked values are outside their tolerance, by a drift of 20\u00a0% at most" in front
    row = next(row for rows in tables(pytester.path / "reports" / "index.html") for row in rows if "kept" in row[0])
    assert row[1:] == ["1.25", "1", "-20\u00a0%", "10⁻¹⁰\u00a0%"]
    assert "1.25" not in b"".join(committed(pytester.path / "reports").values()).decode(errors="ignore")


def test_every_section_says_which_run_it_is_of(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    reports = pytester.path / "reports"
    rerun(pytester, "-k", "jump")
    page = (reports / "crossing.html").read_text()
    notes = re.findall(r'<p class="of-run">(.*?)</p>', page)
    assert [note.startswith("This run: ") for note in notes] == [True, False, False]
    assert notes[1].startswith("Not run this time; from the run of ")
    assert notes[0].endswith("Again: <code>pytest studies/crossing/test_crossing.py -k test_jump</code>")
    shutil.rmtree(reports / "timed")
    rerun(pytester, "-k", "jump")
    assert "Not run on this machine: as kept with the code." in (reports / "crossing.html").read_text()


def test_measured_times_stay_out_of_what_is_committed(studied: tuple[Path, str]) -> None:
    reports = studied[0] / "reports"
    assert ",2.5,>= 2," in (reports / "timed" / "ratios.csv").read_text()
    provenance = json.loads((reports / "data" / "provenance.json").read_text())
    text = b"".join(content for file, content in committed(reports).items() if is_text(file)).decode()
    assert "2.5" not in text
    assert not [name for name in ("date", "machine", "python", "command") if provenance[name] in text]
    assert str(studied[0]) not in text


def test_measured_seconds_are_shown_with_their_machine(studied: tuple[Path, str]) -> None:
    reports = studied[0] / "reports"
    assert (reports / "timed" / ".gitignore").read_text() == "*\n"  # of its own: no seconds reach a commit
    assert "8.125" in (reports / "timed" / "crossing_seconds.csv").read_text()
    assert not [file for file, content in committed(reports).items() if is_text(file) and b"8.125" in content]
    machine = json.loads((reports / "data" / "provenance.json").read_text())["machine"]
    assert "logical cores, BLAS threads: " in machine
    page, text = (html.unescape((reports / f"timings.{suffix}").read_text()) for suffix in ("html", "md"))
    for shown in (machine, "8.125", "Seconds against error", "Optimised compliance"):
        assert shown in page
        assert shown in text
    assert page.count("data:image/svg+xml") == 1
    assert "(timed/crossing_clock.svg)" in text


def test_where_the_time_goes(studied: tuple[Path, str]) -> None:
    """Every study with the seconds of all its tests: the progress of `test_jump` alone sleeps for 0.8 s."""
    text = (studied[0] / "reports" / "timings.md").read_text()
    wall, cpu = map(float, re.findall(r"\(crossing.md\) \| ([\d.]+) \| ([\d.]+) \|", text)[0])
    assert wall >= 0.8
    assert cpu < wall  # asleep
    assert "(other.md) |" in text


def test_pages_need_nothing_but_themselves(studied: tuple[Path, str]) -> None:
    pages = list((studied[0] / "reports").glob("*.html"))
    assert {page.stem for page in pages} == {"index", "claims", "timings", "benchmark", "crossing", "other"}
    for page in pages:
        text = page.read_text()
        assert not re.search(r"<(script [^>]*src|iframe|object|embed)|@import|url\(|fetch\(|XMLHttp", text)
        assert all(source.startswith("data:") for source in re.findall(r'(?:src|srcset)="([^"]*)"', text))
        assert re.findall(r'<link [^>]*href="([^"]*)"', text) == ["data:,"]
        assert "&lt;friends&gt;" in text
    assert 'alt="Design of the tent run"' in (studied[0] / "reports" / "crossing.html").read_text()


def test_the_readme_says_what_the_report_found() -> None:
    """Its numbers are those of the committed stores: `make validate` writes both."""
    readme = (ROOT / "README.md").read_text("utf-8")
    assert with_findings(readme, ROOT / "reports") == readme


def test_every_difference_from_the_paper_has_a_reason_with_its_number() -> None:
    """In the committed stores: what most likely makes it, and what was computed for that."""
    differing = [
        (study.name, claim)
        for study in read(ROOT / "reports").values()
        for claim in study.claims
        if claim.of_paper and claim.verdict == "differs"
    ]
    bare = [(name, claim.claim) for name, claim in differing if not re.search(r"\d", claim.reason)]
    assert not bare


def test_findings_come_from_the_stores(studied: tuple[Path, str]) -> None:
    text = with_findings(f"before\n{BEGIN}old\n{END}\nafter\n", studied[0] / "reports")
    assert text.startswith(f"before\n{BEGIN}![Designs")
    assert text.endswith(f"{END}\nafter\n")
    assert "2. **With crossing.** With tent the tip jumps by 13.7%.\n3. **With crossing.** With GIMP" in text
    assert "\n\n**What to do.** Keep points as seeded.\n" in text
    assert "old" not in text
    with pytest.raises(ValueError, match="put it where the findings belong"):
        with_findings("no marks", studied[0] / "reports")


def test_what_moved_between_two_reports(
    studied: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after, page = studied[0] / "reports", tmp_path / "after", tmp_path / "diff.html"
    shutil.copytree(before, after)
    assert main(["diff", str(before), str(after), "-o", str(page)]) == 0
    assert "Nothing moved." in page.read_text()
    store = after / "data" / "crossing.json"
    stored = json.loads(store.read_text())
    jump = stored["sections"][0]["claims"][0]
    jump |= {"observed": 0.2, "verdict": "differs"}
    store.write_text(json.dumps(stored))
    (after / "figures" / "crossing_design.svg").write_text("<svg/>")
    assert main(["diff", str(before), str(after), "-o", str(page)]) == 1
    assert "moved: 1 claims (by 0.46 of themselves at most), 1 verdicts, 0 cells, 0 locked values, 1 figures" in (
        capsys.readouterr().out
    )
    text = html.unescape(page.read_text())
    assert re.search(r"jump, tent \| solid</td>.*>0.137<.*>0.2<.*>\+46\u00a0%<", text)
    assert text.count("crossing_design.svg, ") == 4  # captions and alternative texts
    with pytest.raises(SystemExit):
        main(["diff", str(before), str(tmp_path / "nothing")])
    assert "no report in" in capsys.readouterr().err

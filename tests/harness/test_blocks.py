"""What a page is made of: fields on a slider, the judge's columns, rows with names of their own."""

import io

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from validation.harness.blocks import Frames, Table
from validation.harness.claims import Reading, Statement, Tally, rows_of
from validation.harness.report import Report
from validation.harness.show import brief

X = np.array([(0.5, 0.5), (1.5, 0.5), (2.5, 0.5), (0.5, 1.5), (1.5, 1.5), (2.5, 1.5)])
HALF = np.array([0.5, 0.5])
FIELDS = {"tent": [np.zeros(6), np.full(6, 0.2)], "GIMP": [np.full(6, 0.6), np.ones(6)]}
SAID = {"tent": ["own 1", "own 2"], "GIMP": ["own 3", "own 4"]}


def test_frames_are_tiles_by_method_and_place() -> None:
    report = Report("study", "test", set())
    report.frames("shift", X, HALF, FIELDS, [0.0, 0.25], "caption", slides="shift / h", said=SAID)
    (block,) = report.blocks
    assert isinstance(block, Frames)
    assert (block.size, block.places, block.methods) == ([3, 2], ["0", "0.25"], ["tent", "GIMP"])
    assert block.said == [["own 1", "own 2"], ["own 3", "own 4"]]
    grey = np.asarray(Image.open(io.BytesIO(report.files["study_shift.png"])))[..., 0]
    assert grey.shape == (4, 6)
    assert [grey[y, x] for y in (0, 2) for x in (0, 3)] == [255, 204, 102, 0]


@pytest.mark.parametrize(
    ("places", "said"), [([0.0], SAID), ([0.0, 0.25], {"tent": ["a", "b"]}), ([0.0, 0.25], SAID | {"GIMP": ["a"]})]
)
def test_a_missing_frame_is_refused(places: list[float], said: dict[str, list[str]]) -> None:
    with pytest.raises(ValueError, match="one field and one text for each of"):
        Report("study", "test", set()).frames("shift", X, HALF, FIELDS, places, "", slides="shift", said=said)


def test_the_judge_comes_right_after_the_names() -> None:
    frame = pd.DataFrame({"own": [1.0], "points": [4], "compliance, fine reference": [2.0], "true / own": [3.0]})
    report = Report("study", "test", set())
    report.table("plain", frame.assign(method="tent")[["method", *frame.columns]], "caption")
    index = pd.MultiIndex.from_tuples([("wave", "tent")], names=["crossing", "method"])
    report.table("indexed", frame.set_index(index), "caption")
    judged = ["compliance, fine reference", "true / own", "own", "points"]
    tables = [block for block in report.blocks if isinstance(block, Table)]
    assert [table.columns for table in tables] == [["method", *judged], ["crossing", "method", *judged]]
    assert [table.rows[0][-4:] for table in tables] == [[2.0, 3.0, 1.0, 4]] * 2


def test_rows_of_claims_have_names_of_their_own() -> None:
    assert rows_of("test_x", ["Tip, GIMP | 2 %", "tip (GIMP), 2%", "other"]) == [
        *("test_x--tip-gimp-2", "test_x--tip-gimp-2-2", "test_x--other"),
    ]


def test_directions_are_counted_by_sentence() -> None:
    slower, harder = (Statement("Sect. 6", words, "trend") for words in ("slower", "harder"))
    report = Report("study", "test", set())
    assert Tally.of([]).directions() == ""
    report.check("one reading", 1.0, at_least=2.0, source=slower)
    report.check("another", 3.0, at_least=2.0, source=slower)
    report.check("only", 1.0, at_least=2.0, source=harder)
    found = Tally.of([Reading(claim, "study", "test") for claim in report.claims]).directions()
    assert found == "Of its 2 comparisons and directions: 1 hold in one reading and not in another, 1 do not."


@pytest.mark.parametrize(
    ("title", "short"), [("Hole (Figs. 16, 17)", "Hole"), ("Peers", "Peers"), ("(a) as seeded", "(a) as seeded")]
)
def test_titles_in_lists(title: str, short: str) -> None:
    assert brief(title) == short


def test_what_was_fitted_and_is_not_met_is_said() -> None:
    stated = Statement("Fig. 9", "83.57", "calibrated", 83.57)
    report = Report("study", "test", set())
    report.check("objective", 133.2, stated.value, rtol=0.03, source=stated)
    found = Tally.of([Reading(claim, "study", "test") for claim in report.claims]).headline()
    assert found.endswith("results: 0 met without fitting, 0 met by fitting, 1 fitted to and not met, 0 not met.")

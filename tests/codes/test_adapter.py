"""Connecting a code in Python: the adapter of the docs works, the template is one, and what is none is refused."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, get_args

import numpy as np
import pytest

from mpmtop.shape_functions import tent
from tests.codes.soil_mpm import Ground, Particle
from validation.__main__ import main
from validation.codes import cases, kept
from validation.codes.adapter import Adapter, NoAdapter, load_class, write_template
from validation.codes.answers import Misanswered
from validation.codes.card import Check, scorecard
from validation.codes.checks import every
from validation.codes.files import KNOWN, write_cases
from validation.codes.named import code
from validation.codes.words import MEANINGS, table
from validation.methods.points import PointMethod
from validation.methods.protocol import Answer, Capability, Case

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
QUICK = ["rigid motion, uniform points", "mean stress, loads on points", "two layers, stretched", "plane stress"]


def quick() -> list[Check]:
    return [check for check in every() if check.way == "analysis" and check.name in QUICK]


def test_the_adapter_in_the_docs_connects_a_small_code(tmp_path: Path) -> None:
    """Twenty lines; the code of sixty has habits of its own, and the answers are our tent's."""
    text = (ROOT / "validation" / "codes" / "README.md").read_text()
    text = text.split("writes one to fill in.")[1].split("```python\n")[1].split("```")[0]
    assert len([line for line in text.splitlines() if line]) <= 22
    (tmp_path / "small_mpm.py").write_text((HERE / "small_mpm.py").read_text())
    (tmp_path / "my_adapter.py").write_text(text)
    small = code(f"{tmp_path}/my_adapter.py:SmallMPM")
    card = scorecard(small, quick())
    assert [row.verdict for row in card.rows] == ["passes", "passes", "passes", "not supported"]
    case = cases.under_weight("uneven", cases.uneven((12, 6)))
    theirs, ours = small.analyse(case), PointMethod("tent", tent).analyse(case)
    np.testing.assert_allclose(theirs.u, ours.u, atol=1e-11 * np.abs(ours.u).max())
    np.testing.assert_allclose(theirs.stress, ours.stress, atol=1e-11 * np.abs(ours.stress).max())


class Soil:
    """How the code that the docs do not connect is connected rightly; its stresses, as they are, fail by their sign."""

    name, version = "soil MPM", ""
    capabilities: ClassVar = {
        *("analysis", "quadrature at points", "points anywhere", "any outline"),
        *("moduli by point", "body forces", "prescribed displacements"),
    }
    sign = -1.0

    def analyse(self, case: Case) -> tuple[np.ndarray, np.ndarray]:
        grid, held, nu = case.grid, case.held, case.body.material.poisson
        ground = Ground(grid.origin, *grid.h, *grid.cells)
        for (i, j), fixed, value in zip(held.node, held.fixed, held.value, strict=True):
            ground.pin(i, j, *np.where(fixed, value, None))
        x, moduli = case.points.x, case.moduli
        shear, bulk = moduli / (2 * (1 + nu)), moduli / (3 * (1 - 2 * nu))
        particles = [Particle(*row) for row in zip(x, case.points.volume, shear, bulk, case.carried, strict=True)]
        ground.settle(particles)
        stress = np.array([p.pressure for p in particles])[:, [0, 1, 3]]
        return np.array([p.moved for p in particles]), self.sign * stress


def test_the_code_for_newcomers_is_sound_but_for_its_signs() -> None:
    """Rightly connected it passes; compression positive is said in figures, by a check that they read first."""
    card = scorecard(Adapter(Soil()), quick())
    assert [row.verdict for row in card.rows] == ["passes", "passes", "passes", "not supported"]
    case = cases.under_weight("uneven", cases.uneven((12, 6)))
    theirs, ours = Adapter(Soil()).analyse(case), PointMethod("tent", tent).analyse(case)
    np.testing.assert_allclose(theirs.u, ours.u, atol=1e-10 * np.abs(ours.u).max())
    turned = Soil()
    turned.sign = 1.0
    row = scorecard(Adapter(turned), quick()).of("fails")[0]
    assert row.kind == "stress positive in compression" and "sigma_xx is -1 times what acts" in row.where


def test_the_template_is_an_adapter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As it is written it loads and answers zeros, which fail."""
    monkeypatch.chdir(tmp_path)
    for named, path in (("mine", tmp_path / "mine.py"), (f"{tmp_path}/a/my.py", tmp_path / "a" / "my.py")):
        assert main(["adapter", named]) == 0
        said = capsys.readouterr().out.splitlines()
        assert said[0].startswith(f"wrote {path};") and said[1].startswith(
            f"pytest validation --code {path}:Code --reports "
        )
        assert code(f"{path}:Code").name == path.stem
    card = scorecard(code("mine.py:Code"), quick())
    assert card.code == "mine" and len(card.of("fails")) == 3
    for name in ("mine", "not a name"):
        with pytest.raises(SystemExit):
            main(["adapter", name])


class Bare:
    def analyse(self, case: Case) -> None:
        return None


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        (None, "has no set of `capabilities`"),
        ("analysis", "has no set of `capabilities`"),
        ({"analysis", "magic"}, r"\['magic'\] are no capabilities; there are"),
        ({"analysis", "gradient"}, "states 'gradient' and has no method `gradient`"),
    ],
)
def test_what_is_no_adapter_is_refused(stated: object, said: str) -> None:
    with pytest.raises(NoAdapter, match=said):
        Adapter(type("Theirs", (Bare,), {"capabilities": stated})())


def test_names_of_codes(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("x = 1\n")
    for named, said in (
        ("a.py", "name a class"),
        (f"{tmp_path}/b.py:B", "there is no file"),
        (f"{tmp_path}/a.py:B", "has no B"),
        ("no_such_module:B", "No module named"),
        (str(tmp_path), "has to say there what it is capable of"),
    ):
        with pytest.raises(NoAdapter, match=re.escape(said)):
            code(named)
    with pytest.raises(NoAdapter, match="name a class"):
        load_class("nothing")


def test_answers_of_an_adapter() -> None:
    """Two or three parts, or an `Answer`; anything else is named, and fails its row."""
    case = cases.cantilever("cantilever")
    zeros = np.zeros((288, 2)), np.zeros((288, 3))

    def answering(answer: object) -> Adapter:
        methods = {"capabilities": {"analysis"}, "analyse": lambda self, case: answer}
        return Adapter(type("Theirs", (), methods)())

    assert answering((*zeros, 2.0)).analyse(case).compliance == 2.0
    assert answering(Answer(zeros[0])).analyse(case).stress is None
    with pytest.raises(Misanswered, match="gave NoneType: give"):
        answering(None).analyse(case)
    check = quick()[1]
    for answer, said in (
        ((zeros[0][1:], zeros[1]), r"displacements of cantilever are \(287, 2\): give \(288, 2\)"),
        ((zeros[0] * np.nan, zeros[1]), "288 of 288 displacements of cantilever are not finite"),
        ((zeros[0], zeros[0]), r"stresses of cantilever are \(288, 2\)"),
    ):
        row = scorecard(answering(answer), [check]).rows[0]
        assert row.verdict == "fails" and re.search(said, row.where)


def test_the_accuracy_that_a_code_states_counts_for_identities_only() -> None:
    exact, order = quick()[1], next(check for check in every() if check.name == "refinement of the grid")
    rough = type("Rough", (), {"accuracy": 1e-3})()
    assert exact.of(rough).at_most == 1e-3 and "states" in exact.of(rough).why
    assert order.of(rough) is order and exact.of(object()) is exact


def test_scorecards_are_kept(tmp_path: Path) -> None:
    """To six digits, infinite ones too; one for each code; a file that is none is named."""
    card = scorecard(PointMethod("my GIMP!", tent), quick())
    path = kept.write(tmp_path, kept.kept(card, "2024-01-31", "Linux"))
    kept.write(tmp_path, kept.kept(card, "2024-02-01", "Linux"))
    (found,) = kept.read(tmp_path)
    assert path.name == "my_gimp.json" and found.when == "2024-02-01" and found.verdict == "4 of 4 checks pass"
    assert kept.matrix([found])["analysis: plane stress"] == {"my GIMP!": "passes"}
    (tmp_path / "other.json").write_text('{"rows": []}')
    with pytest.raises(ValueError, match=r"other\.json is no scorecard"):
        kept.read(tmp_path)


@pytest.mark.slow
def test_a_failing_code_fails_its_page_and_not_the_run(tmp_path: Path) -> None:
    """By the command of the docs: nothing else runs, and the page says what failed."""
    (tmp_path / "bad.py").write_text(
        "import warnings\n\n\nclass Bad:\n    name = 'z bad'\n    capabilities = {'analysis'}\n"
        "    def analyse(self, case):\n        warnings.warn('old', DeprecationWarning)\n"
        "        self.left = open(__file__)\n        raise MemoryError('too large')\n"
    )
    words = [
        "-q",
        "-p",
        "no:cacheprovider",
        "validation",
        "--code",
        f"{tmp_path}/bad.py:Bad",
        "--reports",
        str(tmp_path),
    ]
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout[-2000:]
    assert "1 passed" in ran.stdout
    page = (tmp_path / "codes.md").read_text()
    assert "MemoryError: too large" in page and page.index("**z bad**") < page.index("**Kratos")
    (line,) = [line for line in ran.stdout.splitlines() if line.startswith("z bad: 0 pass, ")]
    assert "fail (mean stress, loads on points; " in line and line.endswith("codes.html#table-codes_card_0_fails")
    assert 'id="table-codes_card_0_fails"' in (tmp_path / "codes.html").read_text()
    assert "unclosed file" in ran.stdout and "Traceback" not in ran.stdout
    columns = [(tmp_path / "data" / f"codes_card_0_{part}.csv").exists() for part in ("fails", "passes", "lacks")]
    assert columns == [True, False, True]


def test_words_are_the_same_everywhere(tmp_path: Path) -> None:
    """Every capability has one meaning, in the docs, the template and the schema."""
    assert set(MEANINGS) == set(get_args(Capability))
    docs = (ROOT / "validation" / "codes" / "README.md").read_text()
    template, schema = write_template(f"{tmp_path}/mine").read_text(), tmp_path / "SCHEMA.md"
    write_cases(tmp_path, [])
    assert table() in docs and table(KNOWN) in schema.read_text()
    assert all(f'"{word}",  # {meaning}\n' in template for word, meaning in MEANINGS.items())


def test_a_failure_is_told_without_empty_fields() -> None:
    """Betti says both works and names nodal forces; what is not known leaves no mark."""
    row = kept.KeptRow("analysis", "x", "<= 1", "why", "", "fails", 2.0, "", "")
    assert kept.told(row) == "fails (2)."
    assert kept.told(replace(row, where="here", look="there")) == "fails (2); here. Look at there."


def test_betti_says_where() -> None:
    betti = next(check for check in every() if check.name == "Betti's reciprocity")
    assert "point forces do" in betti.observe(PointMethod("tent", tent)).where and "reach the nodes" in betti.look

"""The tutorial, as a script and as commands: the effect that the bench hid is found, with the page's numbers.

Both simulate and look at the same session of the real length; it is diagnosed once.
"""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from collections.abc import Iterator
from html import escape
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import fingerlab
import fingerlab.diagnosis
import fingerlab.prediction
from fingerlab.core.errors import UserError
from fingerlab.core.text import percent
from fingerlab.sessions import file_hash
from tests.docs.console import console_lines
from tests.docs.shelf import ROOT, Remembered, run, stop_the_clock

SCRIPT = ROOT / "docs" / "hidden_effect_story.py"
PAGE = ROOT / "docs" / "hidden-effect.md"
SAME = 0.25
"""By how much a printed number may differ from that of this machine and version, as a share of it."""


@pytest.fixture(scope="module", autouse=True)
def _once() -> Iterator[None]:
    """What was worked out for the script is not worked out again for the commands."""
    diagnosis, prediction = fingerlab.diagnosis, fingerlab.prediction
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis, "diagnose", Remembered(diagnosis.diagnose))
        patch.setattr(prediction, "fit_extended", Remembered(prediction.fit_extended))
        stop_the_clock(patch)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("story")


@pytest.fixture(scope="module")
def story(folder: Path) -> dict[str, Any]:
    spec = importlib.util.spec_from_file_location("hidden_effect_story", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module: ModuleType = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    told: dict[str, Any] = module.tell(folder / "out")
    return told


@pytest.fixture(scope="module")
def model(story: dict[str, Any]) -> Any:
    """Another model than the story's own, so that naming effects is tried too."""
    return story["diagnosis"].fit(["motor_coulomb_friction"])


def test_the_story_finds_what_the_bench_hid(story: dict[str, Any]) -> None:
    hidden = list(story["hidden"])
    assert len(hidden) == 1
    assert list(story["diagnosis"].missing) == hidden
    assert story["diagnosis"].verdict == "missing_effect"
    assert story["again"].verdict == "nothing_missing"
    assert story["again"].missing == ()
    assert story["again"].left_open == story["again"].result.set
    assert story["diagnosis"].left_open == ()
    assert story["again"].score < 0.5 * story["diagnosis"].score


def test_it_predicts_better_with_the_effect_and_the_interval_holds(story: dict[str, Any]) -> None:
    prediction = story["prediction"]
    assert prediction.r2("extended") > prediction.r2("nominal") > 0.9
    assert prediction.r2() == prediction.r2("extended")
    with pytest.raises(UserError, match="no model 'mine'; it has extended and nominal"):
        prediction.r2("mine")
    assert prediction.coverage() == pytest.approx(0.9, abs=0.05)
    assert "each predicted by a fit that has not seen it" in " ".join(repr(prediction).split())


def test_the_figures_are_matplotlib_s_and_lie_in_the_folder(story: dict[str, Any], folder: Path) -> None:
    from matplotlib.figure import Figure

    figures = story["diagnosis"].figures()
    assert {"error-path", "worst-place", "fingerprint-motor-presliding"} <= set(figures)
    assert all(isinstance(figure, Figure) for figure in figures.values())
    written = sorted(path.name for path in (folder / "out" / "figures").iterdir())
    assert written == sorted(f"{name}.png" for name in figures)
    with pytest.raises(UserError, match="exists"):
        figures.save(folder / "out" / "figures")


def test_a_diagnosis_prints_its_answer_and_its_numbers(story: dict[str, Any]) -> None:
    diagnosis = story["diagnosis"]
    text = repr(diagnosis)
    assert text.startswith("Presliding on the motor side is missing from the nominal model")
    assert f"{diagnosis.score:.2f} times the floor" in text
    assert "motor_presliding" in text
    assert max(len(line) for line in text.splitlines()) <= 90
    page = diagnosis._repr_html_()
    assert page.count("<table>") == page.count("</table>") == 2
    assert escape(percent(diagnosis.result.candidates[0].probability)) in page
    assert diagnosis.path[0] == (None, pytest.approx(diagnosis.score, rel=1e-6))
    assert json.dumps(diagnosis.to_json(), allow_nan=False)
    assert diagnosis.candidate("motor_presliding").in_set
    with pytest.raises(UserError, match="was not tried"):
        diagnosis.candidate("gremlins")
    with pytest.raises(UserError, match="curves=True"):
        story["again"].figures()


def test_a_model_is_kept_and_comes_back(model: Any, folder: Path) -> None:
    assert model.effects == ("motor_coulomb_friction",)
    kept = fingerlab.load_model(model.save(folder / "model.json"))
    assert kept.parameters == model.parameters
    assert repr(kept) == repr(model)
    assert "Moment arm at the PIP, flexion cable" in repr(kept)
    assert kept.parameters["arm_pip@flexion"].unit == "m"
    with pytest.raises(UserError, match="exists"):
        model.save(folder / "model.json")


STORY_DID = (
    "diagnosis = session.diagnose(",
    "model = diagnosis.fit(",
    "prediction = model.predict(session)",
    'fingerlab.simulate("practice.h5", "rich", hidden=True, seed=7).diagnose(',
)
"""Lines of the page whose work the story has done already, with the same calls."""


def test_every_line_of_the_page_on_notebooks_runs(
    story: dict[str, Any], model: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (SCRIPT.parent / "notebook.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    lines = [line.split("  #")[0].strip() for block in blocks for line in block.splitlines() if line.strip()]
    calls = re.findall(r"^\| `(session[^`]+)`", page, re.MULTILINE)
    monkeypatch.chdir(folder / "out")
    Path("practice.h5").write_bytes(Path("session.h5").read_bytes())
    names = {**story, "model": model}
    done = [line for line in lines if line.startswith(STORY_DID)]
    assert len(done) == len(STORY_DID)
    for line in [*(line for line in lines if line not in done), *calls]:
        exec(line, names)
    assert set(names["session"].to_xarray().children) == {f"{number:03d}" for number in range(1, 15)}
    assert Path("model.json").is_file()


def told(pattern: str, text: str) -> list[float]:
    """The numbers of the first place that fits."""
    found = re.search(pattern, " ".join(text.split()))
    assert found is not None, pattern
    return [float(group) for group in found.groups()]


FACTS = (
    r"falls from ([\d.]+) to ([\d.]+) times the bench's own repeatability",
    r"Joint torque ([\d.]+) ([\d.]+) mN m ([\d.]+)",
    r"friction torque at the gearbox output ([\d.]+) ±",
    r"motor_presliding: torque = ([\d.]+) N m, travel = ([\d.]+) rad",
)
"""Numbers of the page that are looked up in what its commands print."""


def test_the_worked_example_prints_what_its_page_says(
    story: dict[str, Any], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text(encoding="utf-8")
    told_of = [c for c in console_lines(page) if not c.reason and c.words[0] != "report"]  # elsewhere
    printed = "\n".join(run(command.words) for command in told_of)
    assert file_hash(tmp_path / "session.h5") == file_hash(folder / "out" / "session.h5")
    for fact in FACTS:
        assert told(fact, printed) == pytest.approx(told(fact, page), rel=SAME), fact
    rows = re.findall(
        r"^\| (nominal|with the effect), PIP and MCP \| ([\d.]+) .*?\| ([\d.]+) ±", page, re.MULTILINE
    )
    assert len(rows) == 2
    for name, r2, error in rows:
        word = "nominal" if name == "nominal" else "extended"
        cells = rf"{word} *│ *PIP and MCP *│ *([\d.]+) ±[^│]*│[^│]*│ *([\d.]+) ±"
        shown = re.search(cells, printed)
        assert shown is not None, printed
        assert float(shown[1]) == pytest.approx(float(r2), abs=0.01)
        assert float(shown[2]) == pytest.approx(float(error), rel=SAME)
    assert "Presliding on the motor side is missing" in " ".join(printed.split())

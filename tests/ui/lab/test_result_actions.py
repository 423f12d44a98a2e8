"""From the Model lab onwards, by clicks: the proposed recording, the force in Predict, a saved model."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.error_parts import EquationError, RowAndScore
from fingerlab.diagnosis.answer.results import HeldOutRuns
from fingerlab.models.file import load_model, project_path
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import load_preset, single_run
from fingerlab.twin.session import write_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.controller import ModelHistory, ModelStep
from fingerlab.ui.lab.validation import ValidationPanel
from fingerlab.ui.predict.predict_tab import PredictTab

from .. import invented
from ..hands import PATIENCE, child, click, invented_diagnosis, lab_of, lab_with, wait_for_result
from ..looking import cut_off, overlapping


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short simulated session on air and in contact."""
    path = tmp_path_factory.mktemp("lab") / "pressed.h5"
    sine = {"kind": "sine", "frequency_hz": 0.8, "duration_s": 8.0}
    plans = [single_run({**sine, "amplitude_deg": 10.0, "offset_deg": 20.0}, "on_air", "flexion")]
    plans += [single_run({**sine, "amplitude_deg": a}, "contact") for a in (1.2, 1.6)]
    write_session(path, load_preset("practice"), "short", plans, parse_effects(("coulomb_friction",)), 5)
    return path


@pytest.fixture
def window(qtbot: QtBot, make_window: Any, pressed: Path) -> MainWindow:
    tabs = tuple(e for e in lab_with(invented_diagnosis) if e.key in ("predict", "model_lab"))
    made: MainWindow = make_window(tab="model_lab", tabs=tabs)
    project_path([pressed]).unlink(missing_ok=True)  # of the test before
    made.context.open_paths([pressed])
    wait_for_result(qtbot, made)
    QTest.keyClick(made, Qt.Key.Key_F6)
    assert child(made, QPushButton, "handExperiment").isVisible()
    return made


def test_what_became_of_the_force_is_said_where_the_model_is_judged(qtbot: QtBot) -> None:
    with_force, added = (
        replace(one, errors={**one.errors, "endpoint_force": EquationError("N", rmse, 0.99, 0.05)})
        for one, rmse in ((invented.nominal_diagnosis("a"), 0.91), (invented.friction_diagnosis("a"), 0.06))
    )
    panel, history = ValidationPanel(), ModelHistory([ModelStep((), with_force)])
    qtbot.addWidget(panel)
    panel.show_history(history)
    assert "The error of the endpoint force on them is 0.910 N (floor 0.050 N)." in panel.held_out.text()
    history.push(ModelStep(("coulomb_friction",), added))
    panel.show_history(history)
    assert "goes from 0.910 to 0.060 N (floor 0.050 N)." in panel.held_out.text()


def test_why_the_row_is_far_from_the_error_over_all_is_said_there(qtbot: QtBot) -> None:
    """58 mN m is 7.25 floors of 8 mN m; the moments that a score hardly counts are told."""
    panel = ValidationPanel()
    qtbot.addWidget(panel)
    alone = replace(
        invented.nominal_diagnosis("a"),
        score=2.3,
        errors={"motor_torque": EquationError("N m", 0.058, 0.99, 0.008)},
        row_and_score=RowAndScore(runs=1.0, stuck=0.32),
    )
    panel.show_history(ModelHistory([ModelStep((), alone)]))
    said = panel.held_out.text()
    assert "2.30 floors and the row's 7.25" in said
    assert "the moments at which the motor sticks" in said
    assert "differ by" not in said


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_where_the_panel_is_narrow_buttons_go_on_below_and_a_row_stays_one_line(qtbot: QtBot) -> None:
    sine = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0}
    told = HeldOutRuns(("007", "008", "009"), "contact", "flexion", sine, 1.0)
    now = replace(invented.nominal_diagnosis("a"), held_out=(told, replace(told, runs=("010",), score=2.0)))
    panel = ValidationPanel()
    qtbot.addWidget(panel)
    panel.show_history(ModelHistory([ModelStep((), now)]))
    panel.show()
    buttons = (panel.hand, panel.predict, panel.save, panel.report)
    heights = []
    for width, rows in ((900, 1), (330, 2)):
        panel.resize(width, 500)
        QApplication.processEvents()
        assert len({button.y() for button in buttons}) == rows
        assert [*cut_off(panel), *overlapping(panel)] == []
        heights += [panel.runs.rowHeight(row) for row in range(2)]
    assert len(set(heights)) == 1
    cell = panel.runs.item(0, 0)
    assert cell.text() == "007 and 2 more · in contact, flexion, sine, 15°, 1 Hz"
    assert cell.toolTip() == "Runs 007, 008 and 009 · in contact, flexion, sine, 15°, 1 Hz"
    panel.show_history(None)
    assert not panel.runs.isVisible()


def test_the_proposed_recording_goes_to_acquire(window: MainWindow) -> None:
    handed: list[Any] = []
    window.context.protocol_handed.connect(lambda steps, title: handed.append((steps, title)))
    click(window, "handExperiment")
    ((steps, title),) = handed
    assert title == "Proposed by the Model lab"
    proposal = lab_of(window).controller.diagnosis.next_experiment  # type: ignore[union-attr]
    assert steps[-1].trajectory == proposal["trajectory"]
    assert (steps[-1].phase, steps[-1].cable) == ("on_air", "extension")


def test_a_proposed_change_of_the_machine_is_asked_for_in_acquire(
    window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    handed: list[Any] = []
    window.context.protocol_handed.connect(lambda steps, title: handed.append(steps))
    controller = lab_of(window).controller
    before = controller.diagnosis
    assert before is not None
    assert before.next_experiment is not None
    mass = {"added_mass": 0.013, "added_mass_at": 0.048}
    asked = replace(before, next_experiment={**before.next_experiment, "intervention": mass})
    monkeypatch.setattr(type(controller), "diagnosis", property(lambda self: asked))
    click(window, "handExperiment")
    ((change, record),) = handed
    assert "with 13 g fixed to the finger 48 mm beyond the PIP axis" in change.prompt
    assert record.attributes == {"intervention": json.dumps(mass)}
    panel = ValidationPanel()
    panel.show_history(ModelHistory([ModelStep((), asked)]))
    assert "with 13 g fixed to the finger 48 mm beyond the PIP axis" in panel.next.text()


def test_where_nothing_is_proposed_the_button_says_so(qtbot: QtBot, window: MainWindow) -> None:
    QTest.keyClick(window, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    wait_for_result(qtbot, window)
    qtbot.waitUntil(lambda: not child(window, QPushButton, "handExperiment").isEnabled(), timeout=PATIENCE)
    assert "No further recording" in child(window, QPushButton, "handExperiment").toolTip()


def test_the_force_of_the_model_is_predicted_in_its_tab(qtbot: QtBot, window: MainWindow) -> None:
    click(window, "predictForce")
    tab = window.tab("predict")
    assert isinstance(tab, PredictTab)
    qtbot.waitUntil(lambda: tab.found is not None and not window.tasks.busy, timeout=6 * PATIENCE)
    assert window.current == "predict"
    assert list(tab.models) == ["Model lab"]
    ((_, force),) = tab.force.shown.values()
    # The sweep is there for a diagnosis' model, too, and begins with the force that is predicted anyway.
    assert force.sweep[0].peak == pytest.approx(force.numbers.prediction.peak_modelled, rel=1e-6)


def test_the_model_is_saved(
    qtbot: QtBot, window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "model.json"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(path), "")))
    click(window, "saveModel")
    qtbot.waitUntil(path.exists, timeout=6 * PATIENCE)
    qtbot.waitUntil(lambda: not window.tasks.busy, timeout=PATIENCE)
    assert load_model(path).method == "diagnosis"
    assert str(path) in child(window, QLabel, "message").text()


def test_a_model_is_not_saved_onto_a_folder(
    qtbot: QtBot, window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "kept.txt").write_text("kept", encoding="utf-8")
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(folder), "")))
    click(window, "saveModel")
    message = child(window, QLabel, "message")
    qtbot.waitUntil(lambda: str(folder) in message.text(), timeout=PATIENCE)
    assert f"{folder} cannot be written (it is a folder); choose" in message.text()
    assert "mistake" not in message.text()
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("models")] == ["models"]
    assert (folder / "kept.txt").read_text(encoding="utf-8") == "kept"


def test_revealing_shows_the_fingerprint_that_gave_it_away(qtbot: QtBot, window: MainWindow) -> None:
    QTest.keyClick(window, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    wait_for_result(qtbot, window)
    qtbot.waitUntil(lambda: lab_of(window).can_undo, timeout=PATIENCE)
    view = lab_of(window).view
    view.show_what_gave_it_away(["coulomb_friction"])
    # The model has it by now; what is shown is the residual of the model that did not.
    assert "What gave it away: Coulomb joint friction" in view.evidence.title.text()
    assert view.evidence.plot.fingerprint is not None
    assert view.evidence.isVisible()

"""The Predict tab as a person uses it: add models, tick them, look at numbers, take them away."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QFileDialog, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.identify.model_file import Model, load_model, save_model
from fingerlab.identify.prediction.beside import predict_beside
from fingerlab.identify.results import ParameterEstimate
from fingerlab.rig import Finger, Motor, Rig
from fingerlab.sessions import SessionWriter, open_session
from fingerlab.ui.predicting.tab import PredictTab
from fingerlab.ui.registry import Entry
from fingerlab.ui.window import MainWindow

from .hands import PATIENCE, child, click, drop

RATE, RADIUS, ALPHA, L2 = 1000.0, 0.015, np.radians(15.0), 0.024
K_PIP, B, LOSS = 0.06, 0.007, 0.0008
MCP, PIP = np.radians(20.0), np.radians(30.0)
RIG = Rig(Finger(0.0, 0.0, 0.0225, L2, 0.0, 0.0, 0.12, K_PIP, wrist_angle=ALPHA), Motor(pulley_radius=RADIUS))
PEAK, REST = 1.5, 0.5
"""The finger is held and has no mass: ``K theta2 = b T + L - 2 l2 F cos(theta1 + theta2 - alpha)``."""

TABS = (Entry(5, "predict", "Predict", "Predicts.", PredictTab),)


@pytest.fixture
def in_contact(tmp_path: Path) -> Path:
    """Two contact runs whose force swings between ``REST`` and ``PEAK``, with the tension that it takes."""
    time = np.arange(12_000) / RATE
    force = (PEAK + REST) / 2 + (PEAK - REST) / 2 * np.sin(2 * np.pi * time)
    tension = (K_PIP * PIP - LOSS + 2 * L2 * np.cos(MCP + PIP - ALPHA) * force) / B
    channels = {
        "motor_command": 0.01 * tension,
        "motor_position": 0.01 * tension,
        "motor_torque": tension * RADIUS,
        "motor_current": tension * RADIUS / (0.0302 * 4.3),
        "mcp_angle": np.full(len(time), MCP),
        "pip_angle": np.full(len(time), PIP),
        "endpoint_force": force,
    }
    path = tmp_path / "contact.h5"
    with SessionWriter(path, RIG, "known force") as writer:
        for _ in range(2):
            writer.add_run("contact", "flexion", RATE, {"kind": "sine", "frequency_hz": 1.0}, channels)
    return path


@pytest.fixture
def model_files(tmp_path: Path) -> tuple[Path, Path]:
    """The true parameters, and a moment arm that is ten per cent too small."""
    places = tmp_path / "true.json", tmp_path / "weak.json"
    for place, arm in zip(places, (B, 0.9 * B), strict=True):
        parameters = {
            "flexion/pip/extension/moment_arm": ParameterEstimate(arm, "m", arm, arm),
            "flexion/pip/extension/friction_loss": ParameterEstimate(LOSS, "N m", LOSS, LOSS),
        }
        save_model(Model("flexion-extension", parameters, ()), place)
    return places


@pytest.fixture
def window(qtbot: QtBot, make_window, in_contact: Path) -> MainWindow:  # type: ignore[no-untyped-def]
    made: MainWindow = make_window(tab="predict", tabs=TABS)
    made.desk.open_paths([in_contact], "predict")
    qtbot.waitUntil(lambda: bool(predict_of(made).sessions) and not made.tasks.busy)
    return made


def predict_of(window: MainWindow) -> PredictTab:
    tab = window.tab("predict")
    assert isinstance(tab, PredictTab)
    return tab


@pytest.fixture
def predicted(
    qtbot: QtBot, window: MainWindow, model_files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> MainWindow:
    answer: Callable[..., tuple[list[str], str]] = lambda *_: ([str(p) for p in model_files], "")  # noqa: E731
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", staticmethod(answer))
    click(window, "addModels")
    qtbot.waitUntil(lambda: predict_of(window).found is not None and not window.tasks.busy, timeout=PATIENCE)
    return window


def test_the_force_that_was_built_in_and_one_that_is_too_weak(
    in_contact: Path, model_files: tuple[Path, Path]
) -> None:
    found = predict_beside(open_session(in_contact), {p.name: load_model(p) for p in model_files})
    true, weak = (by_run["001"] for by_run in found.forces.values())
    assert found.preferred == tuple(found.forces)
    assert true.modelled == pytest.approx(true.measured, abs=1e-3)
    assert true.numbers.prediction.peak_modelled == pytest.approx(PEAK, abs=2e-3)
    assert true.numbers.delay_s == 0.0
    # A tenth of the cable's torque is missing: 0.1 (K theta2 - L + lever F) / lever less at the peak.
    lever = 2 * L2 * np.cos(MCP + PIP - ALPHA)
    missing = 0.1 * ((K_PIP * PIP - LOSS) / lever + PEAK)
    assert weak.numbers.prediction.peak_modelled == pytest.approx(PEAK - missing, abs=2e-3)
    assert weak.numbers.error_by_phase["peak"] == pytest.approx(-missing, abs=0.03)
    # Scaled to 0..1 both are the same sine, from its least force on.
    sine = (1 - np.cos(2 * np.pi * weak.phase)) / 2
    assert weak.modelled_period == pytest.approx(sine, abs=5e-3)
    assert weak.measured_period == pytest.approx(sine, abs=5e-3)
    assert [step.angle_deg for step in weak.sweep] == [0, 15, 30, 45, 60]


def test_empty_and_waiting_say_what_will_be_here(make_window, window: MainWindow) -> None:  # type: ignore[no-untyped-def]
    assert child(window, QLabel, "predictEmpty").text() == "No model yet"
    none = make_window(tab="predict", tabs=TABS)
    assert child(none, QLabel, "predictEmpty").text() == "No session open"


def test_models_stand_beside_each_other_in_lines_that_differ(predicted: MainWindow) -> None:
    tab = predict_of(predicted)
    assert tab.numbers.rowCount() == 2
    assert tab.numbers.item(0, 1).text().startswith(("0.999", "1.0"))
    assert float(tab.numbers.item(1, 4).text()) < float(tab.numbers.item(0, 4).text())
    looks = [one for one, _ in tab.force.shown.values()]
    assert looks[0].style != looks[1].style
    assert looks[0].colour != looks[1].colour


def test_unticking_hides_a_model_and_the_other_keeps_its_line(predicted: MainWindow) -> None:
    tab = predict_of(predicted)
    names = list(tab.force.shown)
    kept = tab.force.shown[names[1]][0]
    tab.panel.list.setFocus()
    tab.panel.list.setCurrentRow(0)
    QTest.keyClick(tab.panel.list, Qt.Key.Key_Space)
    assert list(tab.force.shown) == [names[1]]
    assert tab.force.shown[names[1]][0] == kept
    assert tab.numbers.rowCount() == 1


def test_keys_go_from_run_to_run(predicted: MainWindow) -> None:
    QTest.keyClick(predicted, Qt.Key.Key_Down, Qt.KeyboardModifier.AltModifier)
    assert child(predicted, QComboBox, "predictRun").currentText() == "002"
    assert predict_of(predicted).numbers.rowCount() == 2


def test_removing_and_dropping_a_model(
    qtbot: QtBot, predicted: MainWindow, model_files: tuple[Path, Path]
) -> None:
    tab = predict_of(predicted)
    click(predicted, "removeModel")
    assert list(tab.models) == ["weak.json"]
    assert tab.numbers.rowCount() == 1
    click(predicted, "removeModel")
    assert child(predicted, QLabel, "predictEmpty").text() == "No model yet"
    assert model_files[0].exists()
    drop(predicted, model_files[0])
    qtbot.waitUntil(lambda: tab.found is not None, timeout=PATIENCE)
    assert list(tab.models) == ["true.json"]


def test_a_file_that_is_no_model_is_one_sentence(predicted: MainWindow, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.json"
    wrong.write_text("[]", encoding="utf-8")
    drop(predicted, wrong)
    assert "wrong.json is not a model file" in predicted.desk.log[-1]
    assert predict_of(predicted).numbers.rowCount() == 2

"""The Predict tab as a person uses it: add models, tick them, look at numbers, take them away."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFileDialog, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.models.file import ParameterEstimate, SavedModel, load_model, save_model
from fingerlab.prediction.comparing import predict_beside
from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions import SessionWriter, open_session
from fingerlab.ui.app.tab_registry import TabEntry
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.predict.predict_tab import PredictTab
from fingerlab.ui.predict.wanted_force import WantedPanel, outcome_words
from fingerlab.ui.widgets.tables import ElidedLabel
from tests.stage import stage_session

from ..hands import PATIENCE, child, click, drop
from ..looking import look
from ..saving import save_each_plot

RATE, RADIUS, ALPHA, L2 = 1000.0, 0.015, np.radians(15.0), 0.024
K_PIP, B, LOSS = 0.06, 0.007, 0.0008
MCP, PIP = np.radians(20.0), np.radians(30.0)
RIG = Rig(Finger(0.0, 0.0, 0.0225, L2, 0.0, 0.0, 0.12, K_PIP, wrist_angle=ALPHA), Motor(pulley_radius=RADIUS))
PEAK, REST = 1.5, 0.5
"""The finger is held and has no mass: ``K theta2 = b T + L - 2 l2 F cos(theta1 + theta2 - alpha)``."""

TABS = (TabEntry(5, "predict", "Predict", "Predicts.", PredictTab),)


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
        save_model(SavedModel("flexion-extension", parameters, ()), place)
    return places


@pytest.fixture
def window(qtbot: QtBot, make_window, in_contact: Path) -> MainWindow:  # type: ignore[no-untyped-def]
    made: MainWindow = make_window(tab="predict", tabs=TABS)
    made.context.open_paths([in_contact], "predict")
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
    assert child(window, QLabel, "predictEmpty").text() == "Predicting the force in contact.h5"
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


def test_without_a_contact_run_that_is_said_and_models_wait_for_one(
    qtbot: QtBot, make_window, tmp_path: Path, in_contact: Path, model_files: tuple[Path, Path]
) -> None:  # type: ignore[no-untyped-def]
    window = make_window(tab="predict", tabs=TABS)
    drop(window, stage_session(tmp_path))
    title = child(window, QLabel, "predictEmpty")
    qtbot.waitUntil(lambda: title.text() == "No force to predict", timeout=PATIENCE)
    drop(window, model_files[0])
    said = [one.text() for one in window.findChildren(QLabel) if "stage.h5 has no contact run" in one.text()]
    assert said
    assert f"{model_files[0].name} will wait for a session that has one" in said[0]
    drop(window, in_contact)
    qtbot.waitUntil(lambda: predict_of(window).found is not None, timeout=PATIENCE)


def test_models_stand_beside_each_other_in_lines_that_differ(predicted: MainWindow) -> None:
    tab = predict_of(predicted)
    assert tab.numbers.rowCount() == 2
    assert tab.numbers.item(0, 1).text().startswith(("0.999", "1.0"))
    assert float(tab.numbers.item(1, 4).text()) < float(tab.numbers.item(0, 4).text())
    looks = [one for one, _ in tab.force.shown.values()]
    assert looks[0].style != looks[1].style
    assert looks[0].colour != looks[1].colour
    # At 60 degrees the force's line has passed the joint, and the force would have to pull.
    for curve in child(predicted, QWidget, "sweepPlot").getPlotItem().listDataItems():
        assert np.isfinite(curve.getData()[1]).tolist() == [True] * 4 + [False]


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


def test_two_cursors_read_the_force_between_them(predicted: MainWindow) -> None:
    plot = predict_of(predicted).force
    plot.setFocus()
    QTest.keyClick(plot, Qt.Key.Key_C)
    assert plot.pair is not None
    assert plot.pair.times is not None
    read = child(predicted, QLabel, "forceRead")
    assert read.isVisible()
    a, b = plot.pair.times
    _, force = next(iter(plot.shown.values()))
    change = float(np.interp(b, force.time, force.measured) - np.interp(a, force.time, force.measured))
    assert read.text().startswith(f"B − A: {b - a:.3f} s, measured ")
    told = float(read.text().split("measured ")[1].split(",")[0].replace("−", "-"))
    assert told == pytest.approx(change, abs=6e-4)
    QTest.keyClick(predicted, Qt.Key.Key_Down, Qt.KeyboardModifier.AltModifier)
    assert plot.pair.times == pytest.approx((a, b))  # they stand where they stood, in the next run
    (name, (look, force)), other = plot.shown.items()
    parts = {part: getattr(force, part)[::3] for part in ("time", "measured", "half_width")}
    few = replace(force, **parts, modelled=2.0 * force.modelled[::3])
    plot.show_forces({name: (look, few), other[0]: other[1]})  # each model has its own samples
    times = np.interp([a, b], few.time, few.modelled)
    said = float(read.text().split(f"{name} ")[1].split(",")[0].removesuffix(" N").replace("−", "-"))
    assert said == pytest.approx(times[1] - times[0], abs=6e-4)
    window_width = predicted.width()
    predicted.resize(1000, 600)  # the names of the models have no room beside their numbers
    assert isinstance(read, ElidedLabel)
    values = re.findall(r" ([+−]\d\.\d{3})\b", read.text().partition("measured")[2])[1:]
    assert len(values) == 2
    assert read.fitting.endswith(f"models in the order of the list {', '.join(values)} N")
    predicted.resize(window_width, 760)
    QTest.keyClick(plot, Qt.Key.Key_C)
    assert not read.isVisible()


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
    undo, shift = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
    for names in ([], ["weak.json"], ["true.json", "weak.json"]):  # added, removed, removed
        QTest.keyClick(predicted, Qt.Key.Key_Z, undo)
        assert list(tab.models) == names
        assert tab.numbers.rowCount() == len(names)
    for _ in range(3):
        QTest.keyClick(predicted, Qt.Key.Key_Z, undo | shift)
    assert list(tab.models) == ["true.json"]
    assert not predicted.menus.redo.isEnabled()


def test_a_file_that_is_no_model_is_one_sentence(predicted: MainWindow, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.json"
    wrong.write_text("[]", encoding="utf-8")
    drop(predicted, wrong)
    assert "wrong.json is not a model file" in predicted.context.log[-1]
    assert predict_of(predicted).numbers.rowCount() == 2


def test_the_sweep_is_there_for_every_model_of_one_region(
    in_contact: Path, model_files: tuple[Path, Path]
) -> None:
    """Closed form: leaning by an angle shortens the lever from cos to cos less tan times sine."""
    found = predict_beside(open_session(in_contact), {"true.json": load_model(model_files[0])})
    (by_run,) = found.forces.values()
    distal = MCP + PIP - ALPHA
    for step in by_run["001"].sweep[:4]:
        lever = np.cos(distal) - np.tan(np.radians(step.angle_deg)) * np.sin(distal)
        assert step.peak == pytest.approx(PEAK * np.cos(distal) / lever, rel=5e-3)


def test_a_force_that_drifts_has_no_seam_inside_its_period(in_contact: Path, tmp_path: Path) -> None:
    """The load goes up by a third of its swing over the run; a period is drawn from least to least."""
    source = open_session(in_contact).runs[0].load()
    drift = 0.3 * source["time"] / source["time"][-1]
    lever = 2 * L2 * np.cos(MCP + PIP - ALPHA)
    source["endpoint_force"] = source["endpoint_force"] + drift
    source["motor_torque"] = source["motor_torque"] + RADIUS * lever * drift / B
    path = tmp_path / "drift.h5"
    with SessionWriter(path, RIG, "drift") as writer:
        kept = {name: values for name, values in source.items() if name != "time"}
        writer.add_run("contact", "flexion", RATE, {"kind": "sine", "frequency_hz": 1.0}, kept)
    parameters = {
        "flexion/pip/extension/moment_arm": ParameterEstimate(B, "m", B, B),
        "flexion/pip/extension/friction_loss": ParameterEstimate(LOSS, "N m", LOSS, LOSS),
    }
    model = SavedModel("flexion-extension", parameters, ())
    (by_run,) = predict_beside(open_session(path), {"m": model}).forces.values()
    steps = np.diff(by_run["001"].modelled_period)
    # A sine scaled to 0..1 rises by at most pi / k from one of k points to the next.
    assert np.abs(steps).max() < 1.15 * np.pi / len(by_run["001"].phase)
    # The step between the ends of the average period is no loading: every phase is found, and misses nothing.
    errors = by_run["001"].numbers.error_by_phase
    assert list(errors.values()) == pytest.approx([0.0] * 4, abs=0.01)


@pytest.fixture
def wanting(qtbot: QtBot, predicted: MainWindow) -> MainWindow:
    """The view of the wanted force, with a torque in it."""
    click(predicted, "view_wanted")
    qtbot.waitUntil(lambda: predict_of(predicted).wanted.plan is not None, timeout=PATIENCE)
    return predicted


def test_a_wanted_force_becomes_a_torque(qtbot: QtBot, wanting: MainWindow) -> None:
    view = predict_of(wanting).wanted
    assert view.plan is not None
    lever = 2 * L2 * np.cos(MCP + PIP - ALPHA)
    torque = RADIUS * (K_PIP * PIP - LOSS + lever * view.plan.force) / B
    assert view.plan.torque == pytest.approx(torque, rel=2e-3)
    assert view.plan.force.max() == pytest.approx(1.4)
    first = view.plan
    mean = child(wanting, QDoubleSpinBox, "wanted_mean_n")
    mean.setFocus()
    mean.selectAll()
    QTest.keyClicks(mean, "2")
    QTest.keyClick(mean, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: view.plan is not first and view.plan is not None, timeout=PATIENCE)
    assert view.plan.force.max() == pytest.approx(2.4)
    assert "mN m" in child(wanting, QLabel, "wantedResult").text()
    assert (
        child(wanting, QLabel, "wantedModelName").text()
        == child(wanting, QComboBox, "wantedModel").currentText()
    )


def test_a_torque_has_the_digits_of_its_interval(wanting: MainWindow) -> None:
    plan = predict_of(wanting).wanted.plan
    assert plan is not None
    ends, half = np.array([0.10634, 0.19683]), np.array([0.0022, 0.0071])
    known = replace(plan, torque=ends, half_width=half, current=np.array([0.81, 1.5]))
    assert outcome_words(known) == "106 ± 2 to 197 ± 7 mN m, 0.81 to 1.5 A"
    finer = replace(known, half_width=half / 10)
    assert outcome_words(finer) == "106.3 ± 0.2 to 196.8 ± 0.7 mN m, 0.81 to 1.5 A"


def test_a_force_beyond_the_limits_says_so_and_cannot_be_handed_over(
    qtbot: QtBot, wanting: MainWindow
) -> None:
    view = predict_of(wanting).wanted
    child(wanting, QDoubleSpinBox, "wanted_mean_n").setValue(9.0)
    words = child(wanting, QLabel, "wantedLimits")
    qtbot.waitUntil(lambda: "allow" in words.text(), timeout=PATIENCE)
    for name in ("saveTorque", "handTorque"):
        button = child(wanting, QPushButton, name)
        assert not button.isEnabled()
        assert "allow" in button.toolTip()
    child(wanting, QDoubleSpinBox, "wanted_mean_n").setValue(40.0)
    qtbot.waitUntil(lambda: "the rig's limit is 10 N" in words.text(), timeout=PATIENCE)
    assert view.plan is None  # no torque that nobody could send
    assert child(wanting, QLabel, "wantedResult").text() == ""
    child(wanting, QDoubleSpinBox, "wanted_mean_n").setValue(0.1)
    qtbot.waitUntil(lambda: "only press" in words.text(), timeout=PATIENCE)
    assert view.plan is None


def test_the_torque_is_saved_and_handed_to_acquire(
    wanting: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "wish.json"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(path), "")))
    click(wanting, "saveTorque")
    saved = json.loads(path.read_text(encoding="utf-8"))
    assert (saved["phase"], saved["cable"], saved["trajectory"]["kind"]) == ("contact", "flexion", "torque")
    assert read_trajectory(saved["trajectory"]).is_torque
    handed: list[object] = []
    wanting.context.protocol_handed.connect(lambda steps, title: handed.append((steps, title)))
    click(wanting, "handTorque")
    ((steps, title),) = handed
    assert title == "Wanted force, 0.6 to 1.4 N"
    assert [type(step).__name__ for step in steps] == ["Change", "Record"]
    assert steps[-1].trajectory == saved["trajectory"]


def test_a_wanted_force_from_a_file(
    qtbot: QtBot, wanting: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "wish.csv"
    table.write_text("time,force\n0,0.5\n2,1.5\n4,1.0\n", encoding="utf-8")
    view = predict_of(wanting).wanted
    box = child(wanting, QComboBox, "wantedKind")
    box.setCurrentIndex(box.findText("From a file"))
    assert "Choose a text table" in wait_for_words(qtbot, wanting)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(table), "")))
    click(wanting, "wantedFile")
    qtbot.waitUntil(lambda: view.plan is not None, timeout=PATIENCE)
    assert view.plan is not None
    assert view.plan.force[[0, 250, 750]] == pytest.approx([0.5, 1.0, 1.25])


def wait_for_words(qtbot: QtBot, window: MainWindow) -> str:
    label = child(window, QLabel, "wantedResult")
    qtbot.waitUntil(lambda: label.text().startswith("Choose"), timeout=PATIENCE)
    return label.text()


@pytest.mark.qt_log_ignore("This plugin does not support")  # dialogs, on a screen that is none
def test_every_plot_is_saved_in_every_format(wanting: MainWindow, tmp_path: Path) -> None:
    save_each_plot(wanting, tmp_path / "wanted", 2)
    click(wanting, "view_measured")
    save_each_plot(wanting, tmp_path / "measured", 3)


def test_the_pages_are_whole(make_window, predicted: MainWindow, wanting: MainWindow) -> None:  # type: ignore[no-untyped-def]
    look(make_window(tab="predict", tabs=TABS))
    look(wanting)
    panel = predict_of(wanting).wanted.panel
    for row in range(panel.wanted.kind.count()):
        panel.wanted.kind.setCurrentIndex(row)
        look(wanting)
    click(wanting, "view_measured")
    look(predicted)


def test_the_wanted_force_begins_within_what_was_recorded(qtbot: QtBot) -> None:
    """Until somebody asks for another one."""
    panel = WantedPanel()
    qtbot.addWidget(panel)
    panel.wanted.start_at(0.52, 0.14)
    mean, amplitude = (child(panel, QDoubleSpinBox, f"wanted_{name}_n") for name in ("mean", "amplitude"))
    assert (mean.value(), amplitude.value()) == (0.52, 0.14)
    mean.setFocus()
    mean.selectAll()
    QTest.keyClicks(mean, "0.6")
    QTest.keyClick(mean, Qt.Key.Key_Return)
    panel.wanted.start_at(0.31, 0.07)
    assert (mean.value(), amplitude.value()) == (0.6, 0.07)

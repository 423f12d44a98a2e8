"""Acquire, as a person works it: buttons and keys of the real window, the rig on a virtual clock."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.machine import Mode
from fingerlab.acquisition.protocol import Change, Record
from fingerlab.devices.faults import Faults
from fingerlab.sessions import open_session
from fingerlab.ui.acquire import tab as acquire_tab
from fingerlab.ui.window import MainWindow

from .bench_hands import PATIENCE, Rig, opener, tabs_with
from .hands import LEFT, child, drop

CONTROL = Qt.KeyboardModifier.ControlModifier
WindowMaker = Callable[..., MainWindow]


@pytest.fixture
def connect(make_window: WindowMaker, settings, qtbot: QtBot, tmp_path: Path):  # type: ignore[no-untyped-def]
    def make(faults: Faults | None = None) -> Rig:
        settings.set_recordings(tmp_path / "recordings")
        return Rig(make_window(tab="acquire", tabs=tabs_with(opener(tmp_path / "rescue", faults))), qtbot)

    return make


@pytest.fixture
def rig(connect) -> Rig:  # type: ignore[no-untyped-def]
    made: Rig = connect()
    return made


@pytest.fixture(autouse=True)
def agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the end a person agrees to stop and close; tests of the question put their own answer here."""
    monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)


def send_drag(widget: QWidget, place: QPoint) -> None:
    """Move the mouse with its button down; QTest only moves it with the button up."""
    where = QPointF(place)
    everywhere = QPointF(widget.mapToGlobal(place))
    move = QEvent.Type.MouseMove
    event = QMouseEvent(move, where, everywhere, LEFT, LEFT, Qt.KeyboardModifier.NoModifier)
    QApplication.sendEvent(widget, event)


# the story


def test_from_connecting_to_a_file_that_opens(rig: Rig, qtbot: QtBot) -> None:
    motion = rig.tab.panel.motion
    motion.numbers["amplitude_deg"].setValue(12.0)
    motion.numbers["frequency_hz"].setValue(2.0)
    rig.start()
    assert rig.label("rigState") == "Running"
    assert rig.label("doing") == "sine, 12°, 2 Hz"
    rig.run(3.0)
    rig.click("record")
    rig.run(2.0)
    assert child(rig.window, QLabel, "sampleCount").isVisible()
    rig.click("record")
    rig.run(0.2)
    assert not rig.recording.recording
    rig.click("finish")
    rig.run(1.5)
    assert rig.mode is Mode.ENABLED
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
    session = open_session(rig.files()[0])
    (run,) = session.runs
    assert run.phase == "on_air"
    assert run.trajectory["amplitude_deg"] == 12.0
    # Recorded for 2 s at 1 kHz, in looks of 33 ms; the sine swings 12 degrees about 22.
    assert run.length == pytest.approx(2000, abs=70)
    position = run.load(["motor_position"])["motor_position"]
    assert math.degrees(position.max()) == pytest.approx(34.0, abs=1.0)
    assert math.degrees(position.min()) == pytest.approx(10.0, abs=1.0)
    assert rig.window.settings.recent()[0] == rig.files()[0].resolve()
    assert "Written and verified" in rig.label("message")
    assert rig.button("openRecording").isVisible()


def test_readings_are_what_the_bench_measures(rig: Rig) -> None:
    rig.start()
    rig.run(2.5)
    row = rig.bench.ring.last(1)[0]
    from fingerlab.acquisition.columns import COLUMN

    shown = rig.label("reading_motor_position").removesuffix("°").replace("−", "-")
    assert float(shown) == pytest.approx(math.degrees(row[COLUMN["motor_position"]]), abs=0.051)
    torque = rig.label("reading_motor_torque").removesuffix(" mN m").replace("−", "-")
    assert float(torque) == pytest.approx(1e3 * row[COLUMN["motor_torque"]], abs=0.051)
    drawn = rig.tab.plots.panes["displacement"].drawn("motor_position")[1]
    assert np.nanmax(drawn) == pytest.approx(37.0, abs=1.0)


def test_a_change_while_running_makes_no_jump(rig: Rig) -> None:
    rig.tab.panel.motion.numbers["amplitude_deg"].setValue(5.0)
    rig.start()
    rig.run(2.5)
    rig.tab.panel.motion.numbers["amplitude_deg"].setValue(9.0)
    rig.tab.panel.motion.numbers["frequency_hz"].setValue(1.5)
    assert rig.button("start").text() == "&Change"
    rig.click("start")
    rig.run(1.0)
    assert rig.mode is Mode.RUNNING, rig.bench.status().fault
    assert rig.label("doing") == "sine, 9°, 1.5 Hz"
    _, command = rig.station.history.series("motor_command", 0, rig.station.history.stop)
    # 9 degrees at 1.5 Hz is 85 degrees a second: 0.1 degrees a sample; a jump would be degrees.
    assert np.degrees(np.nanmax(np.abs(np.diff(command)))) < 0.25


# STOP


@pytest.mark.parametrize("state", ["idle", "initialised", "enabled", "running", "stopping", "recording"])
def test_stop_in_every_state(rig: Rig, state: str, qtbot: QtBot) -> None:
    if state == "initialised":
        rig.click("initialise")
    elif state == "enabled":
        rig.enable()
    elif state != "idle":
        rig.start()
        rig.run(0.5)
    if state == "stopping":
        rig.click("finish")
    if state == "recording":
        rig.click("record")
        rig.run(0.5)
    rig.click("stop")
    status = rig.bench.status()
    assert status.latched
    assert not status.enabled
    assert rig.bench.device.driven_current == 0.0  # type: ignore[attr-defined]
    rig.run(0.1)
    assert rig.label("rigState") == "Stopped, idle"
    assert rig.window.header.lamp.light == "fault"
    if state == "recording":
        qtbot.waitUntil(lambda: rig.bench.status().recording == 0, timeout=PATIENCE)
        rig.run(0.1)
        rig.click("write")
        qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
        assert open_session(rig.files()[0]).runs[0].length > 400
    rig.settle()
    rig.click("initialise")
    rig.run(0.1)
    assert not rig.button("enable").isEnabled()
    assert rig.button("enable").toolTip() == "The stop is latched; release it first, then enable."
    rig.click("release")
    rig.run(0.1)
    rig.click("enable")
    rig.run(0.1)
    assert rig.mode is Mode.ENABLED


def test_escape_stops_from_another_tab_and_from_a_field(rig: Rig) -> None:
    rig.start()
    rig.window.show_tab("model_lab")
    rig.key(Qt.Key.Key_Escape)
    assert not rig.bench.status().enabled
    rig.window.show_tab("acquire")
    rig.run(0.1)
    rig.click("release")
    rig.settle()
    rig.start()
    field = rig.tab.panel.motion.numbers["amplitude_deg"]
    field.setFocus()
    QTest.keyClick(field, Qt.Key.Key_Escape)
    assert not rig.bench.status().enabled


def test_recording_shows_in_the_header_of_another_tab(rig: Rig) -> None:
    rig.click("record")
    rig.window.show_tab("model_lab")
    rig.run(1.0)
    text = child(rig.window, QLabel, "sampleCount")
    assert text.isVisible()
    assert int(text.text().removesuffix(" samples").replace("\u202f", "")) > 500


def test_a_fault_is_one_sentence_and_only_a_reset_leads_on(connect) -> None:  # type: ignore[no-untyped-def]
    rig = connect(Faults(late={2500: 0.05}))
    rig.start()
    rig.run(2.5)
    assert rig.mode is Mode.FAULT
    assert rig.window.message.isVisible()
    assert rig.label("message") == rig.bench.status().fault
    assert rig.label("rigState") == "In fault"
    rig.tab.panel.refresh()
    assert not rig.button("initialise").isEnabled()
    rig.click("resetFault")
    rig.run(0.1)
    assert rig.mode is Mode.IDLE


# buttons that cannot be used


def test_a_refused_button_says_why(rig: Rig) -> None:
    for name, words in (
        ("enable", "The bench is idle; the amplifier is enabled after initialising"),
        ("start", "a trajectory runs when the amplifier is enabled"),
        ("finish", "only a running trajectory can be brought to rest"),
        ("release", "No stop is latched."),
        ("resetFault", "there is no fault to reset"),
        ("mark", "Nothing is being recorded."),
        ("write", "No run has been recorded yet."),
    ):
        assert not rig.button(name).isEnabled(), name
        assert words in rig.button(name).toolTip(), name
    rig.start()
    rig.run(0.3)
    assert "The motor is running" in rig.button("tare").toolTip()
    assert not child(rig.window, QComboBox, "phase").isEnabled()
    assert "disable it first" in child(rig.window, QComboBox, "phase").toolTip()


def test_impossible_motion_is_refused_in_one_sentence(rig: Rig) -> None:
    rig.enable()
    rig.tab.panel.motion.numbers["frequency_hz"].setValue(10.0)
    rig.tab.panel.motion.numbers["amplitude_deg"].setValue(120.0)
    rig.click("start")
    assert rig.mode is Mode.ENABLED
    assert "the limit" in rig.label("message")


def test_phase_and_cable_go_together(rig: Rig) -> None:
    phase, cable = (child(rig.window, QComboBox, name) for name in ("phase", "cable"))
    phase.setCurrentIndex(phase.findData("contact"))
    phase.activated.emit(phase.currentIndex())
    assert cable.currentData() == "flexion"
    assert rig.station.set_up.phase == "contact"
    cable.setCurrentIndex(cable.findData("extension"))
    cable.activated.emit(cable.currentIndex())
    assert "contact run presses with the flexion cable" in rig.label("message")
    assert cable.currentData() == "flexion"


# recording: pre-trigger, marker, pause, runs


def test_pre_trigger_records_what_was_before_the_key(rig: Rig, qtbot: QtBot) -> None:
    rig.run(3.0)
    rig.tab.panel.before.setValue(2.0)
    at = rig.bench.status().index
    rig.click("record")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    stop = rig.bench.status().index
    assert 2400 < run.length <= stop - (at - 2000) + 1
    ring = rig.bench.ring.copy(0, rig.bench.ring.written)[1]
    from fingerlab.acquisition.columns import COLUMN

    first = run.load(["motor_current"])["motor_current"][:100]
    start = at + 1 - 2000
    there = ring[:, COLUMN["index"]]
    known = ring[(there >= start) & (there < start + 100), COLUMN["motor_current"]]
    assert first == pytest.approx(known, abs=1e-6)


def test_marker_takes_the_moment_of_the_key_and_its_note(rig: Rig, qtbot: QtBot) -> None:
    began = rig.bench.status().index
    rig.click("record")
    rig.run(1.0)
    rig.key(Qt.Key.Key_M, CONTROL)
    moment = rig.bench.status().index
    note = child(rig.window, QLineEdit, "note")
    assert note.hasFocus()
    rig.run(0.5)  # the note takes its time
    QTest.keyClicks(note, "a light touch")
    QTest.keyClick(note, Qt.Key.Key_Return)
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    (marker,) = json.loads(markers) if isinstance(markers := run.attributes["markers"], str) else markers
    assert marker["note"] == "a light touch"
    assert marker["time"] == pytest.approx((moment - began) * 1e-3, abs=0.005)
    assert rig.tab.plots._marks == [(moment / 1000, "a light touch")]


def test_a_pause_is_a_gap(rig: Rig, qtbot: QtBot) -> None:
    rig.click("record")
    rig.run(0.5)
    rig.click("pauseRecording")
    rig.run(0.5)
    assert rig.button("pauseRecording").text() == "&Go on"
    assert rig.label("sampleCount").endswith("paused")
    rig.click("pauseRecording")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    steps = np.diff(run.load(["time"])["time"])
    assert steps.max() == pytest.approx(0.5, abs=0.1)
    assert np.median(steps) == pytest.approx(1e-3)


def test_several_runs_in_one_file(rig: Rig, qtbot: QtBot) -> None:
    for _ in range(2):
        rig.click("record")
        rig.run(0.3)
        rig.click("record")
        rig.run(0.2)
    assert rig.label("recordedText") == "2 runs, not yet written"
    rig.key(Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
    assert len(open_session(rig.files()[0]).runs) == 2


# the picture


def test_hold_scroll_back_and_go_live(rig: Rig) -> None:
    plots = rig.tab.plots
    rig.run(14.0)
    rig.key(Qt.Key.Key_P, CONTROL)
    assert plots.held
    shown = plots.shown
    rig.run(1.0)
    assert plots.shown == shown
    plots.scroll_bar.setValue(plots.scroll_bar.minimum())
    assert plots.shown[0] == pytest.approx(0, abs=40)
    x, _ = plots.panes["torque"].drawn("motor_torque")
    assert x[0] == pytest.approx(plots.shown[0] / 1000, abs=0.1)
    rig.click("hold")
    rig.run(0.1)
    assert plots.shown[1] == rig.station.history.stop


def test_cursors_tell_differences(rig: Rig) -> None:
    rig.start()
    rig.run(4.0)
    rig.click("hold")
    rig.key(Qt.Key.Key_K, CONTROL)
    plots = rig.tab.plots
    pane = plots.panes["displacement"]
    middle = pane.canvas.height() // 2
    for number, at in enumerate((3.0, 3.5)):
        assert pane.canvas.cursors is not None
        grip, target = (
            QPoint(round(pane.canvas.x_of(time)), middle) for time in (pane.canvas.cursors[number], at)
        )
        QTest.mousePress(pane.canvas, LEFT, Qt.KeyboardModifier.NoModifier, grip)
        send_drag(pane.canvas, target)
        QTest.mouseRelease(pane.canvas, LEFT, Qt.KeyboardModifier.NoModifier, target)
    a, b = plots.panes["torque"].canvas.cursors or (0.0, 0.0)
    assert (a, b) == pytest.approx((3.0, 3.5), abs=0.02)
    text = rig.label("cursorText")
    assert f"B − A: +{b - a:.3f} s ({1 / (b - a):.2f} Hz)" in text
    history = rig.station.history
    first, second = (history.value("motor_position", round(1000 * time)) for time in (a, b))
    change = math.degrees(second - first)
    assert f"position {change:.1f}°".replace("-", "−") in text


def test_trigger_starts_the_picture_at_the_crossing(rig: Rig) -> None:
    rig.tab.plots.set_window(2.0)
    rig.start()
    rig.run(6.0)
    trigger = rig.tab.toolbar.trigger
    trigger.on.setChecked(True)
    trigger.level.setValue(22.0)
    rig.run(1.0)
    at = rig.tab.plots.triggered_at
    assert at is not None
    history = rig.station.history
    before, after = (math.degrees(history.value("motor_position", at + d)) for d in (-1, 0))
    assert before < 22.0 <= after
    assert rig.tab.plots.shown[0] == pytest.approx(at - 200, abs=2)
    rig.run(0.3)
    first = rig.tab.plots.triggered_at
    rig.run(1.0)  # a sine of 1 Hz crosses again
    assert rig.tab.plots.triggered_at is not None
    assert rig.tab.plots.triggered_at - (first or 0) == pytest.approx(1000, abs=60)


def test_scale_stays_as_it_is_set(rig: Rig) -> None:
    pane = rig.tab.plots.panes["displacement"]
    pane.scale_button.automatic.setChecked(False)
    pane.scale_button.low.setValue(-50.0)
    pane.scale_button.high.setValue(70.0)
    rig.start()
    rig.run(2.0)
    assert pane.y_range == (-50.0, 70.0)
    assert pane.scale_button.text() == "Scale: set"
    pane.scale_button.automatic.setChecked(True)
    rig.run(1.0)
    low, high = pane.y_range
    assert -5 < low < 8
    assert 36 < high < 60


def test_model_beside_the_measurement(rig: Rig) -> None:
    rig.start()
    model = child(rig.window, QComboBox, "model")
    model.setCurrentIndex(1)
    model.activated.emit(1)
    rig.run(8.0)
    plots = rig.tab.plots
    assert plots.panes["torque_residual"].isVisible()
    assert not plots.panes["force_residual"].isVisible()  # no contact, no force to model
    error = rig.label("error_torque")
    assert error.startswith("error ")
    assert error.endswith(" mN m")
    history = rig.station.history
    _, measured = history.series("motor_torque", history.stop - 3000, history.stop - 100)
    _, residual = history.series("torque_residual", history.stop - 3000, history.stop - 100)
    assert np.isfinite(residual).all()
    # The practice bench's noise is 3 to 4 mN m; the torque itself swings by more than 20.
    assert residual.std() < 0.35 * measured.std()
    assert float(error.split()[1]) == pytest.approx(1e3 * np.sqrt(np.mean(residual**2)), rel=0.2)


# protocol


def test_protocol_asks_for_the_cable_and_writes_the_file(rig: Rig, qtbot: QtBot) -> None:
    form = rig.tab.panel.protocol
    rig.click("byProtocol")
    form.which.setCurrentIndex(2)
    form.runs.setValue(1)
    form.seconds.setValue(2.0)
    form.rest.setValue(0.5)
    assert "2 runs" in rig.label("protocolTotal")
    rig.click("runProtocol")
    prompt = rig.tab.prompt
    asked = []
    for _ in range(2):
        qtbot.waitUntil(prompt.isVisible, timeout=PATIENCE)
        asked.append(rig.label("prompt"))
        rig.tab.panel.refresh()
        assert "protocol is under way" in rig.button("start").toolTip()
        QTest.keyClick(prompt.button, Qt.Key.Key_Space)
        qtbot.waitUntil(lambda: not prompt.isVisible(), timeout=PATIENCE)
    assert asked[0].startswith("Fix the extension cable to the pulley")
    assert asked[1].startswith("Fix the flexion cable to the pulley")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.recording.in_protocol, timeout=PATIENCE)
    runs = open_session(rig.files()[0]).runs
    assert [(run.phase, run.cable) for run in runs] == [("on_air", "extension"), ("contact", "flexion")]
    assert [run.length for run in runs] == [2000, 2000]
    assert rig.tab.panel.progress.value() == 1000


def test_stop_ends_a_protocol_that_waits_for_the_operator(rig: Rig, qtbot: QtBot) -> None:
    rig.click("byProtocol")
    rig.click("runProtocol")
    qtbot.waitUntil(rig.tab.prompt.isVisible, timeout=PATIENCE)
    rig.key(Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not rig.recording.in_protocol, timeout=PATIENCE)
    assert not rig.tab.prompt.isVisible()
    assert "given up before a run was recorded" in rig.label("message")
    assert not rig.bench.status().enabled
    assert rig.files() == []


def test_a_protocol_handed_over_is_chosen(rig: Rig) -> None:
    from fingerlab.acquisition.commands import SetUp

    rig.window.show_tab("model_lab")
    sine = {"kind": "sine", "amplitude_deg": 5.0, "frequency_hz": 1.0, "duration_s": 3.0}
    steps = (Change(SetUp(), "Fix it."), Record(1, 1, "on_air", "extension", sine))
    rig.window.desk.hand_protocol(steps, "Tell friction from hysteresis")
    assert rig.window.current == "acquire"
    assert rig.tab.panel.protocol.which.currentText() == "Tell friction from hysteresis"
    assert rig.tab.panel.protocol.steps({}) == steps
    assert rig.button("runProtocol").isVisible()


def test_a_trajectory_handed_over_fills_the_fields(rig: Rig) -> None:
    given = {"kind": "chirp", "amplitude_deg": 9.0, "frequency_hz": 0.5, "end_frequency_hz": 4.0}
    rig.window.desk.hand_trajectory({**given, "offset_deg": 20.0, "duration_s": 25.0})
    settings = rig.tab.panel.motion.settings()
    assert settings == {**given, "offset_deg": 20.0, "duration_s": 25.0}


def test_a_dropped_table_is_the_trajectory(rig: Rig, tmp_path: Path) -> None:
    table = tmp_path / "profile.csv"
    table.write_text("time_s,angle_deg\n0,0\n1,20\n2,0\n", encoding="utf-8")
    drop(rig.window, table)
    assert rig.tab.panel.motion.settings()["file"] == str(table)
    rig.enable()
    rig.click("start")
    rig.run(1.2)
    assert rig.mode is Mode.RUNNING


# leaving


@pytest.mark.parametrize("yes", [False, True])
def test_closing_while_running_asks_and_stops_first(
    rig: Rig, yes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.start()
    rig.click("record")
    rig.run(1.0)
    bench, folder = rig.bench, rig.recording.details.folder
    monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: yes)
    rig.window.close()
    if not yes:
        assert rig.window.isVisible()
        assert bench.status().enabled
        monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)
        rig.window.close()
    assert not rig.window.isVisible()
    assert not bench.status().enabled
    assert bench.loop.ended
    (file,) = folder.glob("*.h5")
    assert open_session(file).runs[0].length > 900


def test_disconnect_leads_back_to_the_choice(rig: Rig, qtbot: QtBot) -> None:
    rig.click("disconnect")
    qtbot.waitUntil(lambda: not rig.station.caller.busy, timeout=PATIENCE)
    assert rig.button("connectSimulated").isVisible()
    assert rig.label("rigState") == "No rig"
    assert not child(rig.window, QLabel, "statusDevice").isVisible()


def test_what_was_recorded_is_one_click_away(rig: Rig, qtbot: QtBot) -> None:
    rig.click("record")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.station.caller.busy, timeout=PATIENCE)
    asked: list[list[Path]] = []
    rig.window.desk.open_paths = lambda paths, tab="": asked.append(list(paths))  # type: ignore[method-assign]
    rig.click("openRecording")
    assert asked == [rig.files()]


# looks


def test_no_text_is_cut_off_and_every_control_has_a_name(rig: Rig, qtbot: QtBot) -> None:
    rig.window.resize(1280, 800)
    rig.start()
    rig.run(1.0)
    qtbot.wait(20)
    assert (rig.window.width(), rig.window.height()) == (1280, 800)
    for button in rig.window.findChildren(QPushButton):
        if button.isVisible():
            assert button.width() >= button.minimumSizeHint().width(), button.text()
    for label in rig.window.findChildren(QLabel):
        if label.isVisible() and label.text() and not label.wordWrap() and label.minimumSizeHint().width():
            assert label.width() >= label.minimumSizeHint().width(), label.text()
    for widget in rig.window.findChildren(QWidget):
        tabbed = widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        if widget.isVisible() and tabbed and widget.focusProxy() is None:
            name = widget.accessibleName() or getattr(widget, "text", lambda: "")()
            assert name, f"{type(widget).__name__} {widget.objectName()} in {widget.parent()}"

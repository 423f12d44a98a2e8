"""Acquire, as a person works it: buttons and keys of the real window, the rig on a virtual clock."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QFrame, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.control.machine import Mode
from fingerlab.sessions import open_session
from fingerlab.ui.acquire import acquire_tab
from fingerlab.ui.acquire.live_history import QUANTITIES

from ..bench_hands import PATIENCE, Rig
from ..hands import child

CONTROL = Qt.KeyboardModifier.ControlModifier


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
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
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
    assert "Written and verified" not in rig.label("status")  # once is enough
    assert sum("Written and verified" in line for line in rig.window.context.log) == 1
    assert rig.button("openRecording").isVisible()


def test_a_reading_of_nothing_has_no_sign() -> None:
    assert QUANTITIES["endpoint_force"].text(-0.003) == "0.00 N"
    assert QUANTITIES["endpoint_force"].text(-0.006) == "−0.01 N"


def test_readings_are_what_the_bench_measures(rig: Rig) -> None:
    rig.start()
    rig.run(2.5)
    while not rig.controller.numbers_due:  # ten times a second; plots are drawn more often
        rig.run(0.033)
    row = rig.bench.ring.last(1)[0]
    from fingerlab.acquisition.ring import COLUMN

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
    _, command = rig.controller.history.series("motor_command", 0, rig.controller.history.stop)
    # 9 degrees at 1.5 Hz is 85 degrees a second: 0.1 degrees a sample; a jump would be degrees.
    assert np.degrees(np.nanmax(np.abs(np.diff(command)))) < 0.25


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
    assert rig.controller.set_up.phase == "contact"
    cable.setCurrentIndex(cable.findData("extension"))
    cable.activated.emit(cable.currentIndex())
    assert "contact run presses with the flexion cable" in rig.label("message")
    assert cable.currentData() == "flexion"


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
    rig.window.context.tell("The machine does not hold 1000 Hz: 3 of 4 cycles were lost.")
    assert child(rig.window, QFrame, "messageBar").isVisible()
    rig.click("disconnect")
    assert not child(rig.window, QFrame, "messageBar").isVisible()  # nothing outlives the rig it was said of
    assert child(rig.window, QLabel, "status").text() == "Disconnected"
    qtbot.waitUntil(lambda: not rig.controller.worker.busy, timeout=PATIENCE)
    assert rig.button("connectSimulated").isVisible()
    assert rig.label("rigState") == "No rig"
    assert not child(rig.window, QLabel, "statusDevice").isVisible()


def test_what_was_recorded_is_one_click_away(rig: Rig, qtbot: QtBot) -> None:
    rig.click("record")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
    asked: list[list[Path]] = []
    rig.window.context.open_paths = lambda paths, tab="": asked.append(list(paths))  # type: ignore[method-assign]
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

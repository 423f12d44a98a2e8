"""What is entered in Acquire's forms: predefined values, undo and redo, warnings beside them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QScrollArea, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.control.machine import initial_of
from fingerlab.acquisition.recording import LEAST_FREE_BYTES, seconds_of_room
from fingerlab.acquisition.ring import COLUMN
from fingerlab.core.errors import UserError
from fingerlab.rig.file import parse_rig
from fingerlab.ui.widgets.layout import SideRoom

from ..bench_hands import Rig
from ..hands import child
from ..looking import look
from ..saving import save_each_plot

CONTROL = Qt.KeyboardModifier.ControlModifier
REDO = CONTROL | Qt.KeyboardModifier.ShiftModifier


def newest(rig: Rig, column: str) -> float:
    """Mean of a column over the last tenth of a second, degrees."""
    return math.degrees(float(rig.bench.ring.last(100)[:, COLUMN[column]].mean()))


# predefined values


def test_initialising_sets_encoder_and_joints_to_predefined_values(rig: Rig) -> None:
    form = rig.tab.panel.initial
    assert form.text() == "To 0°, joints as calibrated"
    before = newest(rig, "pip_angle")
    form.position.setValue(12.0)
    form.sets["mcp"].setChecked(True)
    form.angles["mcp"].setValue(-7.0)
    assert form.text() == "To 12°, MCP −7°"
    rig.click("initialise")
    rig.run(0.4)
    assert newest(rig, "motor_position") == pytest.approx(12.0, abs=0.1)
    assert newest(rig, "mcp_angle") == pytest.approx(-7.0, abs=0.2)
    assert newest(rig, "pip_angle") == pytest.approx(before, abs=0.2)  # keeps its calibrated zero


def test_the_rig_file_names_the_values() -> None:
    values = initial_of(parse_rig("[initial]\nposition_deg = 5\npip_deg = 20.0\n", "x"))
    assert (math.degrees(values.position), values.mcp) == (pytest.approx(5.0), None)
    assert math.degrees(values.pip or 0.0) == pytest.approx(20.0)
    for text, words in (
        ("[initial]\nwrist_deg = 1", "wrist_deg"),
        ("[initial]\nmcp_deg = 1000", "360"),
        ("initial = 3", "is not a section"),
    ):
        with pytest.raises(UserError, match=words):
            initial_of(parse_rig(text, "x"))


# undo


def test_undo_and_redo_of_what_was_entered(rig: Rig, qtbot: QtBot) -> None:
    panel = rig.tab.panel
    amplitude, runs = panel.motion.numbers["amplitude_deg"], panel.protocol.runs
    amplitude.setValue(9.0)
    panel.history.note()
    panel.motion.kind.setCurrentIndex(1)
    panel.history.note()
    rig.click("byProtocol")
    runs.setValue(3)
    rig.window.setFocus()
    rig.key(Qt.Key.Key_Z, CONTROL)
    assert runs.value() == 10
    rig.key(Qt.Key.Key_Z, CONTROL)
    assert panel.motion.kind.currentData() == "sine"
    assert amplitude.isVisible()  # the form in which something changed is shown
    rig.key(Qt.Key.Key_Z, CONTROL)
    assert amplitude.value() == 15.0
    assert not rig.tab.can_undo
    rig.key(Qt.Key.Key_Z, REDO)
    assert amplitude.value() == 9.0
    panel.before.setValue(2.0)
    panel.history.note()
    assert not rig.tab.can_redo
    rig.key(Qt.Key.Key_Z, CONTROL)
    assert (panel.before.value(), amplitude.value()) == (0.0, 9.0)


def test_undo_from_within_a_field(rig: Rig) -> None:
    field = rig.tab.panel.motion.numbers["frequency_hz"]
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "2.5")
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert field.value() == 2.5
    rig.tab.panel.history.note()
    QTest.keyClick(field, Qt.Key.Key_Z, CONTROL)
    assert field.value() == 1.0


def test_a_trajectory_that_fills_the_fields_is_one_step(rig: Rig) -> None:
    motion = rig.tab.panel.motion
    before = motion.settings()
    given = {"kind": "chirp", "amplitude_deg": 9.0, "frequency_hz": 0.5, "end_frequency_hz": 4.0}
    motion.show_settings({**given, "offset_deg": 20.0, "duration_s": 25.0})
    assert motion.settings() == {**given, "offset_deg": 20.0, "duration_s": 25.0}
    rig.tab.panel.history.note()
    rig.tab.undo()
    assert motion.settings() == before


def test_turns_of_the_wheel_are_one_step(rig: Rig) -> None:
    field, history = rig.tab.panel.motion.numbers["offset_deg"], rig.tab.panel.history
    for value in (23.0, 24.0, 25.0):
        field.setValue(value)
        history.note()
    history.undo()
    assert field.value() == 22.0


# warnings


def test_room_is_told_in_minutes() -> None:
    # Seventeen channels of doubles at 1 kHz, and once more for the whole file: 272 kB a second.
    assert seconds_of_room(LEAST_FREE_BYTES + 272_000 * 60, 1000.0) == pytest.approx(60.0)
    assert seconds_of_room(0, 1000.0) == 0.0


def test_little_room_and_lost_cycles_are_warned_of(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    controller, real = rig.controller, rig.bench.status
    little = LEAST_FREE_BYTES + 272_000 * 60 * 8
    monkeypatch.setattr(rig.bench, "status", lambda: replace(real(), free_bytes=little, lost=3))
    controller.tick()
    assert "room for 8 more minutes" in rig.label("message")
    assert rig.label("recordWarning") == "⚠ 3 cycles lost, room for 8 min of recording"
    assert "⚠ 3 cycles lost" in child(rig.window, QLabel, "statusDevice").text()
    rig.window.context.hush()
    controller.tick()
    assert not rig.window.message.isVisible()  # told once


def test_a_torque_given_point_by_point_can_be_chosen(rig: Rig, tmp_path: Path) -> None:
    motion = rig.tab.panel.motion
    rig.choose("kind", "torque")
    table = tmp_path / "torque.csv"
    table.write_text("time_s,torque_n_m\n0,0\n1,0.02\n2,0\n", encoding="utf-8")
    motion.show_file(table)
    assert motion.settings() == {"kind": "torque", "file": str(table), "until_stopped": True}


@pytest.mark.qt_log_ignore("This plugin does not support")  # dialogs, on a screen that is none
def test_every_form_is_whole_and_every_live_plot_is_saved(rig: Rig, tmp_path: Path) -> None:
    panel = rig.tab.panel
    save_each_plot(rig.window, tmp_path / "plots", 4)
    rig.tab.toolbar.model_chosen.emit("nominal")
    for kind in ("chirp", "steps", "file"):  # every field is in one of them
        rig.choose("kind", kind)
        look(rig.window)
    rig.choose("phase", "motor_bench")
    rig.wait_idle()
    look(rig.window)
    rig.click("byProtocol")
    for which in ("own_both", "rich", "force_trial"):
        panel.protocol.which.setCurrentIndex(panel.protocol.which.findData(which))
        look(rig.window)


def test_on_a_low_screen_the_panel_scrolls_and_the_plots_stay(rig: Rig) -> None:
    """1920 x 1080 at 200 %: every button is reached by the keyboard, and nothing scrolls sideways."""
    rig.tab.toolbar.model_chosen.emit("nominal")
    rig.run(0.2)
    rig.window.resize(960, 540)
    QApplication.processEvents()
    room = rig.window.work.currentWidget()
    assert isinstance(room, QScrollArea)
    assert room.horizontalScrollBar().maximum() == room.verticalScrollBar().maximum() == 0
    side = rig.tab.panel.parentWidget().parentWidget()
    assert isinstance(side, SideRoom)
    assert side.verticalScrollBar().maximum() > 0
    for pane in rig.tab.plots.panes.values():
        if pane.isVisible():
            assert not pane.visibleRegion().isEmpty()
            assert pane.canvas.area.height() >= 24  # of the curves themselves
    last = rig.button("details")
    assert last.visibleRegion().isEmpty()
    rig.button("write").setFocus()
    for _ in range(40):
        if last.hasFocus():
            break
        QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
    assert last.hasFocus()
    assert not last.visibleRegion().isEmpty()
    speed = rig.tab.plots.panes["displacement"].readings["motor_speed"]
    assert not speed.isVisible()
    rig.window.resize(1280, 760)
    QApplication.processEvents()
    assert speed.isVisible()
    assert side.verticalScrollBar().maximum() == 0


def test_no_scroll_bar_lies_over_the_fields_and_short_forms_leave_no_gap(rig: Rig, qtbot: QtBot) -> None:
    """At 1280 x 720 with a notice below, in every mode: the bar beside them, the recording close."""
    panel = rig.tab.panel
    rig.window.resize(1280, 720)
    rig.window.context.tell("The sensors were calibrated with another rig file; calibrate them again.")
    side = panel.parentWidget().parentWidget()
    assert isinstance(side, SideRoom)
    scrolled = 0

    def gap(last: QWidget) -> int:
        below = panel.record.mapTo(panel, QPoint()).y()
        return below - last.mapTo(panel, QPoint(0, last.height())).y()

    for page, field, last in (
        ("byHand", panel.motion.kind, panel.hand_left),
        ("byProtocol", panel.protocol.which, panel.left),
    ):
        rig.click(page)
        for index in range(field.count()):
            field.setCurrentIndex(index)
            field.activated.emit(index)
            qtbot.wait(50)  # layout within layout
            assert gap(last) < 90, field.currentText()  # the heading lies between
            assert side.viewport().width() >= panel.width(), field.currentText()
            scrolled += side.verticalScrollBar().maximum() > 0
    assert scrolled

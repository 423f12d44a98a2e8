"""What a person does in the window, by real clicks, keys and drops on the real widgets.

The diagnosis is made of closed forms here (``invented.py``), so that every number on the screen has a
known value; ``test_real_diagnosis.py`` does the same with the instrument's own.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QTextBrowser
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.tables import ElidedLabel

from .. import invented
from ..hands import (
    LEFT,
    PATIENCE,
    Held,
    child,
    chosen_in_menu,
    click,
    drop,
    invented_diagnosis,
    lab_of,
    wait_for_result,
)
from ..looking import look
from ..saving import save_each_plot


def test_empty_window_offers_to_open_and_to_practise(make_window) -> None:  # type: ignore[no-untyped-def]
    window = make_window()
    assert child(window, QPushButton, "emptyOpen").isVisible()
    assert child(window, QPushButton, "practise").isVisible()
    assert not lab_of(window).view.isVisible()


def test_opening_through_the_dialog_shows_model_and_measurement(opened: MainWindow) -> None:
    assert lab_of(opened).view.isVisible()
    assert "invented.h5" in child(opened, QLabel, "sessionName").text()
    assert opened.windowTitle().startswith("invented.h5")
    # Equation and run of the worst stretch; SI torque in millinewton metres on the screen.
    assert lab_of(opened).view.bar.equation() == "mcp_torque"
    assert lab_of(opened).view.bar.runs.currentText() == "Run 002 · on air, extension, sine, 15°, 1 Hz"
    time, residual = lab_of(opened).view.plot.residual.series
    flexing = (np.cos(2 * np.pi * time) > 0.2) & np.isfinite(residual)
    assert residual[flexing].mean() == pytest.approx(1e3 * invented.FRICTION, rel=0.02)
    assert child(opened, QLabel, "stretchName").text() == "start of flexion, low speed"
    assert all(stretch.isVisible() for stretch in lab_of(opened).view.plot.stretches)
    assert lab_of(opened).view.plot.stretches[0].getRegion() == pytest.approx((4.7, 5.3))
    low, high = lab_of(opened).view.plot.floor_band.getRegion()
    assert (low, high) == pytest.approx((-0.4, 0.4))


def test_a_narrow_head_says_less_and_not_half(opened: MainWindow) -> None:
    name = child(opened, ElidedLabel, "sessionName")
    whole = "invented.h5 · 3 runs: on air"
    assert name.text() == whole == name.toolTip()
    for wording in (whole, "invented.h5 · 3 runs", "invented.h5"):
        name.resize(name.fontMetrics().horizontalAdvance(wording) + 1, name.height())
        assert name.seen == wording
    name.resize(40, name.height())
    assert name.seen.endswith("…")


def test_both_plots_share_the_time_axis(opened: MainWindow) -> None:
    plot = lab_of(opened).view.plot
    plot.setFocus()
    before = plot.top.viewRange()[0]
    QTest.keyClick(plot, Qt.Key.Key_Plus)
    after = plot.top.viewRange()[0]
    assert after[1] - after[0] == pytest.approx((before[1] - before[0]) / 1.5, rel=1e-6)
    assert plot.bottom.viewRange()[0] == pytest.approx(after)
    QTest.keyClick(plot, Qt.Key.Key_Home)
    assert plot.top.viewRange()[0] == pytest.approx(before)


def test_the_cursor_tells_the_values_under_it(opened: MainWindow, qtbot: QtBot) -> None:
    plot, said = lab_of(opened).view.plot, lab_of(opened).view.legend.values
    view = plot.top.getViewBox()
    # Early in a period of 1 s: the spring torque rises and friction is on its positive side.
    place = plot.mapFromScene(view.mapViewToScene(QPointF(3.2, 10.0)))
    QTest.mouseMove(plot.viewport(), place)
    qtbot.waitUntil(lambda: said.text() != "", timeout=PATIENCE)
    time, _, rest = said.text().partition(" s: measured ")
    moment = 2 * np.pi * float(time)
    spring = 1e3 * invented.STIFFNESS * invented.AMPLITUDE * np.sin(moment)
    modelled = float(rest.split("modelled ")[1].split(" ")[0])
    assert modelled == pytest.approx(spring, abs=0.01)
    residual = float(rest.split("residual ")[1].split(" ")[0])
    assert residual == pytest.approx(1e3 * invented.FRICTION, abs=4 * 1e3 * invented.NOISE)


def test_clicking_a_candidate_shows_its_fingerprint(opened: MainWindow) -> None:
    lab = lab_of(opened).view
    assert child(opened, QLabel, "verdict").text() == "Missing: Coulomb joint friction, 83\u00a0%"
    assert "Stribeck" in child(opened, QLabel, "setText").text()
    view = lab.candidates.view
    row = lab.candidates.list.index_of("stribeck_friction")
    QTest.mouseClick(view.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, view.visualRect(row).center())
    assert lab.evidence.title.text().startswith("Stribeck joint friction")
    assert "MCP friction torque 5.1 mN m (4.2 to 6.8)" in lab.evidence.title.toolTip()
    x, curve = lab.evidence.plot.curve.getData()
    assert x[-1] == pytest.approx(np.degrees(1.8))
    assert curve[-1] == pytest.approx(5.1)
    alike = lab.evidence.plot.alike["Coulomb joint friction"]  # side by side with what it could be as well
    assert alike.getData()[1][-1] == pytest.approx(4.8, abs=0.05)
    assert "Coulomb joint friction" in lab.evidence.plot.toolTip()
    assert "look-alikes" in lab.evidence.keys.accessibleName()
    lab.candidates.choose("gravity_tilt")
    assert not lab.evidence.plot.alike
    lab.candidates.choose("stribeck_friction")
    QTest.keyClick(view, Qt.Key.Key_Up)
    assert lab.evidence.title.text().startswith("Coulomb joint friction")
    assert "MCP friction torque 4.8 ± 0.2 mN m" in lab.evidence.title.toolTip()


def test_effects_that_cannot_be_told_apart_are_marked(opened: MainWindow) -> None:
    rows = {row.key: row for row in lab_of(opened).view.candidates.list.rows}
    assert [key for key, row in rows.items() if row.in_set] == ["coulomb_friction", "stribeck_friction"]
    assert not rows["gravity_tilt"].detectable
    assert list(rows)[-1] == "gravity_tilt"
    assert sum(row.probability for row in rows.values()) == pytest.approx(1.0)


def test_adding_the_effect_makes_the_error_fall_and_undo_brings_it_back(
    qtbot: QtBot, opened: MainWindow
) -> None:
    lab = lab_of(opened).view
    table, path = lab.path.table, lab.path.path
    assert table.cell("joint_torque", "now") == "4.81"
    assert [bar.tried for bar in path.bars] == [True, False]
    click(opened, "addToModel")
    qtbot.waitUntil(lambda: lab.controller.history.can_undo and not opened.tasks.busy, timeout=PATIENCE)
    assert table.cell("joint_torque", "nominal") == "4.81"
    assert table.cell("joint_torque", "now") == "0.44"
    assert "4.81 → <b>0.44</b> mN m" in child(opened, QLabel, "equationError").text()
    assert [(bar.title, bar.score, bar.tried) for bar in path.bars] == [
        ("Nominal", 12.4, True),
        ("+ Coulomb joint friction", 1.1, True),
    ]
    assert lab.steps.current() == "true"
    assert lab.steps.result("add") == "Coulomb joint friction"
    assert child(opened, QLabel, "verdict").text() == "Nothing more is missing"
    QTest.keyClick(opened, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert table.cell("joint_torque", "now") == "4.81"
    assert child(opened, QLabel, "verdict").text() == "Missing: Coulomb joint friction, 83\u00a0%"
    click(opened, "redo")
    assert table.cell("joint_torque", "now") == "0.44"
    click(opened, "undo")
    assert table.cell("joint_torque", "now") == "4.81"
    assert not child(opened, QPushButton, "undo").isEnabled()


def test_adding_keeps_the_view_that_the_user_chose(qtbot: QtBot, opened: MainWindow) -> None:
    lab = lab_of(opened).view
    click(opened, "equation_pip_torque")
    lab.bar.runs.setFocus()
    QTest.keyClick(lab.bar.runs, Qt.Key.Key_End)
    lab.plot.setFocus()
    QTest.keyClick(lab.plot, Qt.Key.Key_Plus)
    shown = lab.bar.equation(), lab.bar.runs.currentText(), lab.plot.top.viewRange()
    assert shown[0] == "pip_torque"
    assert shown[1].startswith("Run 003")
    lab.candidates.view.setFocus()
    QTest.keyClick(lab.candidates.view, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: lab.controller.history.can_undo, timeout=PATIENCE)
    assert (lab.bar.equation(), lab.bar.runs.currentText(), lab.plot.top.viewRange()) == shown


def test_the_steps_are_worked_by_keys(opened: MainWindow) -> None:
    lab = lab_of(opened).view
    assert lab.steps.current() == "add"
    assert lab.steps.result("where") == "start of flexion, low speed"
    QTest.keyClick(opened, Qt.Key.Key_3, Qt.KeyboardModifier.AltModifier)
    assert lab.bar.equation() == "cable_kinematics"
    QTest.keyClick(opened, Qt.Key.Key_F3)
    assert lab.steps.current() == "where"
    assert lab.bar.equation() == "mcp_torque"
    left, right = lab.plot.top.viewRange()[0]
    assert left < 4.7 < 5.3 < right < 8
    QTest.keyClick(opened, Qt.Key.Key_F5)
    assert QApplication.focusWidget() is lab.candidates.add_button
    QTest.keyClick(opened, Qt.Key.Key_F6)
    assert lab.validation.isVisible()
    assert "tell Coulomb joint friction from Stribeck joint friction" in lab.validation.next.text()
    QTest.keyClick(opened, Qt.Key.Key_F4)
    assert QApplication.focusWidget() is lab.candidates.view
    assert lab.evidence.isVisible()


def test_nothing_missing_is_an_outcome_like_the_others(opened: MainWindow) -> None:
    lab = lab_of(opened).view
    row = lab.candidates.list.index_of("nothing_missing")
    view = lab.candidates.view
    QTest.mouseClick(view.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, view.visualRect(row).center())
    assert lab.evidence.title.text() == "Nothing missing"
    assert "12.4 times" in lab.evidence.explanation.text()
    button = child(opened, QPushButton, "addToModel")
    assert not button.isEnabled()
    assert "nothing to add" in button.toolTip()


def test_dropping_a_session_opens_it(qtbot: QtBot, make_window, session_file: Path) -> None:  # type: ignore[no-untyped-def]
    window = make_window(diagnose=invented_diagnosis)
    drop(window, session_file)
    wait_for_result(qtbot, window)
    assert lab_of(window).view.isVisible()
    assert window.settings.recent() == [session_file.resolve()]


def test_a_wrong_file_is_one_sentence_and_what_was_open_stays(
    qtbot: QtBot, opened: MainWindow, tmp_path: Path
) -> None:
    wrong = tmp_path / "notes.rtf"
    wrong.write_text("not a session", encoding="utf-8")
    drop(opened, wrong)
    message = child(opened, QLabel, "message")
    qtbot.waitUntil(message.isVisible, timeout=PATIENCE)
    assert "notes.rtf" in message.text()
    assert "Traceback" not in message.text()
    assert lab_of(opened).view.isVisible()
    assert "invented.h5" in child(opened, QLabel, "sessionName").text()
    click(opened, "copyDetails")
    copied = QGuiApplication.clipboard().text()
    assert message.text() in copied
    assert "Traceback" in copied


def test_cancel_in_the_middle_of_a_refit_leaves_the_model_as_it_was(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    session_file: Path,
) -> None:
    held = Held()
    in_turn = iter((invented_diagnosis, held))
    opened = make_window(diagnose=lambda *given, **more: next(in_turn)(*given, **more))
    drop(opened, session_file)
    wait_for_result(qtbot, opened)
    click(opened, "addToModel")
    qtbot.waitUntil(held.running.is_set, timeout=PATIENCE)
    assert not child(opened, QPushButton, "addToModel").isEnabled()
    click(opened, "cancel")
    qtbot.waitUntil(lambda: not opened.tasks.busy, timeout=PATIENCE)
    assert held.was_cancelled.is_set()
    assert lab_of(opened).view.path.table.cell("joint_torque", "now") == "4.81"
    assert not lab_of(opened).controller.history.can_undo
    assert child(opened, QPushButton, "addToModel").isEnabled()
    assert child(opened, QLabel, "status").text().endswith("stopped")


def test_cancel_before_the_first_result_offers_to_compare_again(
    qtbot: QtBot,
    make_window,
    session_file: Path,  # type: ignore[no-untyped-def]
) -> None:
    held = Held()
    window = make_window(diagnose=held)
    drop(window, session_file)
    qtbot.waitUntil(held.running.is_set, timeout=PATIENCE)
    QTest.keyClick(window, Qt.Key.Key_Period, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: not window.tasks.busy, timeout=PATIENCE)
    held.go_on.set()
    click(window, "compareAgain")
    wait_for_result(qtbot, window)
    assert lab_of(window).view.isVisible()


def test_opening_another_session_while_one_is_compared_takes_its_place(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    session_file: Path,
    make_session: Callable[..., Path],
) -> None:
    held = Held()
    in_turn = iter((held, invented_diagnosis))
    window = make_window(diagnose=lambda *given, **more: next(in_turn)(*given, **more))
    drop(window, session_file)
    qtbot.waitUntil(held.running.is_set, timeout=PATIENCE)
    drop(window, make_session("another.h5"))
    qtbot.waitUntil(lambda: "another.h5" in window.windowTitle(), timeout=PATIENCE)
    wait_for_result(qtbot, window)
    assert held.was_cancelled.is_set()
    assert lab_of(window).controller.history.now.diagnosis.sessions[0].endswith("another.h5")


def test_closing_while_work_runs_leaves_no_thread(qtbot: QtBot, make_window, session_file: Path) -> None:  # type: ignore[no-untyped-def]
    held = Held()
    window = make_window(diagnose=held)
    before = threading.active_count()
    drop(window, session_file)
    qtbot.waitUntil(held.running.is_set, timeout=PATIENCE)
    window.close()
    assert held.was_cancelled.is_set()
    assert not window.tasks.busy
    assert not window.isVisible()
    assert threading.active_count() <= before


def test_a_mistake_of_ours_is_told_in_one_sentence(qtbot: QtBot, make_window, session_file: Path) -> None:  # type: ignore[no-untyped-def]
    def broken(*_: object) -> Diagnosis:
        raise ZeroDivisionError("division by zero")

    window = make_window(diagnose=broken)
    drop(window, session_file)
    message = child(window, QLabel, "message")
    qtbot.waitUntil(message.isVisible, timeout=PATIENCE)
    assert "ZeroDivisionError" in message.text()
    assert message.text().count("\n") == 0
    assert child(window, QPushButton, "compareAgain").isVisible()


def test_recent_files_are_offered_at_the_next_start(opened: MainWindow, make_window, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    opened.close()
    again = make_window(diagnose=invented_diagnosis)
    buttons = [b for b in lab_of(again).empty.findChildren(QPushButton) if b.text() == "invented.h5"]
    QTest.mouseClick(buttons[0], LEFT)
    wait_for_result(qtbot, again)
    assert lab_of(again).view.isVisible()


@pytest.mark.qt_log_ignore("This plugin does not support")  # dialogs, on a screen that is none
def test_every_plot_is_saved_in_every_format(opened: MainWindow, tmp_path: Path) -> None:
    save_each_plot(opened, tmp_path / "missing", 3)  # curves, fingerprint, error path
    QTest.keyClick(opened, Qt.Key.Key_F3)
    save_each_plot(opened, tmp_path / "where", 3)
    (mean, *_, curve) = lab_of(opened).view.evidence.plot.shown_series()
    assert mean.across == "MCP speed (°/s)"
    assert curve.y[-1] == pytest.approx(1e3 * invented.FRICTION)
    (tried, suggested) = lab_of(opened).view.path.path.shown_series()
    assert (tried.y.tolist(), suggested.x.tolist()) == ([12.4], [1.0])


def test_every_step_of_the_lab_is_whole(opened: MainWindow, make_window, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    look(make_window(diagnose=invented_diagnosis))
    for key in (Qt.Key.Key_F2, Qt.Key.Key_F3, Qt.Key.Key_F4, Qt.Key.Key_F5, Qt.Key.Key_F6):
        QTest.keyClick(opened, key)
        look(opened)
    click(opened, "addToModel")
    qtbot.waitUntil(lambda: lab_of(opened).can_undo and not opened.tasks.busy, timeout=PATIENCE)
    opened.context.tell(
        "A sentence that is as long as an error is when it names a file, a place and what to do.", "x"
    )
    look(opened)


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_the_sheet_of_keys_has_those_of_every_tab(opened: MainWindow) -> None:
    QTest.keyClick(opened, Qt.Key.Key_F1)
    lines = child(opened, QTextBrowser, "keySheet").toPlainText().splitlines()
    words = {line.replace("\xa0", "").strip() for line in lines}
    # Of the tab in front, of Acquire, Calibrate, Sessions, Fit and Predict.
    for expected in (
        "Where?",
        "Initialise",
        "Accept",
        "Read again",
        "Analyse the runs on air",
        "Wanted force",
    ):
        assert expected in words, expected
    assert {"F3", "Ctrl+I", "F5", "Alt+2", "Esc"} <= words
    assert opened.current == "model_lab"


def test_dark_and_light_recolour_what_is_drawn(opened: MainWindow, qapp: QApplication) -> None:
    plot = lab_of(opened).view.plot
    chosen_in_menu(opened, "Dark").trigger()
    assert plot.measured.opts["pen"].color().name() == "#ececec"
    assert plot.backgroundBrush().color().name() == "#141517"
    chosen_in_menu(opened, "Light").trigger()
    assert plot.measured.opts["pen"].color().name() == "#1b1b1b"
    assert plot.modelled.opts["pen"].color().name() == "#0072b2"
    assert plot.modelled.opts["pen"].style() == Qt.PenStyle.DashLine

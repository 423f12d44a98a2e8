"""Looking closer by real wheels, drags and clicks: axes, a box, cursors, the residual's own axis, a run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.residual_profiles import FINER
from fingerlab.diagnosis.answer.results import Diagnosis, HeldOutRuns
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.comparison_plot import ComparisonPlot
from fingerlab.ui.lab.validation import HeldOutTable

from .. import invented
from ..hands import LEFT, PATIENCE, child, click, lab_of, wait_for_result

NONE, SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier


def place(plot: ComparisonPlot, part: Any, time: float, value: float) -> QPoint:
    """Where a point of a plot is on its widget."""
    return plot.mapFromScene(part.getViewBox().mapViewToScene(QPointF(time, value)))


def wheel(plot: ComparisonPlot, where: QPoint) -> None:
    window = plot.window()
    QTest.wheelEvent(window.windowHandle(), plot.viewport().mapTo(window, where), QPoint(0, 240))
    QApplication.processEvents()


def drag(plot: ComparisonPlot, start: QPoint, stop: QPoint, keys: Qt.KeyboardModifier = NONE) -> None:
    steps = [start + (stop - start) * k / 6 for k in range(7)]

    def send(kind: QEvent.Type, at: QPoint, buttons: Qt.MouseButton) -> None:
        glob = QPointF(plot.viewport().mapToGlobal(at))
        pressed = LEFT if kind != QEvent.Type.MouseMove else Qt.MouseButton.NoButton
        QApplication.sendEvent(plot.viewport(), QMouseEvent(kind, QPointF(at), glob, pressed, buttons, keys))

    send(QEvent.Type.MouseMove, start, Qt.MouseButton.NoButton)
    send(QEvent.Type.MouseButtonPress, start, LEFT)
    for at in steps[1:]:
        QTest.qWait(30)  # pyqtgraph takes moves that follow too soon for one
        send(QEvent.Type.MouseMove, at, LEFT)
    send(QEvent.Type.MouseButtonRelease, stop, Qt.MouseButton.NoButton)


def test_wheel_box_and_double_click(opened: MainWindow) -> None:
    plot = lab_of(opened).view.plot
    (left, right), (low, high) = plot.top.viewRange()
    lab_of(opened).view.candidates.view.setFocus()
    wheel(plot, place(plot, plot.top, 6.0, 0.0))
    assert plot.hasFocus()  # so that the keys that follow are meant for it
    across, up = plot.top.viewRange()
    assert across[1] - across[0] < 0.9 * (right - left)
    assert up == pytest.approx([low, high])
    numbers = place(plot, plot.top, across[0], 0.5 * (low + high)) - QPoint(20, 0)
    wheel(plot, numbers)
    again, higher = plot.top.viewRange()
    assert again == pytest.approx(across)
    assert higher[1] - higher[0] < 0.9 * (high - low)
    QTest.mouseDClick(plot.viewport(), LEFT, pos=place(plot, plot.top, 6.0, 0.0))
    assert plot.top.viewRange()[0] == pytest.approx([left, right])
    corner, other = place(plot, plot.bottom, 4.0, -3.0), place(plot, plot.bottom, 5.0, 3.0)
    drag(plot, corner, other, SHIFT)
    box_x, box_y = plot.bottom.viewRange()
    np.testing.assert_allclose(box_x, (4.0, 5.0), atol=0.05)
    np.testing.assert_allclose(box_y, (-3.0, 3.0), atol=0.2)
    drag(plot, place(plot, plot.bottom, 4.5, 0.0), place(plot, plot.bottom, 4.25, 0.0))
    np.testing.assert_allclose(plot.bottom.viewRange()[0], (4.25, 5.25), atol=0.06)


def test_two_cursors_read_what_lies_between(opened: MainWindow) -> None:
    plot = lab_of(opened).view.plot
    plot.setFocus()
    QTest.keyClick(plot, Qt.Key.Key_C)
    assert plot.pair.times is not None
    first = plot.pair.times[0]
    drag(plot, place(plot, plot.bottom, first, 0.0), place(plot, plot.bottom, 5.0, 0.0))
    second = plot.pair.times[1]
    drag(plot, place(plot, plot.bottom, second, 0.0), place(plot, plot.bottom, 5.5, 0.0))
    assert plot.pair.times == pytest.approx((5.0, 5.5), abs=0.02)
    a, b = plot.pair.times
    said = child(opened, QLabel, "valuesRead").text()
    # Friction turns round once in half a second of 1 Hz; the spring comes from zero to zero.
    assert f"B − A: {b - a:.3f} s ({1 / (b - a):.3g} Hz)" in said
    change = float(said.split("residual ")[1].split(" ")[0].replace("−", "-"))
    assert change == pytest.approx(-2e3 * invented.FRICTION, abs=6e3 * invented.NOISE)
    QTest.keyClick(plot, Qt.Key.Key_C)
    assert child(opened, QLabel, "valuesRead").text() == ""


def test_a_readout_does_not_outlive_its_curve_and_is_whole(opened: MainWindow) -> None:
    view = lab_of(opened).view
    for width in (1280, 960):
        opened.resize(width, 760)
        QApplication.processEvents()
        view.bar.go_to("cable_kinematics", "001")
        place_now = place(view.plot, view.plot.top, 6.0, 0.0)
        QTest.mouseMove(view.plot.viewport(), place_now + QPoint(5, 5))
        QTest.mouseMove(view.plot.viewport(), place_now)
        view.plot.scene().sigMouseMoved.emit(view.plot.mapToScene(place_now))
        read = view.legend.values
        QApplication.processEvents()
        assert "mm" in read.text()
        assert read.seen in read.wordings  # none of them cut
        view.bar.go_to("pip_torque", "002")
        assert read.text() == ""


def test_the_residuals_axis_follows_what_is_left(qtbot: QtBot, opened: MainWindow) -> None:
    plot = lab_of(opened).view.plot
    across = plot.top.viewRange()[0]
    before = plot.bottom.viewRange()[1][1]
    click(opened, "addToModel")
    qtbot.waitUntil(lambda: lab_of(opened).can_undo, timeout=PATIENCE)
    # 4.8 mN m of friction are gone; noise of 0.3 and a floor of 0.4 mN m are left.
    _, residual = plot.residual.series
    after = plot.bottom.viewRange()[1][1]
    assert after < 0.4 * before
    assert np.nanmax(np.abs(residual)) > 0.5 * after
    assert plot.top.viewRange()[0] == pytest.approx(across)


def test_a_click_on_a_held_out_run_shows_it(qtbot: QtBot, make_window: Any, session_file: Any) -> None:
    def diagnose(sessions: Any, *_: Any) -> Diagnosis:
        found = invented.friction_diagnosis(str(sessions[0].path))
        runs = tuple(
            HeldOutRuns((f"00{k}",), "on_air", "extension", {"kind": "sine"}, 1.1) for k in (1, 2, 3)
        )
        return replace(found, held_out=runs)

    window: MainWindow = make_window(diagnose=diagnose)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    view = lab_of(window).view
    view.go_to("true")
    QApplication.processEvents()
    table = child(window, HeldOutTable, "heldOutRuns")
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(2, 0)).center())
    shown = view.bar.comparison()
    assert shown is not None
    assert shown.run == "003"


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_loops_and_spectra_stand_beside_where(opened: MainWindow) -> None:
    view = lab_of(opened).view
    view.go_to("where")
    choice = child(opened, QComboBox, "whereCoordinate")
    choice.setFocus()
    QTest.keyClick(choice, Qt.Key.Key_End)
    assert choice.currentText() == "Spectrum of this run"
    shape = view.where.shape
    assert shape.isVisible()
    # The friction of a motion at 1 Hz: its line is the strongest below 8 Hz.
    assert shape.shape is not None
    frequency, density = shape.shape.curves["residual"]
    assert frequency[np.argmax(density)] == pytest.approx(invented.FREQUENCY, abs=0.1)
    QTest.keyClick(choice, Qt.Key.Key_Up)
    assert shape.shape.title == "Autocorrelation of the residual"
    for _ in range(2):
        QTest.keyClick(choice, Qt.Key.Key_Up)
    assert shape.shape.title == "Loop over the angle"
    view.bar.go_to("pip_torque", "003")  # what is chosen stays with another run and equation
    assert choice.currentText() == "Loop over the angle of this run"
    comparison = view.bar.comparison()
    place, measured = shape.shape.curves["measured"]
    assert np.array_equal(measured[::FINER], comparison.measured, equal_nan=True)
    # Between the samples it is a curve, in steps that are a share of theirs, and not a straight line.
    angle = comparison.coordinates["joint angle pip"]
    assert np.array_equal(place[::FINER], angle, equal_nan=True)
    assert np.nanmax(np.abs(np.diff(place))) < 0.3 * np.nanmax(np.abs(np.diff(angle)))
    assert view.where.shape.getPlotItem().getAxis("left").labelText.startswith("PIP torque")
    opened.plots.ask_and_save(view.plot)
    assert opened.plots.dialog is not None
    assert opened.plots.dialog.title.text() == (
        "PIP torque, run 003 – invented.h5, recorded 2026-11-01; the nominal model"
    )
    opened.plots.dialog.reject()
    QTest.keyClick(choice, Qt.Key.Key_Home)
    assert view.where.plot.isVisible()

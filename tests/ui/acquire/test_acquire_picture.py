"""The live plots: held and scrolled back, cursors, trigger, scale, the model beside them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QWidget

from ..bench_hands import Rig
from ..hands import LEFT, child

CONTROL = Qt.KeyboardModifier.ControlModifier


def send_drag(widget: QWidget, place: QPoint) -> None:
    """Move the mouse with its button down; QTest only moves it with the button up."""
    where = QPointF(place)
    everywhere = QPointF(widget.mapToGlobal(place))
    move = QEvent.Type.MouseMove
    event = QMouseEvent(move, where, everywhere, LEFT, LEFT, Qt.KeyboardModifier.NoModifier)
    QApplication.sendEvent(widget, event)


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
    assert plots.shown[1] == rig.controller.history.stop


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
    assert f"B − A: +{b - a:.3f} s ({1 / (b - a):.2f} Hz)" in rig.label("cursorTimes")
    text = rig.label("cursorText")
    history = rig.controller.history
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
    history = rig.controller.history
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
    history = rig.controller.history
    _, measured = history.series("motor_torque", history.stop - 3000, history.stop - 100)
    _, residual = history.series("torque_residual", history.stop - 3000, history.stop - 100)
    assert np.isfinite(residual).all()
    # The practice bench's noise is 3 to 4 mN m; the torque itself swings by more than 20.
    assert residual.std() < 0.35 * measured.std()
    assert float(error.split()[1]) == pytest.approx(1e3 * np.sqrt(np.mean(residual**2)), rel=0.2)


def test_a_marker_s_note_stands_above_the_curves(rig: Rig) -> None:
    canvas = rig.tab.plots.panes["displacement"].canvas
    before = canvas.area
    rig.start()
    rig.click("record")
    rig.run(1.0)
    rig.tab.panel.note.setText("a light touch")
    rig.click("mark")
    rig.run(2.0)
    QApplication.processEvents()
    line = canvas.fontMetrics().height()
    assert canvas.area.top() - before.top() >= line - 4  # a line of its own
    image = canvas.grab().toImage()
    written = {
        image.pixelColor(x, y).name()
        for x in range(canvas.area.left(), canvas.area.right())
        for y in range(before.top(), canvas.area.top())
    }
    assert len(written) > 1
    untouched = rig.tab.plots.panes["torque"].canvas
    assert untouched.area.top() == before.top()

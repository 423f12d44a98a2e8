"""Where does it fail? Asked in the window by keys and clicks, on a residual of a known form.

Coulomb friction c sign(speed): its mean is c or -c in every bin of the speed, in every coordinate its root
mean square is c.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.residual_profiles import RESIDUAL_FIGURES
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.lab_view import LabView

from .. import invented
from ..hands import LEFT, PATIENCE, child, click, lab_of

FRICTION = 1e3 * invented.FRICTION  # mN m, as on the screen


@pytest.fixture
def asking(opened: MainWindow) -> LabView:
    """The second question, by its key."""
    QTest.keyClick(opened, Qt.Key.Key_F3)
    view = lab_of(opened).view
    assert view.where.isVisible()
    return view


def choose(view: LabView, coordinate: str) -> None:
    """Another coordinate, by the keyboard."""
    box = child(view, QComboBox, "whereCoordinate")
    box.setFocus()
    while box.currentData() != coordinate:
        before = box.currentIndex()
        QTest.keyClick(box, Qt.Key.Key_Home if before == box.count() - 1 else Qt.Key.Key_Down)
        assert box.currentIndex() != before


def test_it_opens_with_what_the_residual_follows_most(asking: LabView) -> None:
    found = asking.where.found
    assert found is not None
    assert found.coordinate.id in ("speed", "motor_speed", "phase")  # friction follows all three alike
    names = {asking.where.coordinate.itemData(row) for row in range(asking.where.coordinate.count())}
    names -= {None, *RESIDUAL_FIGURES}  # a line between, and pictures of the run shown
    assert names == {"phase", "speed", "angle", "tension", "motor_angle", "motor_speed", "time", "run"}


def test_against_speed_friction_is_a_step(asking: LabView) -> None:
    choose(asking, "speed")
    found = asking.where.found
    assert found is not None
    fast = np.abs(found.centres) > 0.2
    assert 1e3 * found.mean[fast] == pytest.approx(FRICTION * np.sign(found.centres[fast]), rel=0.05)
    assert "MCP joint speed" in asking.where.coordinate.currentText()
    words = child(asking, QLabel, "whereWords").text()
    assert words.startswith("Worst at MCP joint speed")
    assert words.endswith("°/s: 4.82 mN m, 12.1 floors.") or "12." in words


def test_a_click_on_a_bar_tints_its_moments_in_the_curves(asking: LabView) -> None:
    choose(asking, "angle")
    plot, found = asking.where.plot, asking.where.found
    assert found is not None
    middle = len(found.mean) // 2  # the joint is at angle 0 twice in each stroke of 1 s
    place = plot.mapFromScene(plot.getPlotItem().getViewBox().mapViewToScene(QPointF(0.0, FRICTION / 2)))
    QTest.mouseClick(plot.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, place)
    assert plot.bin == middle
    tinted = asking.plot.places[0].stretches
    for start, end in tinted:
        assert invented.AMPLITUDE * np.sin(np.pi * (start + end)) == pytest.approx(0.0, abs=0.01)
    seconds = invented.DURATION - 0.3 - invented.START_UP
    assert len(tinted) == pytest.approx(2 * seconds, abs=1)
    assert not any(stretch.isVisible() for stretch in asking.plot.stretches)
    assert child(asking, QLabel, "stretchName").text() == "MCP joint angle −1.1 to 1.1°"
    assert "Chosen: MCP joint angle −1.1 to 1.1°" in child(asking, QLabel, "whereWords").text()
    QTest.keyClick(plot, Qt.Key.Key_Right)
    assert plot.bin == middle + 1
    assert asking.plot.places[0].stretches != tinted


def test_bins_in_which_nothing_was_recorded_stay_empty(asking: LabView) -> None:
    """Two postures with nothing between them, as runs on air and in contact have."""
    comparisons = lab_of(asking.window()).controller.diagnosis.comparisons  # type: ignore[arg-type]
    moved = [
        replace(
            one, coordinates={**one.coordinates, "joint angle mcp": one.coordinates["joint angle mcp"] + by}
        )
        for one in comparisons
        for by in ((3.0,) if one.run == "003" else (0.0,))
    ]
    asking.where.show_equation(moved, "mcp_torque")
    choose(asking, "angle")
    found = asking.where.found
    assert found is not None
    assert np.isnan(found.rms).any()
    known = np.flatnonzero(np.isfinite(found.rms))
    asking.where.plot.choose(int(known[0]))
    asking.where.plot.setFocus()
    for _ in known:
        QTest.keyClick(asking.where.plot, Qt.Key.Key_Right)
    assert asking.where.plot.bin == known[-1]  # over the gap


def test_a_run_that_is_chosen_is_shown(asking: LabView) -> None:
    choose(asking, "run")
    plot = asking.where.plot
    plot.setFocus()
    for _ in range(3):
        QTest.keyClick(plot, Qt.Key.Key_Left)
    assert plot.bin == 0
    assert asking.bar.comparison().run == "001"
    QTest.keyClick(plot, Qt.Key.Key_Right)
    assert asking.bar.comparison().run == "002"


def test_once_the_effect_is_in_the_model_nothing_stands_out(opened: MainWindow, qtbot: QtBot) -> None:
    view = lab_of(opened).view
    click(opened, "addToModel")
    qtbot.waitUntil(lambda: view.controller.history.can_undo and not opened.tasks.busy, timeout=PATIENCE)
    QTest.keyClick(opened, Qt.Key.Key_F3)
    choose(view, "speed")
    assert child(view, QLabel, "whereWords").text() == "Nowhere clearly beyond the floor."
    # The force misses by a tenth of 50 /m times the spring's torque: so much the more, the larger the angle.
    click(view, "equation_endpoint_force_pip")
    assert child(view, QLabel, "whereWords").text().startswith("Worst at PIP joint angle")
    largest = 0.1 * 50 * invented.STIFFNESS * invented.AMPLITUDE  # N
    assert view.where.found.rms.max() == pytest.approx(largest, rel=0.06)

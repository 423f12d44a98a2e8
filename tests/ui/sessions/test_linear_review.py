"""A log of a linear axis in the Sessions tab: 10 mm of stroke and 15 N of friction are shown as just that."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.sessions import open_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.sessions.result_dialogs import PairsDialog
from fingerlab.ui.sessions.review_page import ReviewPage
from fingerlab.ui.sessions.sessions_tab import SessionsTab
from tests.stage import FRICTION, LOAD, STROKE, stage_session

from ..hands import LEFT, PATIENCE, child, click, invented_diagnosis, review_of

ANGULAR = re.compile(r"N m\b|°|\brad\b|[Tt]orque|[Mm]otor (?:angle|position|command)|θ|τ")
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def settle(qtbot: QtBot, page: ReviewPage) -> None:
    qtbot.wait(60)
    qtbot.waitUntil(lambda: not page.data.busy, timeout=PATIENCE)
    qtbot.wait(30)


def shown_by(page: ReviewPage, name: str, number: int = 0) -> np.ndarray:
    pane = next(pane for pane in page.plots.panes if name in pane.spec.channels)
    return np.asarray(pane.curves[number, name].series[1])


def labels(page: ReviewPage) -> list[str]:
    """At the left of the plots that are seen."""
    return [p.plot.getAxis("left").labelText for p in page.plots.panes if p.plot.isVisible()]


def browse(qtbot: QtBot, window: MainWindow, folder: Path, sessions: int) -> SessionsTab:
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(folder)
    qtbot.waitUntil(lambda: tab.page.model.total == sessions, timeout=PATIENCE)
    return tab


@pytest.fixture
def reviewing(qtbot: QtBot, make_window, settings, tmp_path: Path) -> tuple[MainWindow, ReviewPage]:  # type: ignore[no-untyped-def]
    folder = tmp_path / "stage"
    folder.mkdir()
    stage_session(folder)
    settings.set_library(folder)
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    page = review_of(qtbot, window)
    settle(qtbot, page)
    return window, page


def test_curves_axes_and_lists_are_in_millimetres_and_newtons(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    window, page = reviewing
    assert labels(page) == ["Position (mm)", "Force (N)"]
    for name in ("motor_position", "motor_command"):
        assert np.abs(shown_by(page, name)).max() == pytest.approx(STROKE, abs=1e-3)
    assert np.median(np.abs(shown_by(page, "motor_torque"))) == pytest.approx(FRICTION, abs=0.1)
    assert shown_by(page, "load_torque") == pytest.approx(LOAD, abs=1e-3)
    legends = [pane.legend.toPlainText().split() for pane in page.plots.panes if pane.plot.isVisible()]
    assert legends == [["command", "position"], ["force", "load"]]
    runs = child(window, QComboBox, "reviewRun")
    assert runs.itemText(0) == "Run 001 · motor bench, sine, 10 mm, 0.5 Hz"
    assert page.over.itemText(2) == "Over it: Run 002 · motor bench, sine, 10 mm, 1 Hz"
    assert page.plots.toolTip().split("\n") == [
        "command: x_cmd (mm)", "position: x (mm)", "force: F (N)", "load: F_L (N)",
    ]  # fmt: skip
    # All of the height is the two plots'.
    bottom = max(pane.plot.geometry().bottom() for pane in page.plots.panes if pane.plot.isVisible())
    assert page.plots.height() - bottom < 20
    # Which plots are seen is asked in the same words.
    boxes = [box for box in page.arrange.boxes.values() if not box.isHidden()]
    assert [box.text() for box in boxes] == ["Position", "Force"]
    boxes[0].click()
    assert labels(page) == ["Force (N)"]


def test_cursors_and_strokes_tell_millimetres(reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot) -> None:
    window, page = reviewing
    click(window, "reviewCursors")
    page.plots.move_cursor(0, 0.5)  # of 0.5 Hz: from one end to the other
    page.plots.move_cursor(1, 1.5)
    said = child(window, QLabel, "reviewValues")
    qtbot.waitUntil(lambda: "+1.000 s" in said.toolTip() + said.text(), timeout=PATIENCE)
    assert "position −20.000 mm, force" in said.text()
    assert "position: A 10.000 mm, B −10.000 mm" in said.toolTip()
    assert "load: A 5.000 N, B 5.000 N" in said.toolTip()
    assert not ANGULAR.search(said.text() + said.toolTip())
    click(window, "strokes")
    qtbot.waitUntil(lambda: page.plots.cycles is not None, timeout=PATIENCE)
    _, y = page.plots.panes[0].strokes[0, "motor_position"].getData()
    assert np.nanmax(y) == pytest.approx(STROKE, abs=1e-2)
    low, high = page.plots.panes[0].plot.viewRange()[1]
    assert -1.2 * STROKE < low < -STROKE
    assert STROKE < high < 1.2 * STROKE


def test_plots_of_ones_own_are_in_the_same_units(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    _, page = reviewing
    page.arrange.add.click()
    (own,) = page.free.plots
    qtbot.waitUntil(lambda: len(own.curve()[0]) > 0, timeout=PATIENCE)
    axes = [own.plot.getPlotItem().getAxis(side).labelText for side in ("left", "bottom")]
    assert axes == ["Force (N)", "Position (mm)"]
    x, y = own.curve()
    assert np.abs(x).max() == pytest.approx(STROKE, rel=0.01)
    assert np.median(np.abs(y)) == pytest.approx(FRICTION, abs=0.2)
    assert own.up.currentText() == "force"


def test_a_run_kept_as_another_arc_lies_over_in_millimetres_and_a_finger_does_not(
    qtbot: QtBot, make_window, make_session: Callable[..., Path], tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path / "three"
    folder.mkdir()
    stage_session(folder, "a")
    wide = stage_session(folder, "b", radius=0.05)
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    tab = browse(qtbot, window, folder, 2)
    tab.page.choose_path(folder / "a.h5")
    click(window, "review")
    page = tab.review_page
    qtbot.waitUntil(lambda: page.session is not None and not page.data.busy, timeout=PATIENCE)
    page.data.open_beside(wide, open_session)
    qtbot.waitUntil(lambda: len(page.plots.layers) == 2, timeout=PATIENCE)
    settle(qtbot, page)
    assert np.abs(shown_by(page, "motor_position", 1)).max() == pytest.approx(STROKE, abs=1e-3)
    assert np.median(np.abs(shown_by(page, "motor_torque", 1))) == pytest.approx(FRICTION, abs=0.1)
    finger = make_session("finger.h5")
    page.data.open_beside(finger, open_session)
    said = lambda: [line for line in window.context.log if "finger.h5 is of another kind" in line]  # noqa: E731
    qtbot.waitUntil(lambda: bool(said()), timeout=PATIENCE)
    assert "an angle cannot be laid over a length" in said()[0]
    assert len(page.plots.layers) == 2
    # The finger by itself is shown as ever, after the stage.
    page.show_session(open_session(finger))
    settle(qtbot, page)
    assert labels(page)[:2] == ["Motor (°)", "Torque (mN m)"]
    assert [box.text() for box in page.arrange.boxes.values()] == ["Motor", "Torque", "Joints", "Force"]
    assert "motor torque: τ" in page.plots.toolTip()


def test_two_days_are_compared_in_newtons(qtbot: QtBot, make_window, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path / "days"
    folder.mkdir()
    stage_session(folder, "monday")
    stage_session(folder, "tuesday", more=2.0)
    window = make_window(tab="sessions")
    tab = browse(qtbot, window, folder, 2)
    assert [tab.page.model.facts(folder / f"{day}.h5").rig for day in ("monday", "tuesday")] == [
        "axis, linear"
    ] * 2
    tab.page.table.setFocus()
    QTest.keyClick(tab.page.table, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    click(window, "compareRuns")
    qtbot.waitUntil(lambda: any(d.isVisible() for d in window.findChildren(PairsDialog)), timeout=PATIENCE)
    dialog = window.findChild(PairsDialog)
    table = child(dialog, QTableWidget, "pairTable")
    headers = [table.horizontalHeaderItem(column).text() for column in range(table.columnCount())]
    assert headers == ["Runs", "Motion", "Position (mm)", "Force (N)", "Load (N)"]
    assert table.item(0, 1).text() == "motor bench, sine, 10 mm, 0.5 Hz"
    assert float(table.item(0, 3).text().split()[0]) == pytest.approx(2.0, abs=0.05)
    assert "Force, second less first, N: " in table.item(0, 3).toolTip()
    assert "Force differs most" in child(dialog, QLabel, "pairWords").text()
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(0, 3)).center())
    first, _ = dialog.curves.shown_series()
    assert first.up == "Force (N)"
    assert np.abs(first.y).max() == pytest.approx(FRICTION, abs=0.3)
    (difference,) = dialog.difference.shown_series()
    assert np.median(difference.y) == pytest.approx(2.0, abs=0.1)

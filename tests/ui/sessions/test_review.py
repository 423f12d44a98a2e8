"""Reviewing a run as a person does: open it, zoom, put cursors, lay another run and the strokes over it."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.library.reviewing import BASE
from fingerlab.sessions import open_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.sessions.review_page import ReviewPage
from fingerlab.ui.sessions.review_pane import clock_text
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from ..hands import PATIENCE, child, click, invented_diagnosis, lab_of, review_of

SAMPLES = 40_000


def long_session(file: h5py.File) -> None:
    """A spike of one sample, a marker, and a start by the clock."""
    run = file["runs/002"]
    run["motor_torque"][12_345] = 9.0
    run.attrs["started"] = "2026-11-01T09:00:30+01:00"
    run.attrs["markers"] = json.dumps([{"time": 5.0, "note": "light touch"}])


@pytest.fixture
def reviewing(
    qtbot: QtBot, make_window, make_session: Callable[..., Path], settings
) -> tuple[MainWindow, ReviewPage]:  # type: ignore[no-untyped-def]
    path = make_session("long.h5", long_session, samples=SAMPLES)
    settings.set_library(path.parent)
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    page = review_of(qtbot, window)
    QTest.keyClick(window, Qt.Key.Key_Down, Qt.KeyboardModifier.AltModifier)
    settle(qtbot, page)
    return window, page


def settle(qtbot: QtBot, page: ReviewPage) -> None:
    qtbot.wait(60)
    qtbot.waitUntil(lambda: not page.data.busy, timeout=PATIENCE)
    qtbot.wait(30)


def drawn(page: ReviewPage, name: str, number: int = 0):  # type: ignore[no-untyped-def]
    pane = next(pane for pane in page.plots.panes if name in pane.spec.channels)
    return pane.curves[number, name].series


def test_the_whole_run_is_drawn_from_its_extremes_and_the_spike_is_there(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    window, page = reviewing
    assert page.run is not None
    assert page.run.name == "002"
    x, y = drawn(page, "motor_torque")
    assert y.max() == pytest.approx(9000.0)  # N m in the file, mN m on the screen
    assert x[int(np.argmax(y))] == pytest.approx(12.345, abs=BASE / 1000.0)
    assert page.plots.span == (0.0, pytest.approx(39.999))
    assert window.windowTitle().startswith("long.h5")
    notes = [item.label.toPlainText() for item in page.plots.panes[0].markers]
    assert notes == ["light touch"]


def test_zooming_in_by_keys_shows_every_sample_on_one_time_axis(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    _, page = reviewing
    page.plots.setFocus()
    for _ in range(10):
        QTest.keyClick(page.plots, Qt.Key.Key_Plus)
    settle(qtbot, page)
    left, right = page.plots.top.viewRange()[0]
    assert right - left == pytest.approx(39.999 / 1.5**10, rel=1e-6)
    for pane in page.plots.panes:
        assert pane.plot.viewRange()[0] == pytest.approx([left, right])
    x, y = drawn(page, "motor_position")
    inside = (x >= left) & (x <= right)
    assert np.diff(x[inside]) == pytest.approx(0.001, abs=1e-9)
    # 22 degrees plus 14.9 degrees times a sine of 1 Hz, from conftest.
    assert y[inside] == pytest.approx(22 + 14.9 * np.sin(2 * np.pi * x[inside]), abs=1e-3)


def test_cursors_tell_the_difference_of_the_samples_themselves(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    window, page = reviewing
    click(window, "reviewCursors")
    page.plots.move_cursor(0, 10.0)
    page.plots.move_cursor(1, 12.345)
    said = child(window, QLabel, "reviewValues")
    qtbot.waitUntil(lambda: "+2.345 s" in said.text(), timeout=PATIENCE)
    # The torque at 10 s is kt N 0.3 A = 38.958 mN m, at the spike 9 N m.
    assert "motor torque +8961.04 mN m" in said.text()
    assert "A 10.000 s (09:00:40.000), B 12.345 s (09:00:42.345)" in said.toolTip()


def test_another_run_and_the_strokes_over_one_another(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    window, page = reviewing
    page.over.setCurrentIndex(1)
    settle(qtbot, page)
    _, other = drawn(page, "motor_torque", 1)
    assert np.nanmax(other) == pytest.approx(64.93, abs=0.01)
    assert drawn(page, "motor_torque")[1].max() == pytest.approx(9000.0)
    click(window, "strokes")
    qtbot.waitUntil(lambda: page.plots.cycles is not None, timeout=PATIENCE)
    assert "39 strokes of 1 s" in child(window, QLabel, "reviewState").text()
    assert page.plots.top.viewRange()[0] == pytest.approx([0.0, 1.0])
    click(window, "strokes")
    assert page.plots.top.viewRange()[0] == pytest.approx([0.0, 39.999])


def test_back_to_the_table_and_on_to_the_model_lab(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot
) -> None:
    window, page = reviewing
    QTest.keyClick(window, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: window.current == "model_lab" and not window.tasks.busy, timeout=PATIENCE)
    assert [s.path.name for s in lab_of(window).controller.sessions] == ["long.h5"]
    window.show_tab("sessions")
    click(window, "reviewBack")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    assert tab.pages.currentWidget() is tab.page
    assert page.session is None


def test_clock_time_has_the_decimals_of_its_ticks() -> None:
    began = datetime.fromisoformat("2026-11-01T23:59:59+01:00")
    assert clock_text(began, 1.5, 1.0) == "00:00:01"
    assert clock_text(began, 1.5, 0.1) == "00:00:00.5"
    assert clock_text(began, 0.125, 0.005) == "23:59:59.125"


def test_cut_between_the_cursors_and_find_the_new_session_in_the_table(
    reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    window, page = reviewing
    assert not page.cut.isEnabled()
    click(window, "reviewCursors")
    page.plots.move_cursor(0, 12.0)  # the cursors may stand in any order
    page.plots.move_cursor(1, 4.5)
    target = tmp_path / "cut.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    click(window, "cut")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    qtbot.waitUntil(lambda: tab.page.paths() == [target], timeout=PATIENCE)
    [run] = open_session(target).runs
    assert run.channel("time")[[0, -1]] == pytest.approx([0.0, 7.5])
    assert run.attributes["started"] == "2026-11-01T09:00:34.500000+01:00"
    # The same place again: refused with a sentence, and what is there stays.
    before = target.read_bytes()
    click(window, "cut")
    qtbot.waitUntil(lambda: "not overwritten" in window.context.log[-1], timeout=PATIENCE)
    assert target.read_bytes() == before


def test_a_run_of_another_session_over_this_one(
    reviewing: tuple[MainWindow, ReviewPage],
    qtbot: QtBot,
    make_session: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stronger(file: h5py.File) -> None:
        file["runs/001/motor_torque"][...] *= 3.0

    _, page = reviewing
    other = make_session("other.h5", stronger, samples=SAMPLES)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(other), "")))
    before = page.over.count()
    page.over.setCurrentIndex(before - 1)  # "A run of another session…"
    qtbot.waitUntil(lambda: page.over.count() > before, timeout=PATIENCE)
    settle(qtbot, page)
    assert page.over.currentText().startswith("Over it: other, Run 001")
    assert page.run is not None
    assert page.run.name == "002"  # the run under review stays
    _, over = drawn(page, "motor_torque", 1)
    # Largest torque of a run of conftest, 64.93 mN m, three times.
    assert np.nanmax(over) == pytest.approx(3 * 64.93, abs=0.03)
    page.over.setCurrentIndex(0)
    settle(qtbot, page)
    assert not len(drawn(page, "motor_torque", 1)[0])


def test_sessions_marked_together_are_reviewed_together(
    qtbot: QtBot, make_window, make_session: Callable[..., Path], settings
) -> None:  # type: ignore[no-untyped-def]
    first, second = (make_session(f"{name}.h5", samples=2000) for name in ("first", "second"))
    settings.set_library(first.parent)
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    qtbot.waitUntil(lambda: tab.page.model.total == 2, timeout=PATIENCE)
    tab.page.table.selectAll()
    click(window, "review")
    page = tab.review_page
    qtbot.waitUntil(lambda: page.session is not None and not page.data.busy, timeout=PATIENCE)
    assert page.session is not None
    offered = [page.over.itemText(row) for row in range(page.over.count())]
    other = second.stem if page.session.path == first else first.stem
    assert sum(text.startswith(f"Over it: {other}, Run") for text in offered) == 2
    assert len(offered) == 2 + 2 + 2  # nothing, their runs, and the way to a further session
    assert page.runs.count() == 2


def test_several_runs_lie_over_one_another_each_with_a_line_of_its_own(
    qtbot: QtBot, make_window, make_session: Callable[..., Path], settings
) -> None:  # type: ignore[no-untyped-def]
    def stronger(file: h5py.File) -> None:
        for number in range(1, 7):
            file[f"runs/{number:03d}/motor_torque"][...] *= number

    path = make_session("six.h5", stronger, phases=(("on_air", "extension"),) * 6, samples=3000)
    settings.set_library(path.parent)
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.review([path])
    qtbot.waitUntil(lambda: tab.review_page.session is not None and not tab.data.busy, timeout=PATIENCE)
    page = tab.review_page
    for row in (2, 3, 4, 5):
        page.over.setCurrentIndex(row)
    settle(qtbot, page)

    def largest() -> list[float]:
        found = [drawn(page, "motor_torque", number)[1] for number in range(5)]
        return [float(np.nanmax(y)) / 64.93 if len(y) else 0.0 for y in found]

    # Largest torque of a run of conftest: 64.93 mN m, times the number of the run.
    assert largest() == pytest.approx([1, 2, 3, 4, 5], rel=1e-3)
    pens = [page.plots.panes[1].curves[number, "motor_torque"].opts["pen"] for number in range(5)]
    assert len({pen.color().name() for pen in pens}) == len({pen.style() for pen in pens}) == 5
    legend = page.plots.panes[0].legend.toPlainText()
    assert all(f"Run {number:03d}" in legend for number in (2, 3, 4, 5))
    page.over.setCurrentIndex(6)
    assert "take one of them away" in window.context.log[-1]
    assert page.over.currentText().startswith("Over it: Run 005")
    click(window, "over-2")
    settle(qtbot, page)
    assert largest() == pytest.approx([1, 2, 0, 4, 5], rel=1e-3)  # the others keep their lines
    page.over.setCurrentIndex(6)
    settle(qtbot, page)
    assert largest() == pytest.approx([1, 2, 6, 4, 5], rel=1e-3)
    click(window, "strokes")
    state = child(window, QLabel, "reviewState")
    qtbot.waitUntil(lambda: state.text().endswith("with those of 4 other runs"), timeout=PATIENCE)
    x, y = page.plots.panes[1].strokes[2, "motor_torque"].getData()
    assert np.nanmax(y) == pytest.approx(6 * 64.93, rel=1e-3)
    assert 0.0 <= np.nanmin(x) <= np.nanmax(x) <= 1.0
    click(window, "strokes")
    page.over.setCurrentIndex(0)
    settle(qtbot, page)
    assert largest() == pytest.approx([1, 0, 0, 0, 0], rel=1e-3)
    assert not page.overlays.row.isVisible()


def test_no_more_is_drawn_than_can_be_seen(reviewing: tuple[MainWindow, ReviewPage], qtbot: QtBot) -> None:
    _, page = reviewing
    pixels = int(page.plots.top.getViewBox().width())
    for width in (39.0, 8.0, 0.5):
        page.plots.top.setXRange(10.0, 10.0 + min(width, 29.0), padding=0)
        settle(qtbot, page)
        for pane in page.plots.panes:
            for curve in pane.curves.values():
                x, _ = curve.getData()
                assert x is None or len(x) <= 2 * pixels
    # The grid stands at the numbers of the axes, and only the lowest plot has times.
    shown = [pane for pane in page.plots.panes if pane.plot.isVisible()]
    assert [pane.plot.getAxis("bottom").isVisible() for pane in shown] == [False] * (len(shown) - 1) + [True]
    last = shown[-1]
    times = [time for time, _ in last.plot.getAxis("bottom")._tickLevels[0]]
    assert times == pytest.approx([10.0 + 0.05 * k for k in range(11)])
    assert last.grid._columns == pytest.approx(times)
    assert all(cursor not in pane.plot.items for pane in shown for cursor in pane.cursors)

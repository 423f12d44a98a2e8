"""Plots of one's own in Acquire and in the review: chosen by clicks, live, kept over a restart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QCheckBox, QComboBox, QPushButton, QSplitter, QToolButton, QWidget
from pytestqt.qtbot import QtBot
from scipy.signal import welch

from fingerlab.signals.prepare import amplitude_density
from fingerlab.ui.app.context import Settings
from fingerlab.ui.sessions.review_page import ReviewPage
from fingerlab.ui.widgets.free_plots import FreePlots, PlotsButton

from ..bench_hands import Rig, opener, tabs_with
from ..hands import LEFT, PATIENCE, child, review_of, sideways
from ..looking import cut_off, look

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def button_of(page: QWidget) -> PlotsButton:
    found: PlotsButton = child(page, PlotsButton, "arrangePlots")
    return found


def add_plot(page: QWidget) -> None:
    """Open the form and press the button in it."""
    button = button_of(page)
    menu = button.menu()
    menu.popup(button.mapToGlobal(button.rect().bottomLeft()))
    QTest.mouseClick(button.add, LEFT)
    menu.close()


def tick(page: QWidget, name: str) -> None:
    """Click a box of the form."""
    button = button_of(page)
    menu = button.menu()
    menu.popup(button.mapToGlobal(button.rect().bottomLeft()))
    box: QCheckBox = button.boxes[name]
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_Space)
    menu.close()


def choose(page: QWidget, name: str, key: str) -> None:
    field: QComboBox = child(page, QComboBox, name)
    assert field.findData(key) >= 0, key
    field.setCurrentIndex(field.findData(key))
    field.activated.emit(field.currentIndex())


def test_a_line_and_noise_in_a_spectrum_have_the_amplitude_that_they_have() -> None:
    rate, seconds = 1000.0, 40.0
    time = np.arange(int(rate * seconds)) / rate
    noise = np.random.default_rng(3).normal(0.0, 0.5, len(time))
    found = amplitude_density(noise + 2.0 * np.sin(2 * np.pi * 7.0 * time), rate, 4.0)
    assert found is not None
    frequency, amplitude = found
    # White noise of deviation s has the one-sided density s sqrt(2 / rate); a sine of amplitude A the power
    # A^2 / 2 in its line.
    away = (frequency > 20.0) & (frequency < 400.0)
    assert float(np.sqrt(np.mean(amplitude[away] ** 2))) == pytest.approx(0.5 * np.sqrt(2 / rate), rel=0.05)
    line = np.abs(frequency - 7.0) < 1.0
    assert float(np.sum(amplitude[line] ** 2) * 0.25) == pytest.approx(2.0, rel=0.05)
    assert frequency[int(np.argmax(amplitude))] == 7.0
    for length, segment in ((40_000, 4.0), (1999, 1.001), (300, 4.0)):  # even, odd, one piece alone
        ours = amplitude_density(noise[:length], rate, segment)
        assert ours is not None
        theirs = welch(noise[:length], rate, nperseg=min(int(segment * rate), length))
        np.testing.assert_allclose(ours, (theirs[0][1:], np.sqrt(theirs[1][1:])), rtol=1e-9)
    broken = noise.copy()
    broken[5000:5010] = np.nan  # the longest stretch without a gap
    assert amplitude_density(broken, rate) is not None
    assert amplitude_density(np.full(100, np.nan), rate) is None
    assert amplitude_density(noise[:40], rate) is None


def test_a_live_loop_and_a_spectrum_follow_the_bench_and_are_kept(
    rig: Rig, make_window: Callable[..., object], qtbot: QtBot, tmp_path: Path
) -> None:
    plots, free = rig.tab.plots, rig.tab.plots.free
    rig.start()
    rig.run(3.0)
    add_plot(rig.window)
    look(rig.window)
    (loop,) = free.plots
    assert loop.spec == ("motor_torque", "motor_position")
    rig.run(0.2)
    x, y = loop.curve()
    start, stop = plots.shown
    history = plots.history
    assert history is not None
    _, position = history.series("motor_position", start, stop)
    latest = np.degrees(position[-110:])  # they are drawn every third time
    assert latest.min() <= x[-1] <= latest.max()
    assert len(x) == len(y) <= 4000
    before = x[-1]
    rig.run(0.4)
    assert loop.curve()[0][-1] != before
    QTest.mouseClick(rig.button("hold"), LEFT)
    held = loop.curve()[0].copy()
    rig.run(0.4)
    assert np.array_equal(loop.curve()[0], held, equal_nan=True)
    QTest.mouseClick(rig.button("hold"), LEFT)
    add_plot(rig.window)
    choose(rig.window, "freeUp2", "motor_command")
    choose(rig.window, "freeAcross2", "frequency")
    rig.run(4.0)
    frequency, level = free.plots[1].curve()
    told = rig.tab.panel.motion.settings()["frequency_hz"]
    assert frequency[int(np.argmax(level))] == pytest.approx(told, abs=0.5)
    choose(rig.window, "freeUp2", "raw/mcp_volts")  # before any scaling, over what is told to the amplifier
    choose(rig.window, "freeAcross2", "current_command")
    rig.run(0.4)
    told_amps, volts = free.plots[1].curve()
    angle = history.series("mcp_angle", *plots.shown)[1]
    assert np.ptp(volts) == pytest.approx(np.degrees(np.nanmax(angle) - np.nanmin(angle)) / 40.0, rel=0.05)
    assert np.ptp(told_amps) > 0.1
    choose(rig.window, "freeUp2", "motor_command")
    choose(rig.window, "freeAcross2", "frequency")
    tick(rig.window, "angles")
    assert plots.panes["angles"].isHidden()
    assert not plots.panes["force"].isHidden()
    rig.window.resize(1280, 760)
    both = child(rig.window, QSplitter, "acquireBeside")
    QTest.mousePress(both.handle(1), LEFT)
    QTest.mouseMove(both.handle(1), QPoint(-150, 10))
    QTest.mouseRelease(both.handle(1), LEFT)
    wider = both.sizes()
    assert wider[1] > free.plots[0].minimumWidth() + 100
    stack = child(rig.window, QSplitter, "freeStack")
    level_before = stack.sizes()
    assert level_before[0] == pytest.approx(level_before[1], abs=16)
    QTest.mousePress(stack.handle(1), LEFT)
    QTest.mouseMove(stack.handle(1), QPoint(10, 90))
    QTest.mouseRelease(stack.handle(1), LEFT)
    higher = stack.sizes()
    assert higher[0] > level_before[0] + 60
    again = Rig(make_window(tab="acquire", tabs=tabs_with(opener(tmp_path / "again"))), qtbot)  # type: ignore[arg-type]
    kept = again.tab.plots
    assert [plot.spec for plot in kept.free.plots] == [
        ("motor_torque", "motor_position"),
        ("motor_command", "frequency"),
    ]
    assert kept.panes["angles"].isHidden()
    assert not button_of(again.window).boxes["angles"].isChecked()
    again.window.resize(rig.window.size())
    assert child(again.window, QSplitter, "acquireBeside").sizes() == pytest.approx(wider, abs=16)
    assert child(again.window, QSplitter, "freeStack").sizes() == pytest.approx(higher, abs=16)
    look(again.window)  # type: ignore[arg-type]
    QTest.mouseClick(child(again.window, QToolButton, "freeGone1"), LEFT)
    assert [plot.spec[1] for plot in kept.free.plots] == ["frequency"]
    for name in ("displacement", "torque", "force"):
        tick(again.window, name)
    assert kept.none_seen.isVisible()


def test_in_a_window_too_narrow_for_both_kinds_one_is_shown_at_a_time(larger_letters, rig: Rig) -> None:  # type: ignore[no-untyped-def]
    """Live plots, plots of one's own and the side panel had asked for 138 to 199 px more than there were."""
    window, plots = rig.window, rig.tab.plots
    rig.start()
    rig.run(2.0)
    window.resize(1024, 700)
    QApplication.processEvents()
    switch = child(window, QPushButton, "ownPlots")
    assert not switch.isVisible()
    add_plot(window)
    assert [switch.isVisible(), switch.isChecked()] == [True, True]
    assert [plots.free.isVisible(), plots.isVisible()] == [True, False]
    for model in ("none", "nominal"):
        rig.tab.toolbar.model_chosen.emit(model)
        rig.run(0.5)
        for own in (True, False):
            if switch.isChecked() != own:
                QTest.mouseClick(switch, LEFT)
            assert sideways(window) == 0
            assert [plots.free.isVisible(), plots.isVisible()] == [own, not own]
            assert cut_off(rig.tab.widget) == []
    QTest.mouseClick(switch, LEFT)
    before = plots.free.plots[0].curve()[0][-1]
    rig.run(0.4)
    assert plots.free.plots[0].curve()[0][-1] != before, "they stood still while the live ones were not seen"
    window.resize(1600, 900)
    for _ in range(3):
        QApplication.processEvents()
    assert [plots.free.isVisible(), plots.isVisible(), switch.isVisible()] == [True, True, False]
    assert plots.width() > 2 * plots.free.width()
    window.resize(1024, 700)
    for _ in range(3):
        QApplication.processEvents()
    QTest.mouseClick(child(window, QToolButton, "freeGone1"), LEFT)
    assert [plots.isVisible(), switch.isVisible()] == [True, False]


def lissajous(file: h5py.File) -> None:
    """A quarter of a turn between position and torque: a circle."""
    run = file["runs/001"]
    time = run["time"][:]
    run["motor_position"][:] = np.cos(2 * np.pi * 0.5 * time)
    run["motor_torque"][:] = 0.1 * np.sin(2 * np.pi * 0.5 * time)


@pytest.fixture
def reviewing(
    qtbot: QtBot,
    make_window,
    make_session: Callable[..., Path],
    settings: Settings,  # type: ignore[no-untyped-def]
) -> ReviewPage:
    path = make_session("loop.h5", lissajous, samples=20_000)
    settings.set_library(path.parent)
    window = make_window(tab="sessions")
    return review_of(qtbot, window)


def test_any_channel_over_any_in_the_review_follows_the_view(
    reviewing: ReviewPage, qtbot: QtBot, settings: Settings
) -> None:
    page, free = reviewing, reviewing.free
    add_plot(page)
    qtbot.waitUntil(lambda: len(free.plots[0].curve()[0]) > 0, timeout=PATIENCE)
    look(page.window())  # type: ignore[arg-type]
    x, y = free.plots[0].curve()  # degrees and mN m
    assert np.allclose(np.hypot(np.radians(x), y / 100.0), 1.0, atol=1e-3)
    choose(page, "freeAcross1", "time")
    qtbot.waitUntil(lambda: np.ptp(free.plots[0].curve()[0]) > 15.0, timeout=PATIENCE)
    page.plots.top.setXRange(4.0, 6.0, padding=0)
    qtbot.waitUntil(lambda: np.ptp(free.plots[0].curve()[0]) < 2.1, timeout=PATIENCE)
    choose(page, "freeAcross1", "frequency")
    page.plots.show_whole()
    qtbot.waitUntil(lambda: len(free.plots[0].curve()[0]) > 100, timeout=PATIENCE)
    frequency, level = free.plots[0].curve()
    assert frequency[int(np.argmax(level))] == pytest.approx(0.5)
    tick(page, "Joints")
    joints = next(pane for pane in page.plots.panes if pane.spec.title == "Joints")
    assert not joints.plot.isVisible()
    told = FreePlots(page.free._channels, page.free.fixed, ("motor_torque", "motor_position"))
    qtbot.addWidget(told)
    told.remember(settings, "review")
    assert [plot.spec for plot in told.plots] == [("motor_torque", "frequency")]
    assert told.left_out == {"Joints"}


def test_settings_that_hold_anything_do_no_harm(settings: Settings, qtbot: QtBot) -> None:
    two = '"free": [["a", "b"], ["a", "c"]]'
    for text in (
        *("no json", "[]", '{"free": [1, 2]}', '{"left_out": 3}', '{"free": [["a", "b"], ["c"]]}'),
        *(f'{{{two}, "heights": {held}}}' for held in ("3", "[1]", "[-5, 1e400]", "[99999999999, 5]")),
    ):
        settings.set_arrangement("review", text)
        plots = FreePlots({}, {"one": "One"}, ("a", "b"))
        qtbot.addWidget(plots)
        plots.remember(settings, "review")
        assert plots.left_out == frozenset()

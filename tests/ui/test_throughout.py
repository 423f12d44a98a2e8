"""What holds in every tab: the rail's two marks, time left, the smallest window."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QObject, QSize, Qt, Signal
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton, QScrollArea
from pytestqt.qtbot import QtBot

from fingerlab.ui.task_bar import TaskBar, time_left
from fingerlab.ui.window import MainWindow

from .hands import child, invented_diagnosis

SMALLEST = QSize(960, 540)
"""A screen of 1920 x 1080 at 200 %."""


def picture(button: QPushButton) -> QImage:
    return button.grab().toImage()


def test_the_tab_in_front_and_the_one_with_the_keyboard_look_different(make_window) -> None:  # type: ignore[no-untyped-def]
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    front, other = child(window, QPushButton, "tab_model_lab"), child(window, QPushButton, "tab_fit")
    bar = [picture(front).pixelColor(1, front.height() // 2), picture(other).pixelColor(1, 5)]
    other.setFocus()
    focused, shown = picture(other), picture(front)
    # The bar at the left belongs to the tab in front, whatever has the keyboard; focus is a frame all round.
    assert shown.pixelColor(1, front.height() // 2) == bar[0]
    assert focused.pixelColor(1, other.height() // 2) != bar[0]
    top = {focused.pixelColor(x, 0).name() for x in range(8, other.width() - 8)}
    assert len(top) > 1, "no frame"
    assert {shown.pixelColor(x, 0).name() for x in range(8, front.width() - 8)} != top
    QTest.keyClick(other, Qt.Key.Key_Space)
    assert window.current == "fit"
    both = picture(other)
    assert both.pixelColor(1, other.height() // 2) == bar[0]


@pytest.mark.parametrize(
    ("share", "seconds", "words"),
    [
        (0.5, 10.0, "about 10 s left"),
        (0.25, 60.0, "about 3 min left"),
        (0.99, 10.0, "about 1 s left"),
        (0.04, 60.0, ""),
        (0.5, 1.0, ""),
        (1.0, 10.0, ""),
    ],
)
def test_time_left(share: float, seconds: float, words: str) -> None:
    assert time_left(share, seconds) == words


class Runner(QObject):
    """The signals of a task runner."""

    started = Signal(str)
    progressed = Signal(float, str)
    ended = Signal(str)


def test_the_bar_tells_the_time_left(qtbot: QtBot) -> None:
    now = [100.0]
    tasks = Runner()
    bar = TaskBar(tasks, clock=lambda: now[0])  # type: ignore[arg-type]
    qtbot.addWidget(bar)
    tasks.started.emit("Comparing")
    now[0] = 112.0
    tasks.progressed.emit(0.75, "run 3 of 4")
    assert bar.text.text() == "Comparing: run 3 of 4, about 4 s left"


@pytest.mark.parametrize("key", ["acquire", "calibrate", "sessions", "fit", "predict", "model_lab"])
def test_in_the_smallest_window_nothing_is_squeezed(make_window, key: str) -> None:  # type: ignore[no-untyped-def]
    """A tab has the room that it needs: its own, or with scroll bars that lead to the rest."""
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    window.resize(SMALLEST)
    window.show_tab(key)
    QApplication.processEvents()
    widget = window.tab(key).widget
    needed = widget.minimumSizeHint().expandedTo(widget.minimumSize())
    assert widget.width() >= needed.width()
    assert widget.height() >= needed.height()
    room = window.work.currentWidget()
    assert isinstance(room, QScrollArea)
    spare = widget.size() - room.viewport().size()
    assert room.horizontalScrollBar().maximum() == spare.width()
    assert room.verticalScrollBar().maximum() == spare.height()


@pytest.mark.parametrize("key", ["acquire", "calibrate", "sessions", "fit", "predict", "model_lab"])
def test_at_1280_by_800_nothing_scrolls(make_window, key: str) -> None:  # type: ignore[no-untyped-def]
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    window.resize(1280, 800)
    window.show_tab(key)
    QApplication.processEvents()
    room = window.work.currentWidget()
    assert isinstance(room, QScrollArea)
    assert room.horizontalScrollBar().maximum() == room.verticalScrollBar().maximum() == 0

"""What hands do: click, drop, wait; and diagnoses that answer at once or when they are let go."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QMimeData, QPoint, QPointF, QSize, Qt, QUrl
from PySide6.QtGui import QAction, QDragEnterEvent, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton, QScrollArea, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.core.errors import Cancelled
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions.model import Session
from fingerlab.ui.app.tab_registry import TABS, TabEntry
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.model_lab_tab import ModelLabTab
from fingerlab.ui.sessions.review_page import ReviewPage
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from . import invented

LEFT = Qt.MouseButton.LeftButton
PATIENCE = 10_000
LOW = QSize(1024, 700)


def invented_diagnosis(
    sessions: Sequence[Session],
    added: tuple[str, ...],
    progress: Callable[[float, str], None],
    cancelled: Callable[[], bool],
) -> Diagnosis:
    progress(0.5, "fitting")
    name = str(sessions[0].path)
    return invented.friction_diagnosis(name) if added else invented.nominal_diagnosis(name)


class Held:
    """A diagnosis that waits until it is let go or cancelled, as a slow one would."""

    def __init__(self) -> None:
        self.running = threading.Event()
        self.go_on = threading.Event()
        self.was_cancelled = threading.Event()

    def __call__(
        self,
        sessions: Sequence[Session],
        added: tuple[str, ...],
        progress: Callable[[float, str], None],
        cancelled: Callable[[], bool],
    ) -> Diagnosis:
        self.running.set()
        while not self.go_on.wait(0.005):
            if cancelled():
                self.was_cancelled.set()
                raise Cancelled
        return invented_diagnosis(sessions, added, progress, cancelled)


def lab_of(window: MainWindow) -> ModelLabTab:
    """The Model lab of a window."""
    tab = window.tab("model_lab")
    assert isinstance(tab, ModelLabTab)
    return tab


def lab_with(diagnose: Callable[..., Diagnosis]) -> tuple[TabEntry, ...]:
    """The window's tabs, with another diagnosis in the Model lab."""
    return tuple(
        replace(entry, make=lambda context: ModelLabTab(context, diagnose))
        if entry.key == "model_lab"
        else entry
        for entry in TABS
    )


def drop(window: MainWindow, *paths: Path) -> None:
    """Drop files on the window as a file manager does."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    buttons, keys = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    action = Qt.DropAction.CopyAction
    enter = QDragEnterEvent(QPoint(400, 300), action, data, buttons, keys)
    QApplication.sendEvent(window, enter)
    assert enter.isAccepted()
    QApplication.sendEvent(window, QDropEvent(QPointF(400, 300), action, data, buttons, keys))


def child(window: QWidget, kind: type, name: str):  # type: ignore[no-untyped-def]
    found = window.findChild(kind, name)
    assert found is not None, name
    return found


def chosen_in_menu(window: QWidget, text: str) -> QAction:
    """The entry of the window's menus that reads so."""
    found = [one for one in window.findChildren(QAction) if one.text().replace("&", "") == text]
    assert found, text
    return found[0]


def click(window: QWidget, name: str) -> None:
    button = child(window, QPushButton, name)
    assert button.isVisible(), name
    QTest.mouseClick(button, LEFT)


def wait_for_result(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.waitUntil(
        lambda: lab_of(window).controller.history is not None and not window.tasks.busy, timeout=PATIENCE
    )


def review_of(qtbot: QtBot, window: MainWindow) -> ReviewPage:
    """The review of the only session of the folder that the window shows, once it is read."""
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    qtbot.waitUntil(lambda: tab.page.model.total == 1, timeout=PATIENCE)
    tab.page.table.selectRow(0)
    click(window, "review")
    page = tab.review_page
    qtbot.waitUntil(lambda: page.session is not None and not page.data.busy, timeout=PATIENCE)
    return page


def sideways(window: MainWindow) -> int:
    """How far the tab in front scrolls sideways in a low window, px."""
    window.resize(LOW)
    for _ in range(3):
        QApplication.processEvents()
    room = window.work.currentWidget()
    assert isinstance(room, QScrollArea)
    return room.horizontalScrollBar().maximum()

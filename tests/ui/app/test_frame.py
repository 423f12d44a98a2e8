"""The frame: rail, keys, header, STOP, what tabs are told, and closing."""

from __future__ import annotations

import shutil
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit, QMenu, QPushButton, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.core.errors import Cancelled
from fingerlab.sessions.model import Session
from fingerlab.ui.app.context import ApplicationContext, RigLine, Settings
from fingerlab.ui.app.tab_registry import TABS, Command, Tab, TabEntry
from fingerlab.ui.app.window import MainWindow

from ..hands import LEFT, PATIENCE, child, click, drop, invented_diagnosis, lab_of

CONTROL = Qt.KeyboardModifier.ControlModifier


class Notebook(Tab):
    """A tab that writes down what the frame tells it."""

    def __init__(self, context: ApplicationContext) -> None:
        super().__init__(context)
        self.told: list[str] = []
        self.stays = False
        self.done = 0
        self.widget = QWidget()
        self.field = QLineEdit()
        self.field.setAccessibleName("Field")
        QVBoxLayout(self.widget).addWidget(self.field)
        self.commands = (Command("&Do it", self._do, "Alt+1", lambda: not self.stays),)

    def _do(self) -> None:
        self.done += 1

    def on_shown(self) -> None:
        self.told.append("shown")

    def on_hidden(self) -> None:
        self.told.append("hidden")

    def on_session_opened(self, sessions: tuple[Session, ...]) -> None:
        self.told.append(f"{len(sessions)} open")

    def on_session_recorded(self, path: Path) -> None:
        self.told.append(f"recorded {path.name}")

    def can_close(self) -> bool:
        return not self.stays

    def shut_down(self) -> None:
        self.told.append("shut down")


NOTEBOOK = TabEntry(2, "notebook", "Notebook", "Writes down.", Notebook)


@pytest.fixture
def window(make_window) -> MainWindow:  # type: ignore[no-untyped-def]
    lab = TABS[-1]
    made: MainWindow = make_window(tab="notebook", tabs=(NOTEBOOK, lab))
    return made


def notebook(window: MainWindow) -> Notebook:
    tab = window.tab("notebook")
    assert isinstance(tab, Notebook)
    return tab


def test_only_tabs_that_exist_are_on_the_rail_in_the_order_of_the_work(make_window) -> None:  # type: ignore[no-untyped-def]
    window = make_window()
    buttons = window.rail.findChildren(QPushButton)
    assert [b.text() for b in buttons] == [entry.title for entry in TABS]
    numbers = [entry.number for entry in TABS]
    assert numbers == sorted(set(numbers))
    assert {e.key: e.number for e in TABS}["model_lab"] == 6


def test_rail_and_keys_change_the_tab_and_the_next_start_shows_it(window: MainWindow, make_window) -> None:  # type: ignore[no-untyped-def]
    assert window.current == "notebook"
    QTest.keyClick(window, Qt.Key.Key_6, CONTROL)
    assert lab_of(window).widget.isVisible()
    assert child(window, QPushButton, "tab_model_lab").isChecked()
    click(window, "tab_notebook")
    assert notebook(window).told == ["shown", "hidden", "shown"]
    assert window.settings.tab() == "notebook"


def test_the_keyboard_begins_at_the_tab_in_front(make_window) -> None:  # type: ignore[no-untyped-def]
    """Not at the topmost, to which Space would go."""
    focused = make_window(tab="sessions").focusWidget()
    assert focused is not None
    assert focused.objectName() == "tab_sessions"


def test_keys_of_a_tab_work_only_while_it_is_in_front(window: MainWindow) -> None:
    tab = notebook(window)
    alt = Qt.KeyboardModifier.AltModifier
    QTest.keyClick(window, Qt.Key.Key_1, alt)
    assert tab.done == 1
    window.show_tab("model_lab")
    QTest.keyClick(window, Qt.Key.Key_1, alt)
    assert tab.done == 1
    window.show_tab("notebook")
    tab.stays = True
    tab.context.commands_changed.emit()
    QTest.keyClick(window, Qt.Key.Key_1, alt)
    assert tab.done == 1
    tab.stays = False


def test_a_tab_built_late_is_told_what_is_open(qtbot: QtBot, make_window, session_file: Path) -> None:  # type: ignore[no-untyped-def]
    window = make_window(tabs=(NOTEBOOK, TABS[-1]))
    window.context.open_paths([session_file], tab="notebook")
    qtbot.waitUntil(lambda: window.current == "notebook" and not window.tasks.busy, timeout=PATIENCE)
    assert notebook(window).told == ["1 open", "shown"]
    window.close_session()
    assert notebook(window).told[-1] == "0 open"


def test_a_session_opened_in_another_tab_is_compared_when_the_lab_is_looked_at(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    session_file: Path,
) -> None:
    from functools import partial

    from fingerlab.ui.lab.model_lab_tab import ModelLabTab

    lab = TabEntry(6, "model_lab", "Model lab", "", partial(ModelLabTab, diagnose=invented_diagnosis))
    window = make_window(tabs=(NOTEBOOK, lab))
    window.show_tab("notebook")
    window.context.open_paths([session_file], tab="notebook")
    qtbot.waitUntil(lambda: bool(lab_of(window).controller.sessions), timeout=PATIENCE)
    assert not window.tasks.busy
    window.show_tab("model_lab")
    qtbot.waitUntil(lambda: lab_of(window).controller.history is not None, timeout=PATIENCE)


def test_a_recorded_session_is_told_to_every_tab_and_is_recent(
    window: MainWindow, session_file: Path
) -> None:
    window.context.recorded(session_file)
    assert notebook(window).told[-1] == f"recorded {session_file.name}"
    assert window.settings.recent() == [session_file.resolve()]


@pytest.mark.qt_log_ignore("This plugin does not support")  # of Qt's off-screen platform
def test_escape_stops_from_a_field_a_menu_and_another_tab(window: MainWindow, qtbot: QtBot) -> None:
    stops: list[int] = []
    window.context.stop_asked.connect(lambda: stops.append(1))
    QTest.keyClick(window, Qt.Key.Key_Escape)
    assert not stops  # no rig, nothing to stop
    window.context.show_rig(RigLine(device="a bench"))
    field = notebook(window).field
    field.setFocus()
    QTest.keyClick(field, Qt.Key.Key_Escape)
    assert stops
    stops.clear()
    window.show_tab("model_lab")
    QTest.keyClick(window, Qt.Key.Key_Escape)
    assert stops
    stops.clear()
    menu = QMenu(window)
    menu.addAction("anything")
    menu.popup(window.mapToGlobal(window.rect().center()))
    qtbot.waitUntil(menu.isVisible)
    QTest.keyClick(menu, Qt.Key.Key_Escape)
    assert stops
    assert not menu.isVisible()
    stops.clear()
    click(window, "stop")
    assert stops


def test_stop_is_in_the_same_place_in_every_tab(window: MainWindow) -> None:
    stop = child(window, QPushButton, "stop")
    places = set()
    for key in ("notebook", "model_lab"):
        window.show_tab(key)
        assert stop.isVisible()
        places.add((stop.mapTo(window, stop.rect().topLeft()).toTuple(), stop.size().toTuple()))
    assert len(places) == 1


def test_header_and_status_bar_say_how_the_rig_is(window: MainWindow) -> None:
    window.context.show_rig(
        RigLine("live", "running", "sine, 15°, 1 Hz", 12345, False, "Dev1", 99000, 3, 5 * 10**8, "", True)
    )
    assert child(window, QLabel, "rigState").text() == "Running"
    assert child(window, QLabel, "sampleCount").text() == "12\u202f345 samples"
    assert window.header.dot.isVisible()
    assert window.header.lamp.light == "live"
    status = child(window, QLabel, "statusDevice").text()
    assert status == "Dev1 · 99\u202f000 samples · 3 late · ⚠ only 0.5 GB free"
    window.show_tab("model_lab")
    assert child(window, QLabel, "sampleCount").isVisible()
    window.context.show_rig(RigLine())
    assert not window.header.dot.isVisible()
    assert not child(window, QLabel, "statusDevice").isVisible()


def test_the_status_bar_says_less_where_room_is_short_and_never_half_a_word(window: MainWindow) -> None:
    """At 200 % the smallest window has 640 of the widget's own pixels; the warning stays to the last."""
    line = RigLine(device="NI USB-6211", samples=36_000_000, late=2, free_bytes=74 * 10**9, warning="9 lost")
    window.context.show_rig(replace(line, cycle_s=1e-3, longest_cycle_s=1.23e-3))
    label = window.status.device
    cycle = "cycle 1.00 ms, longest 1.23 ms"
    whole = f"NI USB-6211 · 36\u202f000\u202f000 samples · 2 late · {cycle} · 74 GB free · ⚠ 9 lost"
    assert label.text() == label.seen == whole
    seen = []
    for width in range(label.sizeHint().width(), label.minimumSizeHint().width() - 1, -1):
        label.resize(width, label.height())
        if label.seen not in seen:
            seen.append(label.seen)
        assert label.fontMetrics().horizontalAdvance(label.seen) <= width
    assert seen[0] == whole
    assert len(seen) == 4
    assert all(text.startswith("NI USB-6211 · ") and text.endswith("⚠ 9 lost") for text in seen)


def test_a_tab_that_would_lose_something_keeps_the_window_open(window: MainWindow) -> None:
    tab = notebook(window)
    tab.stays = True
    window.close()
    assert window.isVisible()
    assert "shut down" not in tab.told
    tab.stays = False
    window.close()
    assert not window.isVisible()
    assert tab.told[-1] == "shut down"


def test_dropped_files_go_to_the_tab_that_takes_them(
    window: MainWindow, session_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[Path] = []
    monkeypatch.setattr(notebook(window), "accept_files", lambda paths: not taken.extend(paths))
    drop(window, session_file)
    assert taken == [session_file]
    assert not window.tasks.busy


def test_a_wrong_file_dropped_on_any_tab_is_one_sentence(
    make_window,  # type: ignore[no-untyped-def]
    tmp_path: Path,
    qtbot: QtBot,
    settings: Settings,
) -> None:
    """Nothing is taken, no other tab comes to the front."""
    (tmp_path / "library").mkdir()
    settings.set_library(tmp_path / "library")
    window = make_window(tab="acquire")
    message = child(window, QLabel, "message")
    for name in ("notes.rtf", "photo.png", "cut.h5", "model.json", "gone.h5"):
        wrong = tmp_path / name
        if name != "gone.h5":
            wrong.write_bytes(b"neither table nor recording")
        for key in (entry.key for entry in TABS):
            window.show_tab(key)
            window.context.hush()
            drop(window, wrong)
            qtbot.waitUntil(lambda: message.isVisible() and not window.tasks.busy, timeout=PATIENCE)
            assert name in message.text(), key
            assert message.text().count(". ") == 0, message.text()
            assert "Traceback" not in message.text()
            assert window.current == key
            assert window.context.sessions == ()


def test_a_recording_that_is_dropped_with_its_copy_is_one_sentence(
    window: MainWindow, session_file: Path, tmp_path: Path, qtbot: QtBot
) -> None:
    copy = tmp_path / "copy.h5"
    shutil.copy(session_file, copy)
    message = child(window, QLabel, "message")
    for paths, words in (
        ((session_file, copy), "hold the same recording; give one of them"),
        ((session_file, session_file), "is given twice; give each session once"),
    ):
        window.context.hush()
        drop(window, *paths)
        qtbot.waitUntil(lambda: message.isVisible() and not window.tasks.busy, timeout=PATIENCE)
        assert words in message.text()
        assert window.context.sessions == ()


def test_tasks_of_different_owners_wait_for_one_another(qtbot: QtBot, window: MainWindow) -> None:
    tasks, order = window.tasks, []
    go_on = threading.Event()

    def slow(progress, cancelled):  # type: ignore[no-untyped-def]
        while not go_on.wait(0.002):
            if cancelled():
                order.append("slow stopped")
                raise Cancelled
        return "slow"

    tasks.start("Slow", slow, order.append, owner="a")
    tasks.start("First of b", lambda *_: "b1", order.append, owner="b")
    tasks.start("Second of b", lambda *_: "b2", order.append, owner="b")
    go_on.set()
    qtbot.waitUntil(lambda: not tasks.busy, timeout=PATIENCE)
    assert order == ["slow", "b2"]
    go_on.clear()
    tasks.start("Slow", slow, order.append, owner="a")
    tasks.start("Urgent", lambda *_: "urgent", order.append)
    qtbot.waitUntil(lambda: not tasks.busy, timeout=PATIENCE)
    assert order[2:] == ["slow stopped", "urgent"]


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_the_sheet_of_keys_and_the_log(window: MainWindow, qtbot: QtBot) -> None:
    from PySide6.QtWidgets import QDialog, QPlainTextEdit, QTextBrowser

    QTest.keyClick(window, Qt.Key.Key_F1)
    sheet = child(window, QTextBrowser, "keySheet").toPlainText()
    for words in ("Stop the motor", "Esc", "Notebook", "Ctrl+2", "Do it", "Alt+1"):
        assert words in sheet
    window.context.say("The device was opened")
    window.menus.log.trigger()
    shown = child(window, QPlainTextEdit, "log")
    assert "The device was opened" in shown.toPlainText()
    window.context.say("The amplifier is on")  # while the log is open
    assert "The amplifier is on" in shown.toPlainText().splitlines()[-1]
    for dialog in window.findChildren(QDialog):
        QTest.keyClick(dialog, Qt.Key.Key_Escape)
        assert not dialog.isVisible()
    assert child(window, QPushButton, "tab_notebook").isEnabled()
    QTest.mouseClick(child(window, QPushButton, "tab_notebook"), LEFT)

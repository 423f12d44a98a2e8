"""What the window remembers, and that a bad memory never harms."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray, QPoint, QRect, QSettings, QSize, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.context import MAX_RECENT, Settings
from fingerlab.ui.app.window import PlaceKeeper
from fingerlab.ui.widgets.layout import Panes


def test_recent_files_latest_first_without_those_that_are_gone(settings: Settings, tmp_path: Path) -> None:
    files = [tmp_path / f"{number}.h5" for number in range(MAX_RECENT + 2)]
    for file in files:
        file.touch()
        settings.remember([file])
    assert settings.recent() == [file.resolve() for file in reversed(files)][:MAX_RECENT]
    files[-1].unlink()
    settings.remember([files[4]])
    assert settings.recent()[0] == files[4].resolve()
    assert files[-1].resolve() not in settings.recent()
    assert len(set(settings.recent())) == len(settings.recent())


def test_one_recent_file_survives_the_settings_file(tmp_path: Path) -> None:
    name = str(tmp_path / "s.ini")
    file = tmp_path / "only.h5"
    file.touch()
    store = QSettings(name, QSettings.Format.IniFormat)
    Settings(store).remember([file])
    store.sync()
    assert Settings(QSettings(name, QSettings.Format.IniFormat)).recent() == [file.resolve()]


def test_a_window_left_on_a_screen_that_is_gone_comes_back(qtbot: QtBot, settings: Settings) -> None:
    room = QGuiApplication.primaryScreen().availableGeometry()
    window = QWidget()
    qtbot.addWidget(window)
    window.setGeometry(QRect(room.right() + 5000, room.bottom() + 5000, 300, 200))
    settings.save_place(window)
    again = QWidget()
    qtbot.addWidget(again)
    settings.restore_place(again, QSize(1280, 800))
    shown = room.intersected(again.geometry())
    assert shown.width() >= 64
    assert shown.height() >= 64


def test_settings_that_make_no_sense_are_ignored(qtbot: QtBot, tmp_path: Path) -> None:
    store = QSettings(str(tmp_path / "bad.ini"), QSettings.Format.IniFormat)
    store.setValue("geometry", QByteArray(b"nonsense"))
    store.setValue("appearance", "purple")
    store.setValue("stop_key", "Space")
    store.setValue("recent", 7)
    store.setValue("widths/sessions", ["90", "-3"])
    store.setValue("sorting/sessions", "sideways 3")
    settings = Settings(store)
    window = QWidget()
    qtbot.addWidget(window)
    settings.restore_place(window, QSize(5000, 5000))
    room = QGuiApplication.primaryScreen().availableGeometry()
    assert room.contains(window.geometry())
    assert settings.appearance() == "system"
    assert settings.stop_key() == "Pause"
    assert settings.recent() == []
    assert settings.widths("sessions") == ()
    assert settings.sorting("sessions") == (-1, False)


@pytest.fixture
def window(qtbot: QtBot) -> QWidget:
    made = QWidget()
    qtbot.addWidget(made)
    return made


def shown_panes(window: QWidget, settings: Settings, heights: tuple[int, ...]) -> Panes:
    """A splitter of 400 px beside its grips, with the heights that are remembered."""
    panes = Panes("work", [(QWidget(), 1) for _ in heights], heights)
    panes.setParent(window)
    panes.remember(settings)
    panes.resize(300, 400 + (len(heights) - 1) * panes.handleWidth())
    window.show()
    panes.show()
    return panes


def test_a_splitter_comes_back_as_it_was_left(window: QWidget, settings: Settings) -> None:
    first = shown_panes(window, settings, (100, 200, 100))
    assert first.sizes() == [100, 200, 100]
    handle = first.handle(2)
    grip = handle.rect().center()
    QTest.mousePress(handle, Qt.MouseButton.LeftButton, pos=grip)
    QTest.mouseMove(handle, grip - QPoint(0, 60))
    QTest.mouseRelease(handle, Qt.MouseButton.LeftButton, pos=grip)
    left = first.sizes()
    assert left[1] < 200 < left[1] + left[2]
    # Without the first one having been closed.
    assert shown_panes(window, settings, (100, 200, 100)).sizes() == left


def test_heights_that_make_no_sense_are_ignored(window: QWidget, tmp_path: Path) -> None:
    store = QSettings(str(tmp_path / "bad.ini"), QSettings.Format.IniFormat)
    for value in (7, ["1", "-4"], ["a", "b"], ["0", "0"], ["5", "5", "5"]):
        store.setValue("heights/work", value)
        assert shown_panes(window, Settings(store), (300, 100)).sizes() == [300, 100], value


def test_the_place_is_kept_without_a_clean_end(qtbot: QtBot, tmp_path: Path) -> None:
    store = QSettings(str(tmp_path / "place.ini"), QSettings.Format.IniFormat)
    window, settings = QWidget(), Settings(store)
    qtbot.addWidget(window)
    window.resize(700, 500)
    keeper = PlaceKeeper(window, settings)
    window.show()
    window.resize(640, 420)
    qtbot.waitUntil(lambda: bool(store.value("geometry")))
    keeper.keep()
    again = QWidget()
    qtbot.addWidget(again)
    settings.restore_place(again, QSize(1280, 800))
    assert again.size() == QSize(640, 420)

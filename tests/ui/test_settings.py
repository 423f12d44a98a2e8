"""What the window remembers, and that a bad memory never harms."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QByteArray, QRect, QSettings, QSize
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from fingerlab.ui.settings import MAX_RECENT, Settings


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
    store.setValue("recent", 7)
    settings = Settings(store)
    window = QWidget()
    qtbot.addWidget(window)
    settings.restore_place(window, QSize(5000, 5000))
    room = QGuiApplication.primaryScreen().availableGeometry()
    assert room.contains(window.geometry())
    assert settings.appearance() == "system"
    assert settings.recent() == []

"""Windows and menus on a screen of 1280 x 720, which 1920 x 1080 at 150 % is."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QRect
from PySide6.QtWidgets import QDialog, QMenu, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.documents import Documents
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.budget import BudgetDialog
from fingerlab.ui.predict.force_panel import ModelsDialog
from fingerlab.ui.sessions.result_dialogs import PairsDialog, TrialDialog
from fingerlab.ui.sessions.trend_dialog import TrendDialog

LOW = QRect(0, 0, 1280, 720)
TITLE_BAR = 32


@pytest.mark.parametrize(
    "make", [BudgetDialog, Documents, ModelsDialog, PairsDialog, TrendDialog, TrialDialog]
)
def test_a_window_is_no_taller_than_its_screen(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, make: Callable[[], QDialog]
) -> None:
    monkeypatch.setattr(QWidget, "screen", lambda _self: SimpleNamespace(availableGeometry=lambda: LOW))
    dialog = make()
    qtbot.addWidget(dialog)
    shown = dialog.size().expandedTo(dialog.minimumSizeHint())
    assert shown.height() + TITLE_BAR <= LOW.height()
    assert shown.width() <= LOW.width()


def test_no_menu_is_taller_than_the_screen(make_window: Callable[[], MainWindow]) -> None:
    window = make_window()
    for key in ("sessions", "acquire", "calibrate", "fit", "predict", "model_lab"):
        window.show_tab(key)
        for top in window.menuBar().actions():
            menu = top.menu()
            assert isinstance(menu, QMenu)
            assert menu.sizeHint().height() < LOW.height() - TITLE_BAR, f"{key}: {top.text()}"


def test_entries_of_a_menu_in_the_menu_keep_their_keys(make_window: Callable[[], MainWindow]) -> None:
    window = make_window()
    window.show_tab("model_lab")
    sheet = window.menus.keys()
    assert "Alt+1" in [key for _, entries in sheet for _, key in entries]
    inner = next(menu for menu in window.findChildren(QMenu) if menu.title() == "E&quation")
    assert inner.actions()[0].shortcut().toString() == "Alt+1"

"""Saving the report page from the window."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.window import MainWindow

from ..hands import child, click, lab_of

PATIENCE = 120_000


def choose(monkeypatch: pytest.MonkeyPatch, path: Path | str) -> None:
    """The save dialog answers with ``path``; the dialog itself asks before it names a file that is there."""
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(path), "")))


def test_the_page_shows_what_the_window_shows(
    qtbot: QtBot,
    opened: MainWindow,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    page = tmp_path / "page.html"
    page.write_text("an older page, and the dialog has asked", encoding="utf-8")
    choose(monkeypatch, page)
    click(opened, "addToModel")
    qtbot.waitUntil(lambda: lab_of(opened).can_undo, timeout=PATIENCE)
    QTest.keyClick(opened, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    message = child(opened, QLabel, "message")
    qtbot.waitUntil(message.isVisible, timeout=PATIENCE)
    assert message.text() == f"Report page saved: {page}"
    text = page.read_text(encoding="utf-8")
    story = " ".join(re.sub("<[^>]*>", " ", text.split('id="story"')[1].split("</section>")[0]).split())
    # The addition with the error before and after it, its probability, its evidence, errors by equation.
    assert "Coulomb joint friction 12.4 1.10 83 %" in story
    assert "The residual flips sign with speed and is 4.8 mN m on both sides." in story
    assert "Joint torque 4.81 0.44 0.40 mN m" in story
    assert [file.name for file in tmp_path.glob("page*")] == ["page.html"]


def test_a_folder_that_is_not_there_is_one_sentence(
    qtbot: QtBot,
    opened: MainWindow,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    choose(monkeypatch, tmp_path / "nowhere" / "page.html")
    click(opened, "report")
    message = child(opened, QLabel, "message")
    qtbot.waitUntil(message.isVisible, timeout=PATIENCE)
    assert "nowhere" in message.text()
    assert not (tmp_path / "nowhere").exists()


def test_no_name_chosen_writes_nothing(
    opened: MainWindow,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    choose(monkeypatch, "")
    click(opened, "report")
    assert not opened.tasks.busy

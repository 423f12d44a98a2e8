"""The documents in the window, words of the glossary where they stand, an own effect from the verdict."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QDesktopServices, QTextDocument
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialogButtonBox, QFileDialog, QLabel, QPushButton, QWhatsThis
from pytestqt.qtbot import QtBot

from fingerlab.effects import whole_catalogue
from fingerlab.report import documents
from fingerlab.ui.app.documents import Documents
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.own_effects import EffectEditor, OwnEffects
from fingerlab.ui.widgets.theme import apply_appearance

from ..hands import LEFT, child, click, lab_of

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def help_entry(window: MainWindow, words: str) -> None:
    """Click an entry of the Help menu."""
    menu = window.menuBar().actions()[-1].menu()
    (action,) = (a for a in menu.actions() if a.text().replace("&", "") == words)  # type: ignore[union-attr]
    menu.popup(window.mapToGlobal(QPoint(0, 0)))  # type: ignore[union-attr]
    QTest.mouseClick(menu, LEFT, pos=menu.actionGeometry(action).center())  # type: ignore[union-attr]


def pages_shown(dialog: Documents) -> list[str]:
    every = dialog.contents.findItems("", Qt.MatchFlag.MatchContains | Qt.MatchFlag.MatchRecursive)
    items = [i for i in every if i.data(0, Qt.ItemDataRole.UserRole) and not i.isHidden()]
    return [i.data(0, Qt.ItemDataRole.UserRole) for i in items]


def test_documents_are_searched_read_and_followed(
    make_window, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:  # type: ignore[no-untyped-def]
    window = make_window()
    help_entry(window, "Documents…")
    dialog = child(window, Documents, "documents")
    assert dialog.view.toPlainText().startswith("FingerLab")
    assert {"theory.md", "commands.md", "catalogue/cable_slack.md"} <= set(pages_shown(dialog))
    QTest.keyClicks(dialog.wanted, "encoder terminal")
    assert "rig.md" in pages_shown(dialog)
    assert "fit.md" not in str(pages_shown(dialog))
    dialog.wanted.clear()
    QTest.keyClicks(dialog.wanted, "no page holds xyzzy")
    assert dialog.none.isVisible()
    dialog.wanted.clear()
    dialog.open_page("theory.md")
    text = dialog.view.toPlainText()
    assert "$" not in text  # formulas are drawn
    picture = dialog.view.loadResource(int(QTextDocument.ResourceType.ImageResource.value), "formula:0")
    assert picture.width() > 5
    link = re.findall(r"\]\(([\w/-]+\.md)", documents.pages()["theory.md"])[0]
    dialog.view.anchorClicked.emit(link)
    assert dialog.view.page == documents.resolved("theory.md", link)
    QTest.mouseClick(dialog.back, LEFT)
    assert dialog.view.page == "theory.md"
    opened: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened.append(url.toString()))
    dialog.view.anchorClicked.emit("https://www.fingerlab.example")
    assert opened == ["https://www.fingerlab.example"]
    dialog.close()


def test_a_word_is_explained_where_it_stands_and_in_the_glossary(
    opened: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    monkeypatch.setattr(QWhatsThis, "showText", staticmethod(lambda _at, text, _widget: told.append(text)))
    lab = lab_of(opened)
    error = lab.view.bar.error
    QTest.keyClick(opened, Qt.Key.Key_F1, Qt.KeyboardModifier.ShiftModifier)
    assert QWhatsThis.inWhatsThisMode()
    QTest.mouseClick(error, LEFT)
    QWhatsThis.leaveWhatsThisMode()
    assert "Floor: how well the bench repeats itself" in told[-1]  # its tooltip says so already
    assert "<b>held out, fold, split</b></a>: scored by a fit that has not seen the run" in told[-1]
    assert told[-1].count("how well the bench") == 1
    help_entry(opened, "Glossary…")
    dialog = child(opened, Documents, "documents")
    assert dialog.view.page == "glossary.md"
    opened.show_documents("glossary.md", "floor")
    assert dialog.view.textCursor().selectedText() == "floor"
    read = dialog.view.verticalScrollBar().value()
    assert read > 0
    apply_appearance(QApplication.instance(), "dark")
    assert dialog.view.textCursor().selectedText() == "floor"  # the place that was read stays
    assert dialog.view.verticalScrollBar().value() == read
    apply_appearance(QApplication.instance(), "light")
    dialog.close()


def test_what_is_not_in_the_catalogue_becomes_an_effect_of_ones_own(
    opened: MainWindow, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    monkeypatch.setattr("fingerlab.ui.lab.own_effects.ask_to_run", lambda *_: True)
    file = tmp_path / "square_loss.py"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(file), "")))
    lab = lab_of(opened)
    lab.view.candidates.choose("nothing_missing")
    assert not lab.view.candidates.add_button.isEnabled()
    lab.view.candidates.choose("not_in_catalogue")
    assert child(opened, QPushButton, "addToModel").text() == "Wri&te an effect of your own…"
    click(opened, "addToModel")
    dialog = lab.pages.findChild(OwnEffects)
    editor = dialog.findChild(EffectEditor)
    text = editor.text.toPlainText()
    failure = lab.controller.diagnosis.failure
    assert failure is not None
    assert failure.text in text
    assert 'id="square_loss"' in text
    editor.text.setPlainText(text.replace("THE MISSING PART GROWS", "What is missing grows"))
    QTest.mouseClick(child(editor, QDialogButtonBox, "").button(QDialogButtonBox.StandardButton.Save), LEFT)
    assert "What is missing grows" in file.read_text(encoding="utf-8")
    assert child(dialog, QLabel, "ownFolder").text() == f"Folder: {tmp_path}"
    assert dialog.files.currentItem().text() == "square_loss.py: new; not run"
    click(dialog, "ownTrust")
    assert dialog.files.currentItem().text() == "square_loss.py: takes part, as Square loss"
    assert "square_loss" in whole_catalogue()
    click(dialog, "ownEdit")
    again = dialog.findChildren(EffectEditor)[-1]
    assert "What is missing grows" in again.text.toPlainText()
    QTest.keyClick(again.text, Qt.Key.Key_X)
    left: list[bool] = []
    monkeypatch.setattr(
        "fingerlab.ui.lab.own_effects.ask_to_leave", lambda *_: bool(left.append(True)) or True
    )
    QTest.keyClick(again, Qt.Key.Key_Escape)
    assert left == [True]
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: ("/elsewhere/it.py", "")))
    click(dialog, "ownNew")
    assert dialog.problem.text().startswith("it.py should stand in")
    click(dialog, "ownForget")
    dialog.close()

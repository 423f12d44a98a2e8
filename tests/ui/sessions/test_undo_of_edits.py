"""Undo in the Sessions tab, by keys and menus: tags and notes, and a session that was cut or copied."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QLineEdit, QPlainTextEdit
from pytestqt.qtbot import QtBot

from fingerlab.core.errors import UserError
from fingerlab.library.notes import FILE_NAME
from fingerlab.ui.sessions import session_files as undoing
from fingerlab.ui.sessions.session_files import EditHistory, FileEdit, Gone
from fingerlab.ui.sessions.session_table import TAGS

from ..hands import PATIENCE, child, click
from .test_sessions_tab import Opened, browsing, choose, entry, folder, row_of, texts

__all__ = ["browsing", "folder"]  # fixtures

CONTROL = Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def trash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A trash of the test's own in place of the desktop's."""
    place = tmp_path / "Trash" / "files"
    place.mkdir(parents=True)

    class File:
        def __init__(self, name: str) -> None:
            self._path = Path(name)

        def moveToTrash(self) -> bool:
            target = place / self._path.name
            self._path.rename(target)
            self._path = target
            return True

        def fileName(self) -> str:
            return str(self._path)

        def errorString(self) -> str:
            return ""

    monkeypatch.setattr(undoing, "QFile", File)
    return place


def test_tags_and_notes_are_taken_back_and_done_again(browsing: Opened, folder: Path) -> None:
    window, tab = browsing
    choose(tab, "ring.h5")
    tags, notes = child(window, QLineEdit, "tags"), child(window, QPlainTextEdit, "notes")
    QTest.keyClicks(tags, "good")
    click(window, "keepNotes")
    QTest.keyClicks(notes, "run 2 slipped")
    tab.page.table.setFocus()
    assert window.menus.undo.isEnabled()
    QTest.keyClick(window, Qt.Key.Key_Z, CONTROL)  # what was typed last, though it was not kept yet
    assert (tags.text(), notes.toPlainText()) == ("good", "")
    QTest.keyClick(window, Qt.Key.Key_Z, CONTROL)
    assert tags.text() == ""
    assert texts(tab, TAGS)[row_of(tab, "ring.h5")] == ""
    assert "good" not in (folder / FILE_NAME).read_text(encoding="utf-8")
    assert not window.menus.undo.isEnabled()
    for _ in range(2):
        window.menus.redo.trigger()
    assert (tags.text(), notes.toPlainText()) == ("good", "run 2 slipped")
    assert "run 2 slipped" in (folder / FILE_NAME).read_text(encoding="utf-8")


def test_undo_is_about_the_session_that_was_changed(browsing: Opened, folder: Path) -> None:
    window, tab = browsing
    choose(tab, "ring.h5")
    QTest.keyClicks(child(window, QLineEdit, "tags"), "good")
    choose(tab, "may/index.h5")
    window.menus.undo.trigger()
    assert texts(tab, TAGS)[row_of(tab, "ring.h5")] == ""
    assert child(window, QLineEdit, "tags").text() == ""
    window.menus.redo.trigger()
    assert texts(tab, TAGS)[row_of(tab, "ring.h5")] == "good"
    assert child(window, QLineEdit, "tags").text() == ""


def test_a_new_file_goes_to_the_trash_and_comes_back(
    browsing: Opened, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, folder: Path, trash: Path
) -> None:
    window, tab = browsing
    choose(tab, "ring.h5")
    target = folder / "copied.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    entry(window, "Copy with tags").trigger()
    qtbot.waitUntil(lambda: [p.name for p in tab.page.paths()] == ["copied.h5"], timeout=PATIENCE)
    content = target.read_bytes()
    window.menus.undo.trigger()
    qtbot.waitUntil(lambda: tab.page.count.text() == "3 sessions", timeout=PATIENCE)
    assert not target.exists()
    assert (trash / "copied.h5").read_bytes() == content
    window.menus.redo.trigger()
    qtbot.waitUntil(lambda: tab.page.count.text() == "4 sessions", timeout=PATIENCE)
    assert target.read_bytes() == content


@pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere the trash is the user's own and has no other place"
)
@pytest.mark.parametrize("there", [False, True])
def test_the_desktops_own_trash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool) -> None:
    """By Qt itself, in the home of a new user, who has no folder for data yet, and in one that is used."""
    data = tmp_path / "home" / ".local" / "share"
    if there:
        data.mkdir(parents=True)
    monkeypatch.setenv("XDG_DATA_HOME", str(data))
    path = tmp_path / "new.h5"
    path.write_text("as written", encoding="utf-8")
    history = EditHistory()
    history.add(FileEdit(path, lambda _: False))
    history.undo()
    assert not path.exists()
    assert (data / "Trash" / "files" / "new.h5").read_text(encoding="utf-8") == "as written"
    assert f"Path={path}" in (data / "Trash" / "info" / "new.h5.trashinfo").read_text(encoding="utf-8")
    history.redo()
    assert path.read_text(encoding="utf-8") == "as written"
    assert not [*(data / "Trash").rglob("new.h5*")]


@pytest.mark.skipif(sys.platform != "linux", reason="as above")
def test_where_there_is_no_trash_the_file_stays_and_older_steps_can_be_undone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "file" / "share"))  # nothing can be made in a file
    path = tmp_path / "new.h5"
    path.write_text("as written", encoding="utf-8")
    history = EditHistory()
    history.add(FileEdit(path, lambda _: False))
    with pytest.raises(Gone, match=r"new\.h5 stays, for there is no trash .* delete it in the file manager"):
        history.undo()
    assert path.is_file()
    assert not history.can_undo


def test_a_file_that_was_changed_stays_and_one_in_use_waits(tmp_path: Path, trash: Path) -> None:
    path, used = tmp_path / "new.h5", [True]
    path.write_text("as written", encoding="utf-8")
    history = EditHistory()
    history.add(FileEdit(path, lambda _: used[0]))
    with pytest.raises(UserError, match="is open; close it"):
        history.undo()
    assert history.can_undo
    used[0] = False
    path.write_text("somebody's work", encoding="utf-8")
    with pytest.raises(Gone, match="was changed or moved since"):
        history.undo()
    assert path.read_text(encoding="utf-8") == "somebody's work"
    assert not history.can_undo


def test_nothing_is_brought_back_over_another_file(tmp_path: Path, trash: Path) -> None:
    path = tmp_path / "new.h5"
    path.write_text("first", encoding="utf-8")
    history = EditHistory()
    history.add(FileEdit(path, lambda _: False))
    assert history.undo() == "new file new.h5"
    path.write_text("second", encoding="utf-8")
    with pytest.raises(UserError, match="is there already"):
        history.redo()
    path.unlink()
    (trash / "new.h5").unlink()
    with pytest.raises(Gone, match="not in the trash any more"):
        history.redo()
    assert not history.can_redo

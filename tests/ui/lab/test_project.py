"""Work that is kept: closed, opened again, tried models, notes, a saved model; by real keys and clicks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QListWidget, QPlainTextEdit, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.models.file import SavedModel, project_path, save_model
from fingerlab.ui.app.window import MainWindow

from ..hands import PATIENCE, child, click, invented_diagnosis, lab_of, wait_for_result

LEFT = Qt.MouseButton.LeftButton
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def begin(qtbot: QtBot, make_window: Any, path: Path) -> MainWindow:
    """A window with the session open and compared."""
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    window.context.open_paths([path])
    wait_for_result(qtbot, window)
    return window


def added(window: MainWindow) -> tuple[str, ...]:
    history = lab_of(window).controller.history
    assert history is not None
    return history.now.added


def test_closing_loses_nothing_and_undo_works_after_the_next_start(
    qtbot: QtBot, make_window: Any, session_file: Path
) -> None:
    window = begin(qtbot, make_window, session_file)
    place = project_path([session_file])
    assert not place.exists()  # who only looks leaves nothing behind
    click(window, "addToModel")
    qtbot.waitUntil(lambda: added(window) == ("coulomb_friction",), timeout=PATIENCE)
    view = lab_of(window).view
    view.bar.go_to("pip", "002")
    view.plot.top.setXRange(1.0, 2.5, padding=0)
    shown = view.looked_at
    lab_of(window).show_notes()
    notes = window.findChild(QPlainTextEdit, "notesText")
    assert notes is not None
    QTest.keyClicks(notes, "Clamped anew.")
    window.close()

    again = begin(qtbot, make_window, session_file)
    assert added(again) == ("coulomb_friction",)
    assert lab_of(again).view.looked_at == shown
    project = lab_of(again).controller.project
    assert project is not None
    assert project.notes == "Clamped anew."
    assert [model.score for model in project.path] == [12.4, 1.1]
    assert "project.json" in again.context.log[-1]
    QTest.keyClick(again, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert added(again) == ()
    assert json.loads(place.read_text(encoding="utf-8"))["now"] == 0


def test_a_model_that_was_tried_can_be_shown_again(
    qtbot: QtBot, make_window: Any, session_file: Path
) -> None:
    window = begin(qtbot, make_window, session_file)
    click(window, "addToModel")
    qtbot.waitUntil(lambda: added(window) == ("coulomb_friction",), timeout=PATIENCE)
    lab_of(window).undo()
    lab_of(window).show_tried()
    models = child(window, QListWidget, "triedList")
    texts = [models.item(row).text() for row in range(models.count())]
    assert texts == ["1.10  nominal model with Coulomb joint friction", "12.4  nominal model (shown now)"]
    (button,) = [b for b in window.findChildren(QPushButton) if b.text() == "&Show it again"]
    QTest.mouseClick(button, LEFT)
    qtbot.waitUntil(lambda: added(window) == ("coulomb_friction",), timeout=PATIENCE)


def test_a_saved_model_opens_in_the_lab(
    qtbot: QtBot, make_window: Any, session_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = begin(qtbot, make_window, session_file)
    saved = tmp_path / "model.json"
    save_model(SavedModel("diagnosis", {}, (), ("coulomb_friction",)), saved)
    save_model(SavedModel("regions", {}, ()), tmp_path / "fit.json")
    asked = [str(tmp_path / "fit.json"), str(saved)]
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (asked.pop(0), "")))
    lab_of(window).open_model()
    assert "fit by regions" in window.context.log[-1]
    lab_of(window).open_model()
    qtbot.waitUntil(lambda: added(window) == ("coulomb_friction",), timeout=PATIENCE)
    assert lab_of(window).can_undo


def test_a_damaged_project_is_told_and_work_begins_anew(
    qtbot: QtBot, make_window: Any, session_file: Path
) -> None:
    place = project_path([session_file])
    place.write_text("{", encoding="utf-8")
    window = begin(qtbot, make_window, session_file)
    assert added(window) == ()
    assert any("no project that can be read" in line for line in window.context.log)
    assert place.with_name(place.name + ".damaged1").exists()

"""The first page: what the program is for, and the ways from it, by real clicks and drops."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from fingerlab.twin.effects import parse_effects
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab import practice
from fingerlab.ui.sessions.import_dialog import ImportDialog

from ..hands import PATIENCE, click, drop, invented_diagnosis, lab_of, lab_with, wait_for_result


@pytest.fixture
def first(make_window: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MainWindow:
    """The window as it is at the very first start."""
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
    monkeypatch.setattr(Settings, "tab", lambda self: "")  # nothing was in front before
    window: MainWindow = make_window(tabs=lab_with(invented_diagnosis))
    return window


def test_it_says_what_the_program_is_for_and_leads_to_a_rig(first: MainWindow) -> None:
    said = " ".join(label.text() for label in first.findChildren(QLabel) if label.isVisible())
    cards = ("With recordings", "With a rig", "With neither")
    for words in ("Which physical effect is your model missing?", "drives", "records", *cards):
        assert words in said
    click(first, "emptyConnect")
    assert first.current == "acquire"


def test_an_example_that_was_recorded_before_opens_at_a_click(
    qtbot: QtBot, first: MainWindow, session_file: Path, tmp_path: Path
) -> None:
    (tmp_path / "practice").mkdir()
    shutil.copy(session_file, tmp_path / "practice" / "example-joint-friction.h5")
    click(first, "example_joint-friction")
    wait_for_result(qtbot, first)
    assert lab_of(first).controller.sessions[0].path.name == "example-joint-friction.h5"
    assert all(parse_effects(effects).keys() == set(effects) for _, effects in practice.EXAMPLES.values())


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_a_text_file_dropped_on_it_begins_its_import(
    qtbot: QtBot, first: MainWindow, tmp_path: Path, settings: Settings
) -> None:
    (tmp_path / "library").mkdir()
    settings.set_library(tmp_path / "library")
    table = tmp_path / "axis.csv"
    table.write_text(
        "time,angle,torque\n" + "\n".join(f"{k / 100},{k},{k}" for k in range(50)), encoding="utf-8"
    )
    drop(first, table)
    qtbot.waitUntil(lambda: first.findChild(ImportDialog) is not None, timeout=PATIENCE)
    dialog = first.findChild(ImportDialog)
    assert dialog is not None
    assert dialog.isVisible()
    assert first.current == "sessions"
    dialog.reject()

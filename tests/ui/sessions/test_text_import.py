"""Text files of the bench in Sessions: dropped or chosen, looked at, and written as one session."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QFileDialog, QLineEdit, QPlainTextEdit, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.sessions import open_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.sessions.session_files import ImportDialog
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from ..hands import LEFT, PATIENCE, child, click, drop
from ..looking import look

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")  # of dialogs, off screen
HEADER = "time (s);command (deg);position (deg);torque (mNm);MCP (deg);PIP (deg);force (N)"


@pytest.fixture
def texts(tmp_path: Path) -> list[Path]:
    """Two runs of three seconds as a bench writes them in a country of decimal commas."""
    time = np.arange(3000) / 1000
    rows = np.stack([time, 10 * time, 9 * time, 40 + time, -5 * time, -7 * time, 0.1 * time], axis=1)
    lines = [";".join(f"{value:.5f}".replace(".", ",") for value in row) for row in rows]
    files = [tmp_path / "first.txt", tmp_path / "second.txt"]
    for path in files:
        path.write_text("\n".join([HEADER, *lines]), encoding="utf-8")
    return files


@pytest.fixture
def browsing(make_window: Callable[..., MainWindow], tmp_path: Path) -> MainWindow:
    (tmp_path / "library").mkdir()
    window = make_window(tab="sessions")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(tmp_path / "library")
    return window


def dialog_of(window: MainWindow) -> ImportDialog:
    found: ImportDialog = child(window, ImportDialog, "")
    assert found.isVisible()
    return found


def test_dropped_text_files_become_a_session(
    browsing: MainWindow, texts: list[Path], tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    drop(browsing, *texts)
    dialog = dialog_of(browsing)
    look(browsing)
    seen = child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert "motor_torque <- column 4 [mNm], times 0.001 to N m" in seen
    phase, cable = (child(dialog, QComboBox, name) for name in ("importPhase1", "importCable1"))
    phase.setCurrentIndex(phase.findData("contact"))
    cable.setCurrentIndex(cable.findData("flexion"))
    target = tmp_path / "library" / "old.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    QTest.mouseClick(child(dialog, QPushButton, "importWrite"), LEFT)
    tab = browsing.tab("sessions")
    assert isinstance(tab, SessionsTab)
    qtbot.waitUntil(lambda: tab.page.paths() == [target], timeout=PATIENCE)
    first, second = open_session(target).runs
    assert (first.phase, first.cable, second.phase, second.cable) == (
        "on_air", "extension", "contact", "flexion",
    )  # fmt: skip
    assert second.channel("motor_position")[-1] == pytest.approx(np.radians(9 * 2.999), rel=1e-4)
    assert second.channel("motor_torque")[0] == pytest.approx(0.040, rel=1e-4)
    assert tab.can_undo  # like every new file, into the trash


def test_what_cannot_be_imported_says_so_in_the_words_of_the_window(
    browsing: MainWindow, texts: list[Path], qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = ([str(texts[0])], "")
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", staticmethod(lambda *_, **__: chosen))
    click(browsing, "importText")
    dialog = dialog_of(browsing)
    write = child(dialog, QPushButton, "importWrite")
    assert write.isEnabled()
    QTest.keyClicks(child(dialog, QLineEdit, "importColumns"), "time=1,motor_command=2:deg")
    qtbot.waitUntil(lambda: not write.isEnabled(), timeout=PATIENCE)
    seen = child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert "gives no 'motor_position'" in seen
    assert "'Columns'" in seen
    assert "--" not in seen
    dialog.reject()


def test_a_text_that_is_no_table_cannot_be_written(browsing: MainWindow, tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("the cable was new\n", encoding="utf-8")
    drop(browsing, notes)
    dialog = dialog_of(browsing)
    assert "notes.txt" in child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert not child(dialog, QPushButton, "importWrite").isEnabled()
    dialog.reject()

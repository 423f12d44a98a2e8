"""Starting the application: what it loads, what it opens, how it ends."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from fingerlab.cli import main
from fingerlab.ui.app import application, window
from fingerlab.ui.app import tab_registry as registry
from fingerlab.ui.app.context import Settings

from ..hands import invented_diagnosis, lab_of, lab_with

HEAVY = ("scipy", "numba", "matplotlib", "pandas", "pyarrow")


def test_the_window_opens_without_waiting_for_the_heavy_libraries() -> None:
    code = f"import sys, fingerlab.ui.app.application; print([m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_session_named_on_the_command_line_is_opened_and_closing_ends_the_program(
    qapp: QApplication,
    settings: Settings,
    session_file: Path,
    monkeypatch,  # type: ignore[no-untyped-def]
) -> None:
    monkeypatch.setattr(registry, "TABS", lab_with(invented_diagnosis))
    seen: list[str] = []

    def look() -> None:
        for top in QApplication.topLevelWidgets():
            if isinstance(top, window.MainWindow) and lab_of(top).controller.history is not None:
                seen.append(top.windowTitle())
                top.close()

    timer = QTimer()
    timer.timeout.connect(look)
    timer.start(20)
    QTimer.singleShot(20_000, qapp.quit)
    try:
        assert application.run([str(session_file)], settings) == 0
    finally:
        timer.stop()
    assert set(seen) == {"invented.h5 – FingerLab"}
    assert settings.recent() == [session_file.resolve()]


def test_a_file_in_place_of_a_command_opens_the_window_with_it(
    session_file: Path,
    monkeypatch,  # type: ignore[no-untyped-def]
) -> None:
    opened: list[list[str]] = []
    monkeypatch.setattr(application, "run", lambda arguments: opened.append(arguments) or 0)
    for arguments in ([str(session_file)], [str(session_file)] * 2, []):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 0
        assert opened.pop() == arguments

"""From the command to a window that can be used, and from one tab to another."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtWidgets import QApplication

from benchmarks.machine import Share, Watch
from fingerlab.ui.acquire.acquire_tab import AcquireTab
from fingerlab.ui.app.tab_registry import TABS
from fingerlab.ui.app.window import MainWindow

STARTS = 3
ROUNDS = 10

PROGRAM = """
import sys, time
from PySide6.QtCore import QSettings, QTimer
from PySide6.QtWidgets import QApplication
from fingerlab.ui.app import application
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow

app = QApplication(sys.argv[:1])
settings = Settings(QSettings(sys.argv[1], QSettings.Format.IniFormat))
settings.set_tab(sys.argv[2])
application.prepare(app, settings)
window = MainWindow(settings)
window.resize(1280, 800)
window.show()
QTimer.singleShot(0, lambda: (window.grab(), print("usable", flush=True), window.close(), app.quit()))
app.exec()
"""


@dataclass
class Started:
    """Seconds: the first start with nothing compiled, those after it by the tab shown; switches in ms.

    Attributes:
        switches: tab -> first time it is shown, and each time after that.
    """

    cold: float = 0.0
    warm: dict[str, list[float]] = field(default_factory=dict)
    switches: dict[str, list[float]] = field(default_factory=dict)
    share: Share | None = None


def start_times(folder: Path) -> Started:
    """Start the window again and again in a process of its own, until it answers.

    Cold is without compiled modules (their folder is empty); the files themselves may be in memory.
    """
    watch, found = Watch(), Started()
    caches = {"PYTHONPYCACHEPREFIX": str(folder / "compiled")}
    found.cold = _start(folder, "model_lab", caches)
    for tab in ("model_lab", "acquire", "sessions"):
        _start(folder, tab, caches)
        found.warm[tab] = [_start(folder, tab, caches) for _ in range(STARTS)]
        watch.look()
    found.share = watch.share()
    return found


def _start(folder: Path, tab: str, caches: dict[str, str]) -> float:
    """Seconds from the command until the first picture is painted and events are answered."""
    words = [sys.executable, "-c", PROGRAM, str(folder / "start.ini"), tab]
    environment = {**os.environ, **caches, "QT_QPA_PLATFORM": "offscreen"}
    started = time.perf_counter()
    with subprocess.Popen(words, stdout=subprocess.PIPE, env=environment, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        seconds = time.perf_counter() - started
        if line.strip() != "usable":
            raise SystemExit(f"The window did not start: {line!r}")
        process.stdout.read()
    return seconds


def switch_times(window: MainWindow, app: QApplication) -> dict[str, list[float]]:
    """Milliseconds until another tab is painted: the first time, when it is built, and later ones.

    Acquire looks for devices when it is first shown, in a thread that shares the interpreter: the later ones
    are taken when it has found them.
    """
    times: dict[str, list[float]] = {entry.key: [] for entry in TABS}
    for number in range(ROUNDS + 1):
        while number and _looks_for_devices(window):
            app.processEvents()
            time.sleep(0.01)
        for entry in TABS:
            started = time.perf_counter()
            window.show_tab(entry.key)
            app.processEvents()
            times[entry.key].append(1e3 * (time.perf_counter() - started))
    return times


def _looks_for_devices(window: MainWindow) -> bool:
    acquire = window.tab("acquire")
    assert isinstance(acquire, AcquireTab)
    return acquire.controller.worker.busy

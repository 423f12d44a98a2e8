"""The window in tests: off screen, with settings and folders of its own."""

from __future__ import annotations

import os

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QSettings, Qt, QThread
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.check_rig.walk import KeptCheck
from fingerlab.devices.choosing import detect
from fingerlab.devices.faults import Faults
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.ui.acquire import acquire_tab
from fingerlab.ui.acquire.bench_setup import open_bench
from fingerlab.ui.app import application
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow

from .bench_hands import Rig, opener, tabs_with
from .hands import invented_diagnosis, lab_with, wait_for_result

WindowMaker = Callable[..., MainWindow]


@pytest.fixture(scope="session")
def qapp_args() -> list[str]:
    return ["fingerlab"]


@pytest.fixture(scope="session", autouse=True)
def prepared(qapp: QApplication, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Style and colours, once: applying them again costs more than most tests."""
    store = QSettings(str(tmp_path_factory.mktemp("settings") / "none.ini"), QSettings.Format.IniFormat)
    application.prepare(qapp, Settings(store))


@pytest.fixture
def larger_letters(qapp: QApplication) -> Iterator[None]:
    """Letters 1.5 times as large, as a desktop may be set; for windows that are made after it."""
    usual, larger = qapp.font(), qapp.font()
    larger.setPointSizeF(1.5 * usual.pointSizeF())
    qapp.setFont(larger)
    yield
    qapp.setFont(usual)


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat))


@pytest.fixture
def make_window(qtbot: QtBot, qapp: QApplication, settings: Settings) -> Iterator[WindowMaker]:
    """Builds windows; afterwards each is closed as a person closes it, and no thread may be left."""
    windows: list[MainWindow] = []

    def make(
        tab: str = "model_lab", diagnose: Callable[..., Diagnosis] | None = None, **options: object
    ) -> MainWindow:
        settings.set_tab(tab)
        if diagnose is not None:
            options["tabs"] = lab_with(diagnose)
        window = MainWindow(settings, **options)  # type: ignore[arg-type]
        window.resize(1280, 760)
        window.show()
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow)
        windows.append(window)
        return window

    yield make
    for window in windows:
        window.close()
        assert not window.findChildren(QThread) or not any(
            thread.isRunning() for thread in window.findChildren(QThread)
        )
        window.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


@pytest.fixture
def session_file(make_session: Callable[..., Path]) -> Path:
    """A small session of three runs, for the diagnoses of ``invented.py``."""
    return make_session("invented.h5", phases=(("on_air", "extension"),) * 3)


@pytest.fixture
def opened(qtbot: QtBot, make_window, session_file: Path, monkeypatch: pytest.MonkeyPatch) -> MainWindow:  # type: ignore[no-untyped-def]
    """A window in which a session was opened through the dialog."""
    window = make_window(diagnose=invented_diagnosis)
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", staticmethod(lambda *_: ([str(session_file)], "")))
    QTest.keyClick(window, Qt.Key.Key_O, Qt.KeyboardModifier.ControlModifier)
    wait_for_result(qtbot, window)
    return window


@pytest.fixture
def connect_rig(monkeypatch, make_window, settings: Settings, qtbot: QtBot, tmp_path: Path):  # type: ignore[no-untyped-def]
    """Connects the simulated rig on a virtual clock, with faults if wanted.

    At the end a person agrees to stop and close, for which ``monkeypatch`` comes first and is taken back
    last; tests of the question put their own answer there.
    """

    def make(faults: Faults | None = None) -> Rig:
        monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)
        settings.set_recordings(tmp_path / "recordings")
        return Rig(make_window(tab="acquire", tabs=tabs_with(opener(tmp_path / "rescue", faults))), qtbot)

    return make


@pytest.fixture
def unconnected(monkeypatch, make_window, settings: Settings, qtbot: QtBot, tmp_path: Path):  # type: ignore[no-untyped-def]
    """A window without a rig that opens benches as in life, but in its own process.

    Made of ``build``, a device choice -> its device; ``find``, what is looked for; and ``checked``: every rig
    counts as checked, or its current were a tenth. What is kept for the user lies below ``tmp_path``.
    """

    def make(build: Callable[[Any], Any], find: Any = lambda rig_file: detect(), checked: bool = True) -> Rig:
        monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)
        monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
        if checked:
            kept = "fingerlab.acquisition.check_rig.walk.last_check"
            monkeypatch.setattr(kept, lambda *_: KeptCheck("2026-11-23T08:00:00"))
        settings.set_recordings(tmp_path / "recordings")

        def inline(choice: Any, loop: Any, rate_hz: float) -> InlineBench:
            return InlineBench(build(choice), loop, tmp_path / "rescue")

        tabs = tabs_with(lambda wanted: open_bench(wanted, inline), find)
        return Rig(make_window(tab="acquire", tabs=tabs), qtbot, connect=False)

    return make


@pytest.fixture
def rig(connect_rig) -> Rig:  # type: ignore[no-untyped-def]
    """The simulated rig, connected."""
    made: Rig = connect_rig()
    return made

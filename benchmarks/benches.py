"""What the measurements share: the simulated rig with loop and recorder, a window, results kept by line."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from fingerlab.acquisition.bench.process_bench import InlineBench, ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.devices.choosing import DeviceChoice
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.simulated import SimulatedBench, SimulatedRig, Simulation
from fingerlab.rig.file import Rig, default_rig

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from fingerlab.ui.app.window import MainWindow

SIZE = (1280, 800)
PATIENCE_S = 1e5
"""Seconds of rig time that the watchdogs wait where these pass in moments."""

Result = TypeVar("Result")


def turned_by_hand(rescue: Path) -> tuple[InlineBench, Rig]:
    """The simulated rig on a virtual clock, all in this process, and its rig."""
    device = SimulatedRig()
    settings = LoopSettings(BenchUnits.from_rig(device.rig), device.rig.limits)
    return InlineBench(device, settings, rescue), device.rig


def on_the_card(rescue: Path) -> tuple[InlineBench, Rig]:
    """The simulated finger at the virtual card, driven by the real nidaqmx package, all in this process."""
    from tests.devices.virtual_card import Card, InProcessChannel, Servicer

    rig = default_rig()
    card = Card(SimulatedBench(Simulation(phase="contact"), rig.daq))
    card.history = deque(maxlen=1)  # type: ignore[assignment]  # hours of it would be the memory that is measured
    device = NiCard(rig, card.clock, InProcessChannel(Servicer(card)))
    return InlineBench(device, LoopSettings(BenchUnits.from_rig(rig), rig.limits), rescue), rig


def in_processes(rescue: Path, real_time: bool = True) -> tuple[ProcessBench, Rig]:
    """The simulated rig with loop and recorder in processes of their own, and its rig.

    Args:
        real_time: by the machine's clock; else as fast as it goes, with watchdogs that wait longer.
    """
    rig = SimulatedRig().rig
    limits = rig.limits
    if not real_time:
        limits = replace(limits, window_time=PATIENCE_S, recorder_time=PATIENCE_S)
    settings = LoopSettings(BenchUnits.from_rig(rig), limits)
    return ProcessBench(DeviceChoice("simulated", real_time=real_time), settings, rescue), rig


@contextmanager
def shown_window(folder: Path, tab: str) -> Iterator[tuple[MainWindow, QApplication]]:
    """The application's window off screen, with settings and sessions of its own in ``folder``."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    from PySide6.QtCore import QSettings
    from PySide6.QtWidgets import QApplication

    from fingerlab.ui.app import application
    from fingerlab.ui.app.context import Settings
    from fingerlab.ui.app.window import MainWindow

    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    settings = Settings(QSettings(str(folder / "settings.ini"), QSettings.Format.IniFormat))
    settings.set_tab(tab)
    settings.set_library(folder)
    settings.set_recordings(folder)
    application.prepare(app, settings)
    window = MainWindow(settings)
    window.resize(*SIZE)
    window.show()
    app.processEvents()
    try:
        yield window, app
    finally:
        window.close()


def keep_option(parser: argparse.ArgumentParser) -> None:
    """The option that adds a result to earlier ones."""
    parser.add_argument("--keep", type=Path, help="JSON lines of results: added to, and shown as a whole")


def kept(result: Result, path: Path | None) -> list[Result]:
    """The result after those kept in a file, to which it is added; alone where there is none."""
    if path is None:
        return [result]
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(result)) + "\n")  # type: ignore[call-overload]
    lines: list[dict[str, Any]] = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [type(result)(**line) for line in lines]

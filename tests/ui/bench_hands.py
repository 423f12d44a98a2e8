"""Hands at the simulated rig on a virtual clock: the window's own buttons, and time that passes when told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.devices.faults import Faults
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.ui.acquire.acquire_tab import AcquireTab
from fingerlab.ui.acquire.bench_setup import BenchRequest, FindCall, OpenBench, OpenCall, find_devices
from fingerlab.ui.app.tab_registry import TABS, TabEntry
from fingerlab.ui.app.window import MainWindow

from .hands import LEFT, child

PATIENCE = 60_000
"""The twin compiles its integrator at its first use."""


def opener(rescue: Path, faults: Faults | None = None, simulation: Simulation | None = None) -> OpenCall:
    """Opens the simulated rig on a virtual clock; with faults, or as another bench, if wanted."""

    def make(wanted: BenchRequest) -> OpenBench:
        device = SimulatedRig(simulation=simulation or Simulation(seed=wanted.seed), faults=faults)
        settings = LoopSettings(BenchUnits.from_rig(device.rig), device.rig.limits)
        return OpenBench(InlineBench(device, settings, rescue), device.rig, dict(device.session_attributes))

    return make


def tabs_with(make: OpenCall, find: FindCall = find_devices) -> tuple[TabEntry, ...]:
    """The window's tabs, with another way to open a bench and to look for devices."""
    return tuple(
        replace(entry, make=lambda context: AcquireTab(context, make, find))
        if entry.key == "acquire"
        else entry
        for entry in TABS
    )


class Rig:
    """A window with a rig on a virtual clock, whose time passes only in :meth:`run`.

    Args:
        connect: whether the simulated rig is connected at once.
    """

    def __init__(self, window: MainWindow, qtbot: QtBot, connect: bool = True) -> None:
        self.window, self._qtbot = window, qtbot
        tab = window.tab("acquire")
        assert isinstance(tab, AcquireTab)
        self.tab = tab
        self.controller, self.recording = tab.controller, tab.recording
        self.wait_idle()  # the card is looked for first; whatever this machine has must not matter
        if connect:
            self.connect("connectSimulated")

    def wait_idle(self) -> None:
        """Wait until nothing is being asked of a bench."""
        self._qtbot.waitUntil(lambda: not self.controller.worker.busy, timeout=PATIENCE)

    def connect(self, name: str) -> None:
        """Click one of the buttons that connect a rig; from then on time stands still but in :meth:`run`."""
        self.click(name)
        self._qtbot.waitUntil(lambda: self.controller.bench is not None, timeout=PATIENCE)
        self.controller._timer.stop()
        self.run(0.2)

    def choose(self, name: str, key: str) -> None:
        """Choose an entry of a list, as by a click on it."""
        field = child(self.window, QComboBox, name)
        assert field.findData(key) >= 0, key
        field.setCurrentIndex(field.findData(key))
        field.activated.emit(field.currentIndex())

    def write(self) -> Path:
        """Write what was recorded and wait for the file."""
        before = set(self.files())
        self.click("write")
        self._qtbot.waitUntil(lambda: len(self.files()) > len(before), timeout=PATIENCE)
        self.wait_idle()
        (new,) = set(self.files()) - before
        return new

    @property
    def bench(self) -> InlineBench:
        bench = self.controller.bench
        assert isinstance(bench, InlineBench)
        return bench

    @property
    def mode(self) -> Mode:
        return self.bench.status().mode

    def run(self, seconds: float) -> None:
        """Time passes on the bench; the window looks as often as it does in life."""
        for _ in range(max(round(seconds / 0.033), 1)):
            self.controller.tick()

    def click(self, name: str) -> None:
        """Click a button of the window."""
        button = child(self.window, QPushButton, name)
        assert button.isVisible(), name
        assert button.isEnabled(), f"{name}: {button.toolTip()}"
        QTest.mouseClick(button, LEFT)

    def key(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        """Press a key in the window."""
        QTest.keyClick(self.window, key, modifier)

    def button(self, name: str) -> QPushButton:
        """One of the buttons."""
        found: QPushButton = child(self.window, QPushButton, name)
        return found

    def label(self, name: str) -> str:
        """What a label says."""
        text: str = child(self.window, QLabel, name).text()
        return text

    def enable(self) -> None:
        """Initialise and enable, by the buttons."""
        self.click("initialise")
        self.run(0.1)
        self.click("enable")
        self.run(0.1)
        assert self.mode is Mode.ENABLED

    def start(self) -> None:
        """Enable and start the motion that is set."""
        self.enable()
        self.click("start")
        self.run(0.1)
        assert self.mode is Mode.RUNNING

    def settle(self) -> None:
        """After a stop the pulley turns on; a person hangs the cable anew, and everything is at rest."""
        field = child(self.window, QComboBox, "phase")
        field.activated.emit(field.currentIndex())
        self.run(0.5)

    def files(self) -> list[Path]:
        """Session files in the folder for recordings."""
        return sorted(self.recording.details.folder.glob("*.h5"))

"""What the live plots cost: time of a repaint, and share of a core of the window's process.

    python benchmarks/window_repaint.py

The Acquire tab is shown off screen at 1280 x 800 with six plots (model beside the measurement), 60 s of
samples at 1 kHz in each. First each repaint is timed by itself, on a virtual clock; then the simulated rig
runs in processes of its own in real time and the window follows it at 30 repaints a second. Writes
docs/benchmarks-window.md.
"""

from __future__ import annotations

import os
import platform
import statistics
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import numpy as np
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from fingerlab.acquisition.inline import InlineBench
from fingerlab.acquisition.requests import LoopSettings
from fingerlab.acquisition.safety import Limits
from fingerlab.acquisition.units import BenchUnits
from fingerlab.devices.simulated import SimulatedRig
from fingerlab.ui import application
from fingerlab.ui.acquire.opening import OpenBench, Wanted, open_bench
from fingerlab.ui.acquire.tab import AcquireTab
from fingerlab.ui.settings import Settings
from fingerlab.ui.window import MainWindow

ROOT = Path(__file__).resolve().parent.parent
SIZE = (1280, 800)
WINDOW_S = 60.0
FRAMES = 600
REAL_S = 30.0
REPAINT_GOAL_MS = 33.0
CPU_GOAL = 40.0


def on_virtual_clock(wanted: Wanted) -> OpenBench:
    """The simulated rig, turned by hand."""
    device = SimulatedRig()
    settings = LoopSettings(BenchUnits.from_rig(device.rig), Limits.from_rig(device.rig))
    rescue = Path(tempfile.gettempdir()) / "fingerlab-rescued"
    return OpenBench(InlineBench(device, settings, rescue), device.rig, {})


def pause(seconds: float) -> None:
    """Let the window work."""
    loop = QEventLoop()
    QTimer.singleShot(round(1000 * seconds), loop.quit)
    loop.exec()


def connect(tab: AcquireTab) -> None:
    """Connect the simulated rig and let it move, with the model beside it."""
    tab.station.open(Wanted("simulated"))
    while tab.station.bench is None:
        pause(0.05)
    pause(0.3)
    for button in (tab.panel.initialise, tab.panel.enable, tab.panel.start):
        while tab.station.caller.busy:
            pause(0.02)
        tab.panel.refresh()
        button.click()
        pause(0.2)
    tab.toolbar.model_chosen.emit("nominal")
    tab.plots.show_model(True, True)
    tab.plots.set_window(WINDOW_S)


def repaint_times(window: MainWindow, app: QApplication) -> list[float]:
    """Milliseconds of each repaint, samples already taken."""
    tab = window.tab("acquire")
    assert isinstance(tab, AcquireTab)
    tab.station._opener = on_virtual_clock
    connect(tab)
    tab.station._timer.stop()
    bench = tab.station.bench
    assert isinstance(bench, InlineBench)
    for _ in range(round(WINDOW_S)):
        bench.step(1000)
        tab.station.tick()
    app.processEvents()
    times = []
    for _ in range(FRAMES):
        bench.step(33)
        tab.station.ticked.disconnect(tab._on_tick)
        tab.station.tick()
        tab.station.ticked.connect(tab._on_tick)
        started = time.perf_counter()
        tab._on_tick()
        app.processEvents()
        times.append(1e3 * (time.perf_counter() - started))
    tab.station.close()
    pause(0.2)
    return times


def processor_share(window: MainWindow) -> tuple[float, float]:
    """Per cent of a core that the window's process takes, and repaints a second, in real time."""
    tab = window.tab("acquire")
    assert isinstance(tab, AcquireTab)
    tab.station._opener = open_bench
    connect(tab)
    pause(WINDOW_S / 2)
    frames = 0

    def count() -> None:
        nonlocal frames
        frames += 1

    tab.station.ticked.connect(count)
    wall, processor = time.perf_counter(), time.process_time()
    pause(REAL_S)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    tab.station.stop()
    return 100 * processor / wall, frames / wall


def page(times: list[float], share: float, rate: float, load: float) -> str:
    """The measurements as Markdown."""
    p50, p99 = statistics.median(times), float(np.percentile(times, 99))
    machine = f"{os.cpu_count()} cores ({platform.system()} {platform.machine()})"
    return "\n".join(
        [
            "# Benchmarks of the window",
            "",
            f"Made with `python benchmarks/window_repaint.py` on {machine}, Python "
            f"{platform.python_version()}; load average {load:.1f} before.",
            f"Six live plots of {WINDOW_S:g} s at 1 kHz, window of {SIZE[0]} x {SIZE[1]}, off screen.",
            "",
            "| what | measured | goal |",
            "|---|---|---|",
            f"| repaint, p50 | {p50:.1f} ms | |",
            f"| repaint, p99 | {p99:.1f} ms | under {REPAINT_GOAL_MS:g} ms |",
            f"| repaint, longest of {len(times)} | {max(times):.1f} ms | |",
            f"| window's process at {rate:.1f} repaints a second | {share:.0f} % of a core | "
            f"under {CPU_GOAL:g} % |",
            "",
        ]
    )


def main() -> None:
    """Measure and write the page."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    app = QApplication(sys.argv[:1])
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(QSettings(f"{folder}/settings.ini", QSettings.Format.IniFormat))
        settings.set_tab("acquire")
        application.prepare(app, settings)
        window = MainWindow(settings)
        window.resize(*SIZE)
        window.show()
        pause(1.0)
        times = repaint_times(window, app)
        share, rate = processor_share(window)
        window.tab("acquire").shut_down()
        window.close()
    text = page(times, share, rate, load)
    print(text)
    (ROOT / "docs" / "benchmarks-window.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

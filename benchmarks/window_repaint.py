"""What the live plots cost: time of a repaint, and share of a core of the window's process.

The Acquire tab is shown with six plots (model beside the measurement), 60 s of samples at 1 kHz in each.
First each repaint is timed by itself, on a virtual clock; then the simulated rig runs in processes of its own
in real time and the window follows it at 30 repaints a second.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtCore import QEventLoop, QTimer
from PySide6.QtWidgets import QApplication

from benchmarks.benches import turned_by_hand
from benchmarks.machine import Frame, Share, Watch, timed
from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.ui.acquire.acquire_tab import AcquireTab
from fingerlab.ui.acquire.bench_setup import BenchRequest, OpenBench, open_bench
from fingerlab.ui.app.window import MainWindow

WINDOW_S = 60.0
FRAMES = 600
REAL_S = 30.0


@dataclass
class Repainted:
    """Each repaint; per cent of a core and repaints a second in real time.

    Attributes:
        share, real_share: of the machine in either part.
    """

    times: list[Frame] = field(default_factory=list)
    processor: float = 0.0
    rate: float = 0.0
    share: Share | None = None
    real_share: Share | None = None


def repaint(window: MainWindow, app: QApplication) -> Repainted:
    """Both measurements."""
    found, watch = Repainted(), Watch()
    window.show_tab("acquire")
    found.times = repaint_times(window, app, watch)
    found.share = watch.share()
    watch = Watch()
    found.processor, found.rate = processor_share(window)
    found.real_share = watch.share()
    tab = window.tab("acquire")
    tab.controller.close()  # type: ignore[attr-defined]
    while tab.controller.worker.busy:  # type: ignore[attr-defined]
        pause(0.05)
    return found


def on_virtual_clock(wanted: BenchRequest) -> OpenBench:
    """The simulated rig, turned by hand."""
    return OpenBench(*turned_by_hand(Path(tempfile.gettempdir()) / "fingerlab-rescued"))


def pause(seconds: float) -> None:
    """Let the window work."""
    loop = QEventLoop()
    QTimer.singleShot(round(1000 * seconds), loop.quit)
    loop.exec()


def connect(tab: AcquireTab) -> None:
    """Connect the simulated rig and let it move, with the model beside it."""
    tab.controller.open(BenchRequest("simulated"))
    while tab.controller.bench is None:
        pause(0.05)
    pause(0.3)
    for button in (tab.panel.initialise, tab.panel.enable, tab.panel.start):
        while tab.controller.worker.busy:
            pause(0.02)
        tab.panel.refresh()
        button.click()
        pause(0.2)
    tab.toolbar.model_chosen.emit("nominal")
    tab.plots.show_model(True, True)
    tab.plots.set_window(WINDOW_S)


def repaint_times(window: MainWindow, app: QApplication, watch: Watch) -> list[Frame]:
    """What each repaint takes, samples already taken."""
    tab = window.tab("acquire")
    assert isinstance(tab, AcquireTab)
    tab.controller._opener = on_virtual_clock
    connect(tab)
    tab.controller._timer.stop()
    bench = tab.controller.bench
    assert isinstance(bench, InlineBench)
    for _ in range(round(WINDOW_S)):
        bench.step(1000)
        tab.controller.tick()
    app.processEvents()
    times: list[Frame] = []
    for number in range(FRAMES):
        if number % 100 == 0:
            watch.look()
        bench.step(33)
        tab.controller.ticked.disconnect(tab._on_tick)
        tab.controller.tick()
        tab.controller.ticked.connect(tab._on_tick)
        with timed(times):
            tab._on_tick()
            app.processEvents()
    tab.controller.close()
    pause(0.2)
    return times


def processor_share(window: MainWindow) -> tuple[float, float]:
    """Per cent of a core that the window's process takes, and repaints a second, in real time."""
    tab = window.tab("acquire")
    assert isinstance(tab, AcquireTab)
    tab.controller._opener = open_bench
    connect(tab)
    pause(WINDOW_S / 2)
    frames = 0

    def count() -> None:
        nonlocal frames
        frames += 1

    tab.controller.ticked.connect(count)
    wall, processor = time.perf_counter(), time.process_time()
    pause(REAL_S)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    tab.controller.stop()
    return 100 * processor / wall, frames / wall

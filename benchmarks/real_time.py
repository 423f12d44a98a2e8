"""How punctual the control loop is in real time while it records, and how much the recorder sustains.

    python -m benchmarks.real_time [--minutes 10] [--with-window] [--free-plots 2] [--driven] [--beside]
        [--keep FILE] [--page PAGE]

The simulated rig runs at 1 kHz by the machine's clock in the loop's own process, and the recorder writes
every sample to disk in another. With ``--with-window`` the application's window is open off screen on its
Acquire tab and draws six plots of 60 s, and as many free ones as are asked for: a loop, then spectra. With
``--beside`` another process takes a core meanwhile. Lateness is how long after its due time a cycle began;
a cycle that is a whole period late has lost those in between. The amplifier is off unless ``--driven`` is
given: the motor then follows a sine under the position loop and all safety checks, which stop it at the
first 20 ms that the machine holds the loop up. Such a stop is a result: it is counted, and the bench reset,
initialised and enabled anew as an operator would. Before each measurement a bare loop of waits, without
anything of FingerLab in it, tells what the machine itself can do, and meanwhile a process on each core, above
the loop, notes when that core stood still. Writes docs/benchmarks-real-time.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.benches import in_processes, keep_option, kept, shown_window
from benchmarks.machine import code_words, load_average, used
from benchmarks.real_time_page import Timed, page
from benchmarks.standstills import Standstills, watched
from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.control.machine import Enable, Initialise, Mode, Reset, SetUp, Start
from fingerlab.acquisition.recorder import Recorder
from fingerlab.acquisition.recording import RunInfo, SessionInfo
from fingerlab.acquisition.ring import COLUMN, COLUMNS, Ring, RowFlag
from fingerlab.acquisition.status import SharedStatus, Slot
from fingerlab.core.errors import UserError
from fingerlab.devices.simulated import SimulatedRig
from fingerlab.sessions import open_session

ROOT = Path(__file__).resolve().parent.parent
RATE_HZ = 1000.0
SINE = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0, "offset_deg": 22.0}
CREATED = "2026-01-01T00:00:00+00:00"
LATE_S = 0.5e-3
"""From here on a cycle counts as late, as in the window's status line."""
PIECES = (20, 200, 2000)
"""Samples that the recorder takes at a time: its 20 ms at 1, 10 and 100 kHz."""
PIECE_SECONDS = 5.0

REST_S = 2.0
"""After a stop the finger swings for so long before the sensors are set again (assumed)."""
TRIES = 60
LOOK_S, SEEN_S = 0.5, 0.2
"""The bench is looked at so often, and what it tells is seen so long afterwards at most (assumed)."""

Pause = Callable[[float], None]


class Watch:
    """Reads the ring beside recorder and window."""

    def __init__(self, bench: ProcessBench) -> None:
        self._reader = bench.ring.reader()
        self._pieces: list[np.ndarray[Any, Any]] = []
        self.lost = self.unread = self.running = 0
        self._last = -1

    def look(self) -> None:
        """Take what has come."""
        while True:
            piece = self._reader.read()
            if not len(piece.rows):
                return
            self.unread += piece.lost
            index = piece.rows[:, COLUMN["index"]].astype(int)
            before = self._last if self._last >= 0 else index[0] - 1
            gaps = np.diff(index, prepend=before) - 1
            # After a stop the device starts anew: the time that this takes is no cycle lost by the loop.
            held_up = piece.rows[:, COLUMN["flags"]].astype(int) & RowFlag.LOST_BEFORE
            self.lost += int(gaps[held_up != 0].sum())
            self._last = int(index[-1])
            self._pieces.append(piece.rows[:, COLUMN["lateness"]].copy())
            self.running += int(np.count_nonzero(piece.rows[:, COLUMN["run"]]))

    @property
    def lateness(self) -> np.ndarray[Any, Any]:
        """Seconds, of every cycle seen."""
        return np.concatenate(self._pieces)


def a_run(start: int) -> RunInfo:
    """A run that begins with a sample, and ends when it is told to."""
    return RunInfo("on_air", "extension", RATE_HZ, SINE, start)


class Drive:
    """Keeps the motor running: after a stop by the checks it begins again, as an operator would.

    Attributes:
        stops: the sentence of each. stopped_at: when it was seen, by ``time.monotonic``.
    """

    def __init__(self, bench: ProcessBench, pause: Pause) -> None:
        self._bench, self._pause = bench, pause
        self._faults = bench.status().faults
        self.stops: list[str] = []
        self.stopped_at: list[float] = []

    def start(self) -> None:
        """Enable, and go."""
        for command in (Initialise(), Enable(), Start(SINE, endless=True)):
            self._bench.ask(command)

    def look(self) -> None:
        """Begin again where it was stopped."""
        status = self._bench.status()
        if status.faults == self._faults:
            return
        self._faults = status.faults
        self.stops.append(status.fault)
        self.stopped_at.append(time.monotonic())
        print(status.fault, file=sys.stderr)
        if status.loop_ended:
            raise SystemExit(f"The loop has ended: {status.fault}")
        self._bench.ask(Reset())
        self._bench.ask(SetUp("on_air", "extension"))  # the pulley has run out: a person hangs the cable anew
        for _ in range(TRIES):
            self._pause(REST_S)
            try:
                self.start()
                if not self._bench.status().recording:  # the window ends a run where the bench is stopped
                    self._bench.recorder.begin(a_run(self._bench.board[Slot.INDEX] + 1))
                return
            except UserError as error:
                print(error, file=sys.stderr)
                if self._bench.status().mode is Mode.FAULT:
                    return  # stopped again already: the next look counts it
        raise SystemExit("The bench does not come to rest after a stop.")


def measure(
    bench: ProcessBench, rig: Any, folder: Path, asked: argparse.Namespace, pause: Pause, window: bool
) -> Timed:
    """Record for so many minutes and look at every cycle."""
    with watched() as standstills:
        timed, stopped_at = _recorded(bench, rig, folder, asked, pause, window)
    return with_standstills(timed, standstills, stopped_at)


def with_standstills(timed: Timed, standstills: Standstills, stopped_at: list[float]) -> Timed:
    """The measurement with what the machine itself did meanwhile."""
    if standstills.moments is None:
        return timed
    lengths = [1e3 * seconds for _, seconds in standstills.moments]
    stood = [standstills.in_the(LOOK_S + SEEN_S, moment) for moment in stopped_at]
    return replace(timed, stood_ms=lengths, stops_stood=sum(stood))


def _recorded(
    bench: ProcessBench, rig: Any, folder: Path, asked: argparse.Namespace, pause: Pause, window: bool
) -> tuple[Timed, list[float]]:
    path = folder / "real-time.h5"
    bench.recorder.open(SessionInfo(path, rig.to_json(), "real time", CREATED))
    for command in (SetUp("on_air", "extension"), Initialise()):
        bench.ask(command)
    load, bare = load_average(), bare_lateness()
    start = bench.board[Slot.INDEX] + 1
    bench.recorder.begin(a_run(start))
    watch, own, drive = Watch(bench), psutil.Process(), Drive(bench, pause)
    if asked.driven:
        with suppress(UserError):  # stopped at once: the first look tells why
            drive.start()
    before = psutil.cpu_times()
    spent = sum(own.cpu_times()[:2])
    began, end = time.monotonic(), time.monotonic() + 60.0 * asked.minutes
    while time.monotonic() < end:
        pause(LOOK_S)
        watch.look()
        status = bench.status()
        if status.recorder or (status.fault and not asked.driven):
            raise SystemExit(f"The bench stopped: {status.fault or status.recorder}")
        if asked.driven:
            drive.look()
    share = (sum(own.cpu_times()[:2]) - spent) / (time.monotonic() - began)
    busy, stolen = used(before, psutil.cpu_times())
    if bench.status().recording:
        bench.recorder.end()
    if asked.driven:
        bench.stop()
    watch.look()
    unread = bench.status().unread + watch.unread
    bench.recorder.close()
    ms = 1e3 * watch.lateness
    recorded = sum(run.length for run in open_session(path).runs)
    timed = Timed(
        window,
        asked.minutes,
        len(ms),
        [float(np.percentile(ms, share)) for share in (50.0, 99.0, 99.9, 100.0)],
        int((ms > 1e3 * LATE_S).sum()),
        watch.lost,
        unread,
        recorded,
        load,
        load_average(),
        busy,
        stolen,
        100.0 * share,
        bare,
        asked.driven,
        watch.running / len(ms),
        drive.stops,
        scheduling(bench.board[Slot.LOOP_PID]),
        asked.free_plots if window else 0,
        asked.beside,
        code_words(),
    )
    return timed, drive.stopped_at


def bare_lateness(seconds: float = 10.0) -> list[float]:
    """Lateness in ms, at the same percentiles, of a loop that only waits a millisecond at a time."""
    late = []
    due = end = time.perf_counter()
    end += seconds
    while due < end:
        due += 1.0 / RATE_HZ
        early = due - time.perf_counter()
        if early > 0:
            time.sleep(early)
        behind = max(time.perf_counter() - due, 0.0)
        late.append(1e3 * behind)
        due += behind if behind * RATE_HZ > 1.0 else 0.0
    return [float(np.percentile(late, share)) for share in (50.0, 99.0, 99.9, 100.0)]


def scheduling(process: int) -> str:
    """What the system granted a process that asked to come first."""
    if hasattr(os, "sched_getscheduler"):
        if os.sched_getscheduler(process) == os.SCHED_RR:
            return "real time"
        return "before others" if os.getpriority(os.PRIO_PROCESS, process) < 0 else "as others"
    return "as the system does"


def without_window(folder: Path, asked: argparse.Namespace) -> Timed:
    """Only this process beside loop and recorder; it shows that it is alive, as a window does."""
    bench, rig = in_processes(folder / "rescued")

    def pause(seconds: float) -> None:
        for _ in range(round(30 * seconds)):
            bench.beat()
            time.sleep(1 / 30)

    try:
        return measure(bench, rig, folder, asked, pause, False)
    finally:
        bench.close()


def with_window(folder: Path, asked: argparse.Namespace) -> Timed:
    """The window draws meanwhile."""
    from benchmarks.window_repaint import WINDOW_S, pause
    from fingerlab.ui.acquire.acquire_tab import AcquireTab
    from fingerlab.ui.acquire.bench_setup import BenchRequest, OpenBench

    with shown_window(folder, "acquire") as (window, _):
        tab = window.tab("acquire")
        assert isinstance(tab, AcquireTab)
        tab.controller._opener = lambda wanted: OpenBench(*in_processes(folder / "rescued"))
        tab.controller.open(BenchRequest("simulated"))
        while tab.controller.bench is None:
            pause(0.05)
        bench, opened = tab.controller.bench, tab.controller.opened
        assert isinstance(bench, ProcessBench)
        assert opened is not None
        tab.toolbar.model_chosen.emit("nominal")
        tab.plots.show_model(True, True)
        tab.plots.set_window(WINDOW_S)
        for number in range(asked.free_plots):
            tab.toolbar.arrange.add.click()
            if number:
                across = tab.plots.free.plots[number].across
                across.setCurrentIndex(across.findData("frequency"))
        try:
            return measure(bench, opened.rig, folder, asked, pause, True)
        finally:
            tab.shut_down()


@contextmanager
def another_process(wanted: bool) -> Iterator[None]:
    """A process beside that takes all of a core that it can have."""
    if not wanted:
        yield
        return
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as process:
        try:
            yield
        finally:
            process.kill()


def sustained(folder: Path) -> dict[int, float]:
    """Samples a second from the ring to the disk, for each number that is taken at a time."""
    found = {}
    for piece in PIECES:
        with _recorder(folder / f"{piece}.h5") as (ring, recorder, board):
            row, index, spent = [0.5] * len(COLUMNS), 0, 0.0
            while spent < PIECE_SECONDS:
                for _ in range(piece):
                    row[COLUMN["index"]] = float(index)
                    ring.write(tuple(row))
                    index += 1
                begun = time.perf_counter()
                recorder.poll()
                spent += time.perf_counter() - begun
            assert board[Slot.RECORDED] == index
            found[piece] = index / spent
    return found


@contextmanager
def _recorder(path: Path) -> Iterator[tuple[Ring, Recorder, SharedStatus]]:
    ring, board = Ring.make(1 << 14, len(COLUMNS), shared=False), SharedStatus.make(shared=False)
    recorder = Recorder(ring, board, path.parent / "rescued")
    recorder.open(SessionInfo(path, SimulatedRig().rig.to_json(), "speed", CREATED))
    recorder.begin(RunInfo("contact", "flexion", RATE_HZ, SINE, 0))
    yield ring, recorder, board
    recorder.cut("measured")
    recorder.close()


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--with-window", action="store_true", help="the window draws meanwhile, off screen")
    parser.add_argument("--driven", action="store_true", help="drive the motor, all safety checks on")
    parser.add_argument("--free-plots", type=int, default=0, help="so many beside the window's six, up to 4")
    parser.add_argument("--beside", action="store_true", help="another process takes a core meanwhile")
    keep_option(parser)
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "benchmarks-real-time.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run = with_window if options.with_window else without_window
        with another_process(options.beside):
            result = run(Path(folder), options)
        speeds = sustained(Path(folder))
    results = kept(result, options.keep)
    options.page.write_text(page(results, speeds, RATE_HZ), encoding="utf-8")


if __name__ == "__main__":
    main()

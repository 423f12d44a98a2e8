"""How punctual the control loop is in real time while it records, and how much the recorder sustains.

    python -m benchmarks.real_time [--minutes 10] [--with-window] [--keep FILE] [--page PAGE]

The simulated rig runs at 1 kHz by the machine's clock in the loop's own process, and the recorder writes
every sample to disk in another. With ``--with-window`` the application's window is open off screen on its
Acquire tab and draws six plots of 60 s. Lateness is how long after its due time a cycle began; a cycle that
is a whole period late has lost those in between. The amplifier is off: a busy machine is to be measured, and
with the motor driven the loop would stop it at the first 20 ms that the machine holds it up. Before each
measurement a bare loop of waits, without anything of FingerLab in it, tells what the machine itself can do.
Writes docs/benchmarks-real-time.md.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.benches import in_processes, keep_option, kept, shown_window
from benchmarks.machine import load_average, machine_words, used
from fingerlab.acquisition.board import Board, Slot
from fingerlab.acquisition.columns import COLUMN, COLUMNS
from fingerlab.acquisition.commands import Initialise, SetUp
from fingerlab.acquisition.process_bench import ProcessBench
from fingerlab.acquisition.recorder import Recorder
from fingerlab.acquisition.recording import RunInfo, SessionInfo
from fingerlab.acquisition.ring import Ring
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

Pause = Callable[[float], None]


@dataclass(frozen=True)
class Timed:
    """One measurement. Lateness in ms at the percentiles 50, 99, 99.9 and the largest; load averages.

    ``busy``, ``stolen``: per cent of the machine that programs used, and that its host kept for others.
    ``bare_ms``: lateness of a bare loop of waits.
    """

    window: bool
    minutes: float
    cycles: int
    lateness_ms: list[float]
    late: int
    lost: int
    unread: int
    recorded: int
    load_before: float
    load_after: float
    busy: float
    stolen: float
    window_share: float
    bare_ms: list[float]


class Watch:
    """Reads the ring beside recorder and window."""

    def __init__(self, bench: ProcessBench) -> None:
        self._reader = bench.ring.reader()
        self._pieces: list[np.ndarray[Any, Any]] = []
        self.lost = self.unread = 0
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
            self.lost += int((np.diff(index, prepend=before) - 1).sum())
            self._last = int(index[-1])
            self._pieces.append(piece.rows[:, COLUMN["lateness"]].copy())

    @property
    def lateness(self) -> np.ndarray[Any, Any]:
        """Seconds, of every cycle seen."""
        return np.concatenate(self._pieces)


def measure(bench: ProcessBench, rig: Any, folder: Path, minutes: float, pause: Pause, window: bool) -> Timed:
    """Record for so many minutes and look at every cycle."""
    path = folder / "real-time.h5"
    bench.recorder.open(SessionInfo(path, rig.to_json(), "real time", CREATED))
    for command in (SetUp("on_air", "extension"), Initialise()):
        bench.ask(command)
    load, bare = load_average(), bare_lateness()
    start = bench.board[Slot.INDEX] + 1
    bench.recorder.begin(RunInfo("on_air", "extension", RATE_HZ, SINE, start))
    watch, own = Watch(bench), psutil.Process()
    before = psutil.cpu_times()
    spent = sum(own.cpu_times()[:2])
    began, end = time.monotonic(), time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        pause(0.5)
        watch.look()
        status = bench.status()
        if status.fault or status.recorder:
            raise SystemExit(f"The bench stopped: {status.fault or status.recorder}")
    share = (sum(own.cpu_times()[:2]) - spent) / (time.monotonic() - began)
    busy, stolen = used(before, psutil.cpu_times())
    bench.recorder.end()
    watch.look()
    unread = bench.status().unread + watch.unread
    bench.recorder.close()
    ms = 1e3 * watch.lateness
    run = open_session(path).runs[0]
    return Timed(
        window,
        minutes,
        len(ms),
        [float(np.percentile(ms, share)) for share in (50.0, 99.0, 99.9, 100.0)],
        int((ms > 1e3 * LATE_S).sum()),
        watch.lost,
        unread,
        run.length,
        load,
        load_average(),
        busy,
        stolen,
        100.0 * share,
        bare,
    )


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


def without_window(folder: Path, minutes: float) -> Timed:
    """Only this process beside loop and recorder; it shows that it is alive, as a window does."""
    bench, rig = in_processes(folder / "rescued")

    def pause(seconds: float) -> None:
        for _ in range(round(30 * seconds)):
            bench.beat()
            time.sleep(1 / 30)

    try:
        return measure(bench, rig, folder, minutes, pause, False)
    finally:
        bench.close()


def with_window(folder: Path, minutes: float) -> Timed:
    """The window draws meanwhile."""
    from benchmarks.window_repaint import WINDOW_S, pause
    from fingerlab.ui.acquire.opening import OpenBench, Wanted
    from fingerlab.ui.acquire.tab import AcquireTab

    with shown_window(folder, "acquire") as (window, _):
        tab = window.tab("acquire")
        assert isinstance(tab, AcquireTab)
        tab.station._opener = lambda wanted: OpenBench(*in_processes(folder / "rescued"))
        tab.station.open(Wanted("simulated"))
        while tab.station.bench is None:
            pause(0.05)
        bench, opened = tab.station.bench, tab.station.opened
        assert isinstance(bench, ProcessBench)
        assert opened is not None
        tab.toolbar.model_chosen.emit("nominal")
        tab.plots.show_model(True, True)
        tab.plots.set_window(WINDOW_S)
        try:
            return measure(bench, opened.rig, folder, minutes, pause, True)
        finally:
            tab.shut_down()


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
def _recorder(path: Path) -> Iterator[tuple[Ring, Recorder, Board]]:
    ring, board = Ring.make(1 << 14, len(COLUMNS), shared=False), Board.make(shared=False)
    recorder = Recorder(ring, board, path.parent / "rescued")
    recorder.open(SessionInfo(path, SimulatedRig().rig.to_json(), "speed", CREATED))
    recorder.begin(RunInfo("contact", "flexion", RATE_HZ, SINE, 0))
    yield ring, recorder, board
    recorder.cut("measured")
    recorder.close()


def page(results: list[Timed], speeds: dict[int, float]) -> str:
    """The measurements as a page of documentation."""
    table = {
        "window drawing": ["yes" if r.window else "no" for r in results],
        "minutes": [f"{r.minutes:g}" for r in results],
        "cycles": [f"{r.cycles:,}" for r in results],
        "lateness p50, ms": [f"{r.lateness_ms[0]:.3f}" for r in results],
        "lateness p99, ms": [f"{r.lateness_ms[1]:.3f}" for r in results],
        "lateness p99.9, ms": [f"{r.lateness_ms[2]:.3f}" for r in results],
        "latest cycle, ms": [f"{r.lateness_ms[3]:.1f}" for r in results],
        "bare loop of waits: p50, p99, p99.9, latest, ms": [
            ", ".join(f"{one:.3g}" for one in r.bare_ms) for r in results
        ],
        "cycles more than 0.5 ms late": [f"{r.late:,}" for r in results],
        "cycles lost": [f"{r.lost:,} ({100 * r.lost / (r.cycles + r.lost):.3f} %)" for r in results],
        "samples that the recorder or the witness missed": [str(r.unread) for r in results],
        "samples in the file": [f"{r.recorded:,}" for r in results],
        "processor time of the window's process, % of a core": [f"{r.window_share:.0f}" for r in results],
        "load average before, after": [f"{r.load_before:.1f}, {r.load_after:.1f}" for r in results],
        "machine busy meanwhile, % of all cores": [f"{r.busy:.0f}" for r in results],
        "kept by the host for other machines, %": [f"{r.stolen:.0f}" for r in results],
    }
    rows = [f"| {words} | {' | '.join(cells)} |" for words, cells in table.items()]
    rows.insert(1, "|---|" + "---|" * len(results))
    speed = "\n".join(f"| {piece} | {rate:,.0f} | {rate / RATE_HZ:.0f} |" for piece, rate in speeds.items())
    return TEXT.format(rows="\n".join(rows), speed=speed, machine=machine_words())


TEXT = """# Real time

Made with `python -m benchmarks.real_time`, without and with `--with-window`, on {machine}.
Other programs shared the machine, as its load tells: a machine of one's own is more punctual.

The simulated rig at 1 kHz by the machine's clock, every sample recorded. The amplifier is off, which spares
the loop the checks and the position loop (some 10 of 1000 us a cycle): with the motor driven it stops at the
first 20 ms that the machine holds it up. Lateness is
how long after its due time a cycle began, the machine's own oversleeping included; who comes a whole period
late has lost the cycles in between, and they are stored as a gap.

{rows}

Samples a second that the recorder takes from the ring to the disk, sixteen channels and time, flushed ten
times a second of rig time:

| samples at a time | samples a second | times 1 kHz |
|---|---|---|
{speed}
"""


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--with-window", action="store_true", help="the window draws meanwhile, off screen")
    keep_option(parser)
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "benchmarks-real-time.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run = with_window if options.with_window else without_window
        result = run(Path(folder), options.minutes)
        speeds = sustained(Path(folder))
    results = kept(result, options.keep)
    options.page.write_text(page(results, speeds), encoding="utf-8")


if __name__ == "__main__":
    main()

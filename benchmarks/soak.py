"""Hours of recording in one run, faster than real time: is anything lost, and does the memory stay flat?

    python -m benchmarks.soak [--hours 10] [--processes | --card] [--keep FILE] [--page docs/soak.md]

The simulated rig presses the load cell in a slow sine under position control, through the control loop, the
safety checks and the recorder that a card would have, and all of it goes into one run of one session.
By default the loop and the recorder take turns in this process on the virtual clock; with ``--processes``
they run in processes of their own, as they do behind the window, with the simulated rig as fast as it goes.
With ``--card`` the finger is at the virtual card, which the real nidaqmx package drives in this process.

A second reader of the ring sums up what the loop published. Afterwards the session is opened anew and has to
hold just that: as many samples, a millisecond apart, with the same sums. Nothing here is taken from the
recorder's own account.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Event, Thread

import numpy as np
import psutil

from benchmarks.benches import in_processes, keep_option, kept, on_the_card, turned_by_hand
from benchmarks.machine import code_words, load_average, machine_words
from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.protocols.driver import ProtocolDriver
from fingerlab.acquisition.protocols.steps import plan_steps
from fingerlab.acquisition.recording import SessionInfo
from fingerlab.acquisition.ring import COLUMN, Array, RingReader
from fingerlab.acquisition.status import Slot
from fingerlab.sessions import open_session
from fingerlab.twin.protocols import RunPlan

ROOT = Path(__file__).resolve().parent.parent
RATE_HZ = 1000
CHANNELS = (
    "motor_command",
    "motor_position",
    "motor_current",
    "motor_torque",
    "mcp_angle",
    "pip_angle",
    "endpoint_force",
    "raw/encoder_counts",
)
"""The eight that are summed up and compared; the run holds eleven channels and five raw ones."""
LOOK_CYCLES = 60 * RATE_HZ
"""Memory is looked at once a minute of rig time."""
FLAT = 0.05
"""Share by which the memory may differ from that after the first minute."""
READ_CYCLES = 2000
PIECE = 1 << 17
SINE = {"kind": "sine", "amplitude_deg": 4.0, "frequency_hz": 1.0}
FORCE = 0.8
"""N, mean force about which the sine presses; as ``fingerlab record`` has it."""


@dataclass
class Soaked:
    """What was seen. Times in s of the machine, memory in MB; ``memory`` once a minute of rig time."""

    hours: float
    processes: bool
    published: int
    recorded: int
    irregular: int
    same: bool
    unread: int
    lost_cycles: int
    ended: str
    wall: float
    closing: float
    size_mb: float
    memory: list[float]
    closing_memory: float
    opening: float
    opening_mb: float
    info: float
    info_mb: float
    load: float
    card: bool = False
    code: str = ""

    @property
    def first(self) -> float:
        """Memory after the first minute, MB."""
        return self.memory[0]

    @property
    def largest(self) -> float:
        """Largest relative difference from it in the hours after."""
        return max(abs(one / self.first - 1.0) for one in self.memory)

    @property
    def good(self) -> bool:
        """Whether all that is asked of a soak holds."""
        whole = self.recorded == self.published == round(self.hours * 3600 * RATE_HZ)
        sound = self.same and not (self.irregular or self.unread or self.lost_cycles)
        return whole and sound and self.ended == "clean" and self.largest <= FLAT


class Sums:
    """A digest of each channel, in single precision but for the counts: what the file has to hold."""

    def __init__(self) -> None:
        self._digests = {name: hashlib.blake2b() for name in CHANNELS}
        self.samples = 0

    def add(self, channels: dict[str, Array]) -> None:
        """The next samples."""
        for name, digest in self._digests.items():
            kind = np.float64 if name.startswith("raw/") else np.float32
            digest.update(np.ascontiguousarray(channels[name], dtype=kind).tobytes())
        self.samples += len(channels[CHANNELS[0]])

    def hexdigests(self) -> dict[str, str]:
        """Channel -> digest."""
        return {name: digest.hexdigest() for name, digest in self._digests.items()}


class Witness:
    """Reads the ring beside the recorder, from sample ``start`` to before ``stop``."""

    def __init__(self, reader: RingReader, start: int, stop: int) -> None:
        self._reader, self._start, self._stop = reader, start, stop
        self.sums = Sums()

    def look(self) -> None:
        """Take what has been published meanwhile."""
        while True:
            rows = self._reader.read().rows
            if not len(rows):
                return
            index = rows[:, COLUMN["index"]]
            inside = rows[(index >= self._start) & (index < self._stop)]
            if len(inside):
                self.sums.add({name: inside[:, COLUMN[name]] for name in CHANNELS})


class Look:
    """Looks at memory and ring while the bench runs; called often, does something now and then."""

    def __init__(self, bench: Bench, seconds: float) -> None:
        self._bench, self._seconds = bench, seconds
        self._witness: Witness | None = None
        self._read_at = self._look_at = 0
        self.memory: list[float] = []
        self._processes = [psutil.Process()]
        if isinstance(bench, ProcessBench):
            numbers = (bench.board[Slot.LOOP_PID], bench.board[Slot.RECORDER_PID])
            self._processes += [psutil.Process(number) for number in numbers]

    def __call__(self, share: float, what: str) -> None:
        board = self._bench.board
        index = board[Slot.INDEX]
        if not board[Slot.RECORDING] or index < self._read_at:
            return
        self._read_at = index + READ_CYCLES
        if self._witness is None:
            start = board[Slot.RUN_START]
            reader = self._bench.ring.reader(behind=index - start + 10)
            self._witness = Witness(reader, start, start + round(self._seconds * RATE_HZ))
            self._look_at = start + LOOK_CYCLES
        self._witness.look()
        if index >= self._look_at:
            self._look_at += LOOK_CYCLES
            self.memory.append(self.now())
            print(f"\r{100 * share:5.1f} %  {self.memory[-1]:.1f} MB", end="", file=sys.stderr, flush=True)

    def now(self) -> float:
        """Memory that is the processes' own, MB."""
        return sum(own_memory(one) for one in self._processes)

    def published(self) -> Sums:
        """What the loop published in the run, to its end."""
        assert self._witness is not None
        self._witness.look()
        return self._witness.sums

    @contextmanager
    def largest(self) -> Iterator[list[float]]:
        """Meanwhile the largest memory is kept in a list of one."""
        kept, over = [self.now()], Event()

        def look() -> None:
            while not over.wait(0.2):
                kept[0] = max(kept[0], self.now())

        thread = Thread(target=look)
        thread.start()
        try:
            yield kept
        finally:
            over.set()
            thread.join()


def own_memory(process: psutil.Process) -> float:
    """MB in the memory that a process has asked for, without files and libraries that it has mapped."""
    info = process.memory_info()
    return float(info.rss - getattr(info, "shared", 0)) / 1e6


def soak(hours: float, processes: bool, card: bool, path: Path) -> Soaked:
    """Record for ``hours`` of rig time into ``path``, and look at what came of it."""
    seconds = 3600.0 * hours
    plan = RunPlan("contact", "flexion", {**SINE, "duration_s": seconds})
    rescue = path.parent / "rescued"
    by_hand = on_the_card if card else turned_by_hand
    bench, rig = in_processes(rescue, real_time=False) if processes else by_hand(rescue)
    begun = time.perf_counter()
    try:
        look = Look(bench, seconds)
        driver = ProtocolDriver(bench, lambda sentence: None, look)
        bench.recorder.open(SessionInfo(path, rig.to_json(), "soak", "2026-01-01T00:00:00+00:00"))
        driver.take(plan_steps([plan], FORCE, 0.0))
        wall, published, status = time.perf_counter() - begun, look.published(), bench.status()
        begun = time.perf_counter()
        with look.largest() as largest:
            bench.recorder.close()
        closing = time.perf_counter() - begun
    finally:
        bench.close()
    print(file=sys.stderr)
    opening, opening_mb = open_lazily(path)
    info, info_mb = command("info", path)
    found = read_back(path)
    return Soaked(
        hours,
        processes,
        published.samples,
        found.sums.samples,
        found.irregular,
        found.sums.hexdigests() == published.hexdigests(),
        status.unread,
        status.lost,
        found.ended,
        wall,
        closing,
        path.stat().st_size / 1e6,
        look.memory,
        largest[0],
        opening,
        opening_mb,
        info,
        info_mb,
        load_average(),
        card,
        code_words(),
    )


@dataclass(frozen=True)
class Found:
    """What a session holds: the sums, steps in time that are no millisecond, and how it says it ended."""

    sums: Sums
    irregular: int
    ended: str


def read_back(path: Path) -> Found:
    """Read the whole session as anybody would, a piece at a time."""
    session = open_session(path)
    run = session.runs[0]
    sums, irregular, last = Sums(), 0, -1e-3
    for start in range(0, run.length, PIECE):
        piece = run.load(["time", *CHANNELS], start, min(start + PIECE, run.length))
        steps = np.diff(piece["time"], prepend=last)
        irregular += int((np.abs(steps - 1e-3) > 1e-6).sum())
        last = float(piece["time"][-1])
        sums.add(piece)
    return Found(sums, irregular, str(session.attributes["ended"]))


def open_lazily(path: Path) -> tuple[float, float]:
    """Seconds and MB that it takes to open the session and to read one second from its middle."""
    own = psutil.Process()
    before, begun = own_memory(own), time.perf_counter()
    run = open_session(path).runs[0]
    middle = run.length // 2
    run.load(["time", *CHANNELS], middle, middle + RATE_HZ)
    return time.perf_counter() - begun, own_memory(own) - before


def command(word: str, path: Path) -> tuple[float, float]:
    """Seconds and peak MB of ``fingerlab WORD``, which has to succeed."""
    begun, peak = time.perf_counter(), 0.0
    with psutil.Popen([sys.executable, "-m", "fingerlab", word, str(path)], stdout=subprocess.DEVNULL) as one:
        while one.poll() is None:
            try:
                peak = max(peak, one.memory_info().rss / 1e6)
            except psutil.Error:
                break  # it ended while it was looked at
            time.sleep(0.05)
        if one.wait() != 0:
            raise SystemExit(f"fingerlab {word} {path} failed; run it by hand to see why.")
    return time.perf_counter() - begun, peak


def page(results: list[Soaked]) -> str:
    """The results as a page of documentation, one column a soak."""
    table = {
        "hours of rig time": [f"{r.hours:g}" for r in results],  # the head: the summary looks for it
        "program": [r.code for r in results],
        "bench": ["virtual card" if r.card else "simulated rig" for r in results],
        "processes": ["three" if r.processes else "one" for r in results],
        "samples published by the loop": [f"{r.published:,}" for r in results],
        "samples in the file": [f"{r.recorded:,}" for r in results],
        "steps in time that are no millisecond": [str(r.irregular) for r in results],
        "cycles lost, rows unread": [f"{r.lost_cycles}, {r.unread}" for r in results],
        "eight channels the same in the file": ["yes" if r.same else "NO" for r in results],
        "ended": [r.ended for r in results],
        "memory after the first minute, MB": [f"{r.first:.1f}" for r in results],
        "memory in the last minute, MB": [f"{r.memory[-1]:.1f}" for r in results],
        "largest difference from the first minute": [f"{100 * r.largest:.2f} %" for r in results],
        "most memory while the file is made whole, MB": [f"{r.closing_memory:.1f}" for r in results],
        "recorded in, min": [f"{r.wall / 60:.1f}" for r in results],
        "times real time": [f"{r.hours * 3600 / r.wall:.1f}" for r in results],
        "made whole and verified in, s": [f"{r.closing:.0f}" for r in results],
        "file, MB": [f"{r.size_mb:.0f}" for r in results],
        "opening it: s, MB": [f"{r.opening:.2f}, {r.opening_mb:.1f}" for r in results],
        "`fingerlab info`: s, peak MB": [f"{r.info:.0f}, {r.info_mb:.0f}" for r in results],
        "load average at the end": [f"{r.load:.1f}" for r in results],
    }
    rows = [f"| {words} | {' | '.join(cells)} |" for words, cells in table.items()]
    rows.insert(1, "|---|" + "---|" * len(results))
    return TEXT.format(table="\n".join(rows), machine=machine_words())


TEXT = """# Soak

Hours of recording in one run on the simulated rig, and at the virtual card with the simulated finger on its
connector, faster than real time: `python -m benchmarks.soak`, with and without `--card`, makes this page.
Made on {machine}, which other programs shared.

The finger presses the load cell in a sine of 4 degrees and 1 Hz about 0.8 N, under the position loop and the
safety checks; loop, recorder and session file are those that a card would have. "One" process: loop and
recorder take turns on the virtual clock. "Three": each in a process of its own, as behind the window, with
the simulated rig as fast as it goes. Sixteen channels are recorded besides time; eight of them are summed up
(BLAKE2b) from the ring while they are published and again from the finished file, and have to agree.

{table}

Memory is what the processes have for themselves, looked at once a minute of rig time. Opening reads what is
in the session and one second from its middle; `fingerlab info` reads and checks every sample. Load is the
machine's load average at the end.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--hours", type=float, default=10.0, help="of rig time")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--processes", action="store_true", help="loop and recorder in their own processes")
    where.add_argument("--card", action="store_true", help="at the virtual card")
    keep_option(parser)
    parser.add_argument("--folder", type=Path, help="where to record (a temporary folder by default)")
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "soak.md", help="page to write")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        result = soak(options.hours, options.processes, options.card, Path(folder) / "soak.h5")
    results = kept(result, options.keep)
    options.page.write_text(page(results), encoding="utf-8")
    if not result.good:
        raise SystemExit(f"The soak failed: {asdict(result) | {'memory': 'see the page'}}")


if __name__ == "__main__":
    main()

"""Seconds and peak memory of opening, fitting and diagnosing a session of the thesis' size and longer ones.

    python -m benchmarks.session_sizes [1 10 100]

A session of the thesis' size (20 runs of 30 s at 1 kHz) is simulated once; longer ones repeat its runs. Every
step runs as a command in a process of its own, so that its peak memory is its own (a second process that it
starts is counted with it). Writes docs/benchmarks.md.
Processor time is kept beside wall time, because other work on the machine slows the clock on the wall.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import psutil

from benchmarks.machine import ADDED, BUSY_LOAD, code_words, load_average, machine_words, with_section
from fingerlab.sessions import SessionWriter, open_session

ROOT = Path(__file__).resolve().parent.parent
STEPS = {"open": "info", "fit": "fit", "diagnose": "diagnose"}
"""Step -> command; ``info`` opens a session and checks all of it."""
MODULES = {
    "open": "fingerlab.sessions",
    "fit": "fingerlab.thesis.fitting",
    "diagnose": "fingerlab.diagnosis",
}
"""What each step loads before it looks at any data: taken off where growth with the data is told."""
LOOK_S = 0.1
"""Pause between two looks at the memory, s: looking costs time on a core that the command may want."""
REPEATS = 3
"""So often the start and the smallest size are measured; the quickest counts, for what else the machine does
only ever takes time."""


@dataclass(frozen=True)
class Measured:
    """One command on one session: s, s of all cores, MB, and what ``diagnose`` says of itself (s)."""

    wall: float
    processor: float
    memory: float
    own: float | None = None


def thesis_sized(folder: Path) -> Path:
    """A simulated session of ten on-air and ten contact runs with sheath friction."""
    path = folder / "session-1.h5"
    command = ["simulate", "--protocol", "thesis", "--effect", "capstan_friction", "--seed", "11"]
    subprocess.run([sys.executable, "-m", "fingerlab", *command, "--out", str(path)], check=True)
    return path


def repeated(source: Path, times: int) -> Path:
    """A session that holds the runs of ``source`` ``times`` over."""
    path = source.with_name(f"session-{times}.h5")
    session = open_session(source)
    runs = [(run, run.load()) for run in session.runs]
    with SessionWriter(path, session.rig, "repeated", float32=True, compression_level=1) as writer:
        for _ in range(times):
            for run, channels in runs:
                writer.add_run(run.phase, run.cable, run.sample_rate_hz, run.trajectory, channels)
    return path


def as_installed(folder: Path) -> dict[str, str]:
    """The environment of a command whose modules are compiled once and kept, as an installation's are."""
    own = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**own, "PYTHONPYCACHEPREFIX": str(folder / "compiled")}


def measure(
    words: list[str], environment: dict[str, str], target: Path | None = None, watched: bool = True
) -> Measured:
    """Run Python with ``words`` until it ends; ``target`` is where it writes its JSON.

    ``watched`` for its memory and processor time, which takes some of a core; else these are not known.
    """
    started = time.perf_counter()
    process = psutil.Popen(
        [sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment
    )
    peak = 0
    spent: dict[int, float] = {}  # processor time of every process, by its number
    while watched and process.poll() is None:
        try:
            memory = 0
            for one in (process, *process.children(recursive=True)):
                with one.oneshot():
                    memory += one.memory_info().rss
                    used = one.cpu_times()
                spent[one.pid] = used.user + used.system
            peak = max(peak, memory)
        except psutil.Error:
            pass  # one has ended while it was being looked at
        time.sleep(LOOK_S)
    if process.wait() != 0:
        raise SystemExit(f"python {' '.join(words)} failed; run it by hand to see why.")
    wall = time.perf_counter() - started
    own = None if target is None else float(json.loads(target.read_text(encoding="utf-8"))["seconds"])
    return Measured(wall, sum(spent.values()), peak / 1e6, own)


def measure_step(step: str, path: Path, environment: dict[str, str], watched: bool = True) -> Measured:
    """One command on one session."""
    words = ["-m", "fingerlab", STEPS[step], str(path)]
    if step != "diagnose":
        return measure(words, environment, watched=watched)
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "answer.json"
        return measure([*words, "--json", str(target)], environment, target, watched)


def quickest(once: Callable[..., Measured]) -> Measured:
    """Watched once, for memory and processor time, and then a few times with nobody looking: the quickest."""
    watched = once()
    alone = min((once(watched=False) for _ in range(REPEATS)), key=lambda m: m.wall)
    return replace(watched, wall=alone.wall, own=alone.own)


def twin_speed() -> str:
    """What ``twin_speed.py`` prints, as list items."""
    script = Path(__file__).with_name("twin_speed.py")
    done = subprocess.run([sys.executable, str(script)], check=True, capture_output=True, text=True)
    return "\n".join(f"- {line}" for line in done.stdout.strip().splitlines())


Results = dict[tuple[str, int], Measured]


def growth(results: Results, sizes: list[int]) -> list[str]:
    """How the processor time of each step grows beyond its start: no faster than the data is good."""
    pairs = list(pairwise(sizes))
    if not pairs:
        return []
    names = [f"{large} against {small}" for small, large in pairs]
    lines = ["| processor time, as a multiple | " + " | ".join(names) + " |", "|---" * (len(pairs) + 1) + "|"]
    for step in STEPS:
        start = results[step, 0].processor
        ratios = [
            (results[step, large].processor - start) / max(results[step, small].processor - start, 1e-3)
            for small, large in pairs
        ]
        lines.append(f"| {step} | " + " | ".join(f"{ratio:.1f}" for ratio in ratios) + " |")
    return [*lines, ""]


def table(results: Results, sizes: list[int]) -> list[str]:
    """Seconds and memory of every step at every size."""
    lines = [
        "| step | size | wall, s | processor, s | the diagnosis itself, wall, s | peak memory, MB |",
        "|---|---|---|---|---|---|",
    ]
    for step, size in ((step, size) for step in STEPS for size in (0, *sizes)):
        m = results[step, size]
        own = "" if m.own is None else f"{m.own:.2f}"
        name = size or "start"
        lines.append(f"| {step} | {name} | {m.wall:.2f} | {m.processor:.2f} | {own} | {m.memory:.0f} |")
    return [*lines, ""]


def page(results: Results, sizes: list[int], loads: tuple[float, float], speed: str) -> str:
    """The measurements as Markdown, ratios first."""
    busy = loads[0] >= BUSY_LOAD
    load_text = f"load average {loads[0]:.1f} before, {loads[1]:.1f} after"
    command = f"python -m benchmarks.session_sizes {' '.join(map(str, sizes))}"
    head = ["# Benchmarks", "", f"Made with `{command}` on {machine_words()}, {load_text}; {code_words()}."]
    if busy:
        head += [
            "Other programs shared the machine, so that times are longer than on a machine of one's own."
        ]
    head += [
        "",
        "Size 1 is the thesis' session, 20 runs of 30 s at 1 kHz; larger ones hold its runs that many times "
        "over. Times are of whole commands (`info`, `fit`, `diagnose`), their modules compiled as an "
        f"installation's are; start is loading them alone. Start and size 1 are the quickest of {REPEATS}.",
        "",
    ]
    return "\n".join(
        [
            *head,
            *growth(results, sizes),
            *table(results, sizes),
            "Speed of the simulated bench:",
            "",
            speed,
            "",
        ]
    )


def main() -> None:
    """Measure the sizes named on the command line."""
    sizes = [int(word) for word in sys.argv[1:]] or [1, 10, 100]
    before = load_average()
    results: Results = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = as_installed(Path(folder))
        for step in STEPS:
            start = ["-c", f"import {MODULES[step]}"]
            results[step, 0] = quickest(partial(measure, start, environment))
        source = thesis_sized(Path(folder))
        for size in sizes:
            path = source if size == 1 else repeated(source, size)
            for step in STEPS:
                once = partial(measure_step, step, path, environment)
                m = results[step, size] = quickest(once) if size == 1 else once()
                print(f"{step:10s} x{size:<4d} {m.wall:8.2f} s {m.memory:7.0f} MB", flush=True)
            if path != source:
                path.unlink()
    loads = before, load_average()
    target = ROOT / "docs" / "benchmarks.md"
    other = target.read_text(encoding="utf-8").partition(ADDED)[2].strip()  # that another program has made
    text = page(results, sizes, loads, twin_speed())
    target.write_text(with_section(text, ADDED, f"{other}\n" if other else ""), encoding="utf-8")


if __name__ == "__main__":
    main()

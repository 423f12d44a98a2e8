"""Seconds and peak memory of opening, fitting and diagnosing a session of the thesis' size and longer ones.

    python benchmarks/session_sizes.py [1 10 100]

A session of the thesis' size (20 runs of 30 s at 1 kHz) is simulated once; longer ones repeat its runs. Every
step runs in a process of its own, so that its peak memory is its own. Writes docs/benchmarks.md.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from fingerlab.sessions import SessionWriter, open_session

ROOT = Path(__file__).resolve().parent.parent
STEPS = {
    "open": ["info"],
    "fit": ["fit"],
    "diagnose": ["diagnose"],
}
"""Column -> command words; each is timed whole, with the interpreter's start and all imports."""


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
    with SessionWriter(path, session.rig, "repeated", float32=True, compression_level=1) as writer:
        for _ in range(times):
            for run in session.runs:
                channels = run.load()
                writer.add_run(run.phase, run.cable, run.sample_rate_hz, run.trajectory, channels)
    return path


def measure(words: list[str], path: Path) -> tuple[float, float]:
    """Wall time (s) and peak memory (MB) of one command on one session."""
    started = time.perf_counter()
    process = psutil.Popen(
        [sys.executable, "-m", "fingerlab", *words, str(path)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    peak = 0
    while process.poll() is None:
        try:
            peak = max(peak, process.memory_info().rss)
        except psutil.Error:
            break
        time.sleep(0.02)
    if process.wait() != 0:
        raise SystemExit(f"{' '.join(words)} failed on {path.name}; run it by hand to see why.")
    return time.perf_counter() - started, peak / 1e6


def table(rows: list[tuple[int, str, float, float]], load: float) -> str:
    """The measurements as Markdown, ratios first."""
    by = {(size, step): (seconds, memory) for size, step, seconds, memory in rows}
    sizes = sorted({r[0] for r in rows})
    lines = [
        "# Benchmarks: sessions of growing size",
        "",
        f"Made with `python benchmarks/session_sizes.py {' '.join(map(str, sizes))}` "
        f"on {os.cpu_count()} cores, Python {platform.python_version()}; load average before the start "
        f"{load:.1f}. Times are of whole commands, interpreter and imports included; 1 is the thesis' size, "
        "20 runs of 30 s at 1 kHz.",
        "",
        "| step | size | time against the size before, per unit of data | seconds | peak memory, MB |",
        "|---|---|---|---|---|",
    ]
    for step in STEPS:
        for i, size in enumerate(sizes):
            seconds, memory = by[size, step]
            before = sizes[i - 1] if i else None
            ratio = "-" if before is None else f"{seconds / by[before, step][0] * before / size:.2f}"
            lines.append(f"| {step} | {size} | {ratio} | {seconds:.2f} | {memory:.0f} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure the sizes named on the command line."""
    sizes = [int(word) for word in sys.argv[1:]] or [1, 10, 100]
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        source = thesis_sized(Path(folder))
        for size in sizes:
            path = source if size == 1 else repeated(source, size)
            for step, words in STEPS.items():
                seconds, memory = measure(words, path)
                print(f"{step:10s} x{size:<4d} {seconds:8.2f} s {memory:7.0f} MB", flush=True)
                rows.append((size, step, seconds, memory))
            if size != 1:
                path.unlink()
    target = ROOT / "docs" / "benchmarks.md"
    target.write_text(table(rows, load), encoding="utf-8")


if __name__ == "__main__":
    main()

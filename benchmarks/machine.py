"""What machine a measurement was made on, and how much of it other programs took meanwhile."""

from __future__ import annotations

import os
import platform
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

import fingerlab

ROOT = Path(__file__).resolve().parent.parent
Frame = tuple[float, float]
"""Milliseconds on the wall, and of the processor."""

BUSY_LOAD = 1.5
"""From this load average on, other programs are taken to share the machine."""
LOOPS = 400_000
SLICES = 20


def fixed_loop() -> float:
    """Seconds on the wall that a loop which is always the same takes now."""
    total = 0.0
    for _ in range(SLICES):
        started = time.perf_counter()
        sum(k * k for k in range(LOOPS // SLICES))
        total += time.perf_counter() - started
    return total


def load_average() -> float:
    """Programs that wanted a core over the last minute; 0 where the system does not tell."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0


@contextmanager
def timed(into: list[Frame]) -> Iterator[None]:
    """Adds the milliseconds that something takes: on the wall, and of the processor for this process."""
    wall, processor = time.perf_counter(), time.process_time()
    yield
    into.append((1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - processor)))


def used(before: Any, after: Any) -> tuple[float, float]:
    """Per cent of all cores that programs used, and that the host of a virtual machine kept for others.

    Args:
        before, after: of ``psutil.cpu_times``.
    """
    spent = {name: getattr(after, name) - getattr(before, name) for name in after._fields}
    for counted_twice in ("guest", "guest_nice"):
        spent.pop(counted_twice, None)
    whole = sum(spent.values())
    idle, stolen = spent["idle"] + spent.get("iowait", 0.0), spent.get("steal", 0.0)
    return 100.0 * (whole - idle - stolen) / whole, 100.0 * stolen / whole


@dataclass(frozen=True)
class Share:
    """What was not ours between two looks.

    Attributes:
        stolen: per cent of all cores that the host took. others: per cent that other programs used.
        slowed: the fixed loop, median over shortest of those in the measurement; 1 is undisturbed.
        load: load average before.
    """

    stolen: float
    others: float
    slowed: float
    load: float

    def words(self) -> str:
        """For a report."""
        return (
            f"load average {self.load:.1f} before; meanwhile {self.stolen:.0f} % of the cores stolen "
            f"by the host, {self.others:.0f} % used by other programs; a fixed loop took "
            f"{self.slowed:.2f} times its shortest"
        )


class Watch:
    """Looks at the machine while something is measured; call :meth:`look` now and then."""

    def __init__(self) -> None:
        self._load = load_average()
        self._process = psutil.Process()
        self._before = psutil.cpu_times(), self._own(), time.perf_counter()
        self._loops = [fixed_loop()]

    def look(self) -> None:
        """Time the fixed loop once more."""
        self._loops.append(fixed_loop())

    def share(self) -> Share:
        """What others took since the beginning."""
        self.look()
        times, own, began = self._before
        cores = psutil.cpu_count() or 1
        busy, stolen = used(times, psutil.cpu_times())
        ours = 100.0 * (self._own() - own) / (cores * (time.perf_counter() - began))
        middle = sorted(self._loops)[len(self._loops) // 2]
        return Share(stolen, max(busy - ours, 0.0), middle / min(self._loops), self._load)

    def _own(self) -> float:
        times = self._process.cpu_times()
        return times.user + times.system + times.children_user + times.children_system


def code_words(root: Path = ROOT) -> str:
    """Version and, in a checkout with git, the commit: with which code something was measured."""
    asked = (
        ("rev-parse", "--short", "HEAD"),
        ("status", "--porcelain", "--", "fingerlab", "ui", "resources"),
    )
    try:
        commit, changed = (
            subprocess.run(
                ["git", *words], cwd=root, capture_output=True, text=True, check=True
            ).stdout.strip()
            for words in asked
        )
    except (OSError, subprocess.CalledProcessError):
        return f"FingerLab {fingerlab.__version__}"
    return f"FingerLab {fingerlab.__version__}, commit {commit}{' and changes' if changed else ''}"


ADDED = "## An effect that is added"
"""The section of docs/benchmarks.md that ``added_effect`` writes; it stands last."""


def with_section(page: str, heading: str, text: str) -> str:
    """A page in Markdown with this text as its last section, in place of one with the same heading."""
    return f"{page.partition(heading)[0].rstrip()}\n\n{heading}\n\n{text}" if text else page


def machine_words() -> str:
    """Cores, system and Python."""
    system = f"{platform.system()} {platform.machine()}"
    return f"{os.cpu_count()} cores ({system}), Python {platform.python_version()}"

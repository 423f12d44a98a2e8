"""When the machine itself stood still: one process a core, above all others, that only sleeps and notes it.

    python -m benchmarks.standstills CORE

Scheduling latency, as cyclictest (rt-tests) measures it, with the times at which it was long. Each sleeps for
2 ms at a time with a priority in real time that is higher than the control loop's. Where it comes back much
later, no program on that core ran that it could have waited for: the (virtual) machine was held up from
outside. Linux, where the user may ask for real time; elsewhere nothing is told.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

SLEEP_S = 0.002
STOOD_S = 0.012
"""From so long on it counts: a normal sleep of 2 ms is over after 3 at most; the loop is stopped at 20."""
PRIORITY = 90
"""Of at most 99; the loop asks for the system's lowest in real time."""


class Standstills:
    """What the witnesses noted.

    Attributes:
        moments: (begin, seconds) by ``time.monotonic``, one core's or both cores' as one; None: not watched.
    """

    def __init__(self) -> None:
        self.moments: list[tuple[float, float]] | None = None

    def take(self, moments: list[tuple[float, float]]) -> None:
        """Take what all cores told; what overlaps is one moment."""
        self.moments = []
        for begin, seconds in sorted(moments):
            if self.moments and begin <= sum(self.moments[-1]):
                first, length = self.moments[-1]
                self.moments[-1] = first, max(length, begin + seconds - first)
            else:
                self.moments.append((begin, seconds))

    def in_the(self, seconds: float, before: float) -> bool:
        """Whether the machine stood still within so many seconds before a moment."""
        return any(before - seconds <= begin + length <= before for begin, length in self.moments or ())


@contextmanager
def watched() -> Iterator[Standstills]:
    """Watch every core meanwhile; the moments are there afterwards."""
    found = Standstills()
    if not hasattr(os, "sched_getaffinity"):
        yield found
        return
    each = [
        subprocess.Popen(
            [sys.executable, "-m", "benchmarks.standstills", str(core)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for core in sorted(os.sched_getaffinity(0))
    ]
    try:
        yield found
    finally:
        outputs = [process.communicate()[0].split() for process in each]  # its input ends, and so does it
        if all(process.returncode == 0 for process in each):
            numbers = [[float(word) for word in words] for words in outputs]
            found.take([pair for one in numbers for pair in zip(one[::2], one[1::2], strict=True)])


def main(core: int) -> None:
    """Note standstills of one core until the input ends."""
    import threading

    if sys.platform == "win32":
        raise SystemExit("Standstills are watched on Linux only.")
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    os.sched_setaffinity(0, {core})
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        raise SystemExit(2) from None
    before = time.monotonic()
    while not ended.is_set():
        time.sleep(SLEEP_S)
        now = time.monotonic()
        if now - before > STOOD_S:
            print(before, now - before, flush=True)
        before = now


if __name__ == "__main__":
    main(int(sys.argv[1]))

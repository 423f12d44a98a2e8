"""How often a motion repeats, as its run says it; where none does, ``sessions.cycle`` finds it.

What comes again in every cycle tells noise from what a model misses.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fingerlab.identify.diagnosis.bandwidth import NARROW_RATE_HZ
from fingerlab.sessions.model import Run


def told_frequency(run: Run) -> float | None:
    """Cycles a second of a run that was told a sine, Hz; None: it was not, or does not say."""
    frequency = run.trajectory.get("frequency_hz")
    if run.trajectory.get("kind") != "sine" or not isinstance(frequency, int | float):
        return None
    return float(frequency) if frequency > 0 else None


def any_told(runs: Iterable[Run]) -> bool:
    """Whether one of the runs says how often its motion repeats; the noise of the others is then known."""
    return any(told_frequency(run) is not None for run in runs)


def harmonics_below_nyquist(frequency: float) -> int:
    """How many harmonics of a cycle the narrow rate can hold."""
    return int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1

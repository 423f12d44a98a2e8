"""What of a stretch comes again in every cycle, or as a slow trend in every run; the rest is noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import legvander

from fingerlab.diagnosis.bandwidth import NARROW_RATE_HZ
from fingerlab.diagnosis.groups import Group
from fingerlab.diagnosis.narrowing import Narrow, counted
from fingerlab.sessions.cycle import found_frequency, told_frequency
from fingerlab.sessions.model import Array, Run

TREND_DEGREE = 3
"""Of the polynomial over a stretch that counts as its slow trend."""


def repeating_bases(low: Narrow, run: Run, seek: bool = False) -> tuple[Array, Array] | None:
    """What a stretch may repeat: bases of its cycle, (n, harmonics), and of a slow trend, (n, degrees).

    ``seek`` a cycle in the motion itself where the run does not tell it. None where there is no cycle that
    repeats often enough.
    """
    if not bool(low.taut.all()):
        return None
    frequency = told_frequency(run)
    if frequency is None and seek:
        frequency = _sought(low, run)
    if frequency is None:
        return None
    count = int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1
    if 2 * count + 1 > 0.6 * len(low.time):
        return None
    return _harmonics(frequency, count, float(low.time[0]), float(low.time[-1]), len(low.time))


def _sought(low: Narrow, run: Run) -> float | None:
    """Cycles a second of a stretch, Hz, by its command, or else by its motion; None: neither comes again.

    A finger that presses settles for a while, and hardly moves: its command is the better witness.
    """
    motion = low.wide
    if run.has("motor_command"):
        step = max(round(run.sample_rate_hz / motion.sample_rate_hz), 1)
        first, last = (round(float(t) * run.sample_rate_hz) for t in low.time[[0, -1]])
        command = run.channel("motor_command", first, last + 1)[::step]
        found = found_frequency(command, run.sample_rate_hz / step) if np.isfinite(command).all() else None
        if found is not None:
            return found
    return found_frequency(motion.position[counted(motion)], motion.sample_rate_hz)


@lru_cache(maxsize=4)
def _harmonics(frequency: float, count: int, first: float, last: float, samples: int) -> tuple[Array, Array]:
    """Orthonormal bases of a constant and harmonics, (samples, 2 count + 1), and of a trend beside them.

    ``frequency`` in Hz, ``first`` and ``last`` sample in s. The runs of a session share them.
    """
    phase = 2 * np.pi * frequency * np.outer(np.linspace(first, last, samples), np.arange(1, count + 1))
    trend = legvander(np.linspace(-1.0, 1.0, samples), TREND_DEGREE)
    basis = np.linalg.qr(np.hstack((trend[:, :1], np.cos(phase), np.sin(phase), trend[:, 1:])))[0]
    return basis[:, :-TREND_DEGREE], basis[:, -TREND_DEGREE:]


def remove_common_trend(group: Group) -> None:
    """Takes out of a group's noise the slow trend that the runs of a condition have in common.

    A trend (a sensor that warms up, a spring that creeps) is no noise if it comes again in every run: it can
    be explained. Its noise is what it differs by from run to run. Only in free motion: how a tip settles on
    the load cell comes again, too, and no law here tells it.
    """
    for trends in _comparable(group):
        count = len(trends)
        if count < 2 or group.in_contact:
            continue
        runs = np.stack(trends)  # (runs, signals, degrees)
        mean = runs.mean(axis=0)
        apart = (runs - mean).transpose(1, 0, 2).reshape(mean.shape[0], -1)
        group.noise += apart @ apart.T / (count - 1) - count * mean @ mean.T
    group.trends.clear()


def _comparable(group: Group) -> list[list[Array]]:
    """Trends of runs that can be compared: those of one condition, and of all conditions with one run."""
    repeated = [trends for trends in group.trends.values() if len(trends) > 1]
    alone: dict[int, list[Array]] = {}
    for (_, stretch), trends in group.trends.items():
        if len(trends) == 1:
            alone.setdefault(stretch, []).extend(trends)
    return [*repeated, *alone.values()]

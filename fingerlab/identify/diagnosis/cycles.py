"""How often a motion repeats: as the run says, or, where no run says it, as the recording shows.

Files of other programs say nothing of what the motor was told. What comes again in every cycle tells noise
from what a model misses, so a cycle is then looked for in the motor's own motion.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.polynomial.legendre import legvander

from fingerlab.identify.diagnosis.bandwidth import NARROW_RATE_HZ
from fingerlab.sessions.model import Array, Run

LEAST_CYCLES = 3
"""A motion that came again less often is not called repeated."""
REPEATED = 0.01
"""Share of the variance by which cycles may differ and are still the same; assumed."""
HARMONICS, DRIFT_DEGREE = 8, 3
"""What is fitted to find the cycle's length exactly: that many harmonics, and a polynomial for a drift."""
UNLIKE = 0.25
"""Two moments are another part of the motion once they differ by this share; assumed."""


def told_frequency(run: Run) -> float | None:
    """Cycles a second of a run that was told a sine, Hz; None: it was not, or does not say."""
    frequency = run.trajectory.get("frequency_hz")
    if run.trajectory.get("kind") != "sine" or not isinstance(frequency, int | float):
        return None
    return float(frequency) if frequency > 0 else None


def any_told(runs: Iterable[Run]) -> bool:
    """Whether one of the runs says how often its motion repeats; the noise of the others is then known."""
    return any(told_frequency(run) is not None for run in runs)


def found_frequency(position: Array, rate: float) -> float | None:
    """Cycles a second with which a motion comes again, Hz; None where it does not.

    Args:
        position: of the motor, rad, shape (n,), ``rate`` samples a second.
    """
    moved = position - position.mean()
    lag = _cycle(_unlike(moved, len(moved) // LEAST_CYCLES))
    if lag is None:
        return None
    from scipy.optimize import minimize_scalar  # takes a while to load, and is seldom needed

    usual = rate / lag
    width = 0.5 / lag  # half a sample of the cycle
    found = minimize_scalar(
        lambda f: _left(moved, f / rate), bounds=(usual * (1 - width), usual * (1 + width)), method="bounded",
        options={"xatol": 1e-7 * usual},
    )  # fmt: skip
    return float(found.x)


def _unlike(moved: Array, most: int) -> Array:
    """Mean square difference of a motion from itself a lag later, in variances, for lags up to ``most``."""
    samples = len(moved)
    if most < 1 or not float(np.ptp(moved)) > 0:
        return np.zeros(0)
    size = 1 << int(np.ceil(np.log2(2 * samples)))
    together = np.fft.irfft(np.abs(np.fft.rfft(moved, size)) ** 2, size)[: most + 1]
    energy = np.concatenate(([0.0], np.cumsum(moved**2)))
    lags = np.arange(most + 1)
    both = energy[samples - lags] + energy[samples] - energy[lags]
    return np.asarray((both - 2.0 * together) / (2.0 * (samples - lags) * float(np.var(moved))))


def _cycle(unlike: Array) -> int | None:
    """The first lag, after the motion has been another, at which it is the same again; or None."""
    away = np.flatnonzero(unlike > UNLIKE)
    if not len(away):
        return None
    back = np.flatnonzero(unlike[away[0] :] < REPEATED)
    if not len(back):
        return None
    first = int(away[0] + back[0])
    gone = np.flatnonzero(unlike[first:] >= REPEATED)
    last = first + int(gone[0]) if len(gone) else len(unlike)
    return first + int(np.argmin(unlike[first:last]))


def _left(moved: Array, frequency: float) -> float:
    """What a few harmonics of a frequency (cycles a sample) and a slow drift leave of a motion."""
    steps = np.linspace(-1.0, 1.0, len(moved))
    count = max(1, min(HARMONICS, int(0.5 / frequency) - 1))
    phase = np.pi * frequency * (len(moved) - 1) * np.outer(steps, np.arange(1, count + 1))
    basis = np.hstack((legvander(steps, DRIFT_DEGREE), np.cos(phase), np.sin(phase)))
    rest = moved - basis @ np.linalg.lstsq(basis, moved, rcond=None)[0]
    return float(rest @ rest)


def harmonics_below_nyquist(frequency: float) -> int:
    """How many harmonics of a cycle the narrow rate can hold."""
    return int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1

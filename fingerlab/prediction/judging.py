"""Modelled against measured force in numbers: raw, normalised as in the thesis, peaks, delay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from fingerlab.diagnosis.bandwidth import NARROW_RATE_HZ
from fingerlab.sessions.model import Array
from fingerlab.signals.delays import cross_correlation_delay
from fingerlab.signals.periods import MINIMUM_PERIODS, PeriodGrid
from fingerlab.thesis.prediction import Prediction, judge_forces

FINE = 20
"""Samples put between two of the decimated ones, so that a peak or a delay falls on one: 2 ms."""


@dataclass(frozen=True)
class ForceNumbers:
    """One run. Forces in N; NaN where the run cannot tell. ``prediction`` as of the thesis' analysis.

    ``delay_s``: positive where the measured force comes later than the modelled one, s.
    """

    prediction: Prediction
    delay_s: float

    def value(self, name: str) -> float:
        """One number by its name in the JSON of ``predict``."""
        return self.delay_s if name == "delay" else float(getattr(self.prediction, name))

    @property
    def error_by_phase(self) -> Mapping[str, float]:
        """Mean of modelled less measured force by phase of the force cycle, N."""
        return self.prediction.error_by_phase


def judge_stretches(
    measured: Sequence[Array], modelled: Sequence[Array], sample_rate_hz: float, frequency_hz: float
) -> ForceNumbers:
    """Judge the longest stretch of a run (a run of at most a minute has one).

    Args:
        measured, modelled: N, (n,) each, by stretch. frequency_hz: of the cycle; 0 where there is none.
    """
    longest = int(np.argmax([len(m) for m in modelled]))
    y, f = measured[longest], modelled[longest]
    rate = sample_rate_hz
    if np.isfinite(f).all() and len(f) > 3:
        y, f, rate = _fine(y), _fine(f), sample_rate_hz * FINE
    grid = _grid(len(f), rate, frequency_hz)
    return ForceNumbers(judge_forces(y, f, rate, grid, (0, len(f))), _delay(y, f, rate, grid))


def fine_grid(
    measured: Array, modelled: Array, frequency_hz: float
) -> tuple[tuple[Array, Array], PeriodGrid | None]:
    """Both forces of one stretch between their samples, as they are judged, and their whole periods."""
    rate = NARROW_RATE_HZ
    if not (np.isfinite(modelled).all() and len(modelled) > 3):
        return (measured, modelled), None
    pair = _fine(measured), _fine(modelled)
    return pair, _grid(len(pair[1]), rate * FINE, frequency_hz)


def _fine(values: Array) -> Array:
    """The band-limited signal between its samples; NaN stays NaN."""
    at = np.arange((len(values) - 1) * FINE + 1) / FINE
    if not np.isfinite(values).all():
        return np.full(len(at), np.nan)
    return np.asarray(CubicSpline(np.arange(len(values)), values)(at))


def _grid(length: int, rate: float, frequency_hz: float) -> PeriodGrid | None:
    if not 0 < frequency_hz < rate / 4:
        return None
    period = rate / frequency_hz
    count = int((length - 1) // period)
    whole = float(round(period)) if abs(period - round(period)) < 1e-6 else period
    return PeriodGrid(0.0, whole, count) if count >= MINIMUM_PERIODS else None


def _delay(measured: Array, modelled: Array, rate: float, grid: PeriodGrid | None) -> float:
    if grid is None:
        return float("nan")
    y, f = grid.mean(measured), grid.mean(modelled)
    if not (np.isfinite(y).all() and np.isfinite(f).all()):
        return float("nan")
    return cross_correlation_delay(y, f) * grid.period / grid.phases / rate

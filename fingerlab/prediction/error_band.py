"""How far a predicted force may be off: numbers of held-out runs, and the interval that these tell.

The width of the interval is read from errors of held-out runs, so that it knows what a covariance of
parameters does not: what repeats in the error and belongs to the model, and what differs from run to run.
Each held-out run is a draw of its own (as in the jackknife+ of Barber, Candes, Ramdas and Tibshirani 2021, by
runs); samples within a run are not. The width depends on where in the loading cycle the modelled force
stands: an error at the peak says little about one at rest. A factor makes the bands of the other runs hold
for the run left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from fingerlab.core.text import LEVEL
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import MINIMUM_PERIODS, PeriodGrid, cross_correlation_delay
from fingerlab.thesis.prediction import ForcePrediction, judge_forces

FINE = 20
"""Samples put between two of the decimated ones, so that a peak or a delay falls on one: 2 ms."""


@dataclass(frozen=True)
class ForceNumbers:
    """One run. Forces in N; NaN where the run cannot tell. ``prediction`` as of the thesis' analysis.

    ``delay_s``: positive where the measured force comes later than the modelled one, s.
    """

    prediction: ForcePrediction
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
    measured: Array, modelled: Array, frequency_hz: float, rate: float
) -> tuple[tuple[Array, Array], PeriodGrid | None]:
    """Both forces of one stretch between their samples, as they are judged, and their whole periods.

    Args:
        frequency_hz: of the cycle; 0 where there is none. rate: samples a second.
    """
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


CELLS = 12
"""Parts of the loading cycle, each 30 degrees of the angle between force and its rate."""
LEAST_IN_CELL = 20
"""Samples (0.8 s) below which a part takes the width of the whole cycle; assumed."""
LEAST_RUNS = 2
MOST_STRETCH = 10.0
"""Beyond the forces of the calibration the width grows with the force, at most by this."""


@dataclass(frozen=True)
class RunError:
    """Modelled force of a run and modelled less measured force, by a fit that has not seen the run.

    Attributes:
        force, rate: N and N/s, (n,). error: N, (n,); all finite.
    """

    force: Array
    rate: Array
    error: Array


@dataclass(frozen=True)
class Band:
    """Half width of the interval over the loading cycle.

    Attributes:
        centre, spread, rate_spread: N, N and N/s: what makes force and rate comparable.
        reach: largest distance from ``centre`` that the calibration saw, N.
        widths: half width at the middle of each part of the cycle, N, (``CELLS``,).
        factor: what the widths of all runs but one had to be multiplied with to hold for that one; in
            ``widths`` already.
        runs: how many held-out runs stand behind it.
    """

    centre: float
    spread: float
    rate_spread: float
    reach: float
    widths: tuple[float, ...]
    factor: float
    runs: int

    def times_as_far(self, force: Array) -> float:
        """How many times as far from ``centre`` the force goes as any that the calibration saw."""
        return float(np.max(np.abs(force - self.centre), initial=0.0)) / max(self.reach, 1e-9)

    def half_width(self, force: Array, rate: Array) -> Array:
        """Half width at each sample, N, (n,); wider where the force leaves what the calibration saw."""
        angle = _angle(force, rate, self.centre, self.spread, self.rate_spread)
        middles = (np.arange(CELLS) + 0.5) * 2 * np.pi / CELLS
        width = np.interp(np.mod(angle, 2 * np.pi), middles, self.widths, period=2 * np.pi)
        beyond = np.abs(force - self.centre) / max(self.reach, 1e-9)
        return np.asarray(width * np.clip(beyond, 1.0, MOST_STRETCH))


def error_of(force: Array, measured: Array, sample_rate_hz: float) -> RunError | None:
    """The held-out error of a stretch, samples without a number left out; None where none is left."""
    rate = force_rate(force, sample_rate_hz)
    good = np.isfinite(force) & np.isfinite(measured) & np.isfinite(rate)
    if not good.any():
        return None
    return RunError(force[good], rate[good], (force - measured)[good])


def force_rate(force: Array, sample_rate_hz: float) -> Array:
    """Rate of the modelled force, N/s, (n,)."""
    return np.asarray(np.gradient(force, 1.0 / sample_rate_hz)) if len(force) > 1 else np.zeros_like(force)


def calibrate(errors: Sequence[RunError]) -> Band | None:
    """The band of held-out runs; None with fewer than two of them."""
    if len(errors) < LEAST_RUNS:
        return None
    ratios = []
    for k, left_out in enumerate(errors):
        others = _plain([e for i, e in enumerate(errors) if i != k], 1.0)
        width = np.maximum(others.half_width(left_out.force, left_out.rate), 1e-12)
        ratios.append(np.abs(left_out.error) / width)
    factor = _run_quantile(ratios)
    return _plain(errors, factor)


def _plain(errors: Sequence[RunError], factor: float) -> Band:
    force = np.concatenate([e.force for e in errors])
    rate = np.concatenate([e.rate for e in errors])
    centre, spread = float(force.mean()), float(max(force.std(), 1e-9))
    rate_spread = float(max(rate.std(), 1e-9))
    cells = [_cell(_angle(e.force, e.rate, centre, spread, rate_spread)) for e in errors]
    whole = _run_quantile([np.abs(e.error) for e in errors])
    widths = []
    for cell in range(CELLS):
        parts = [np.abs(e.error[c == cell]) for e, c in zip(errors, cells, strict=True)]
        enough = sum(len(p) for p in parts) >= LEAST_IN_CELL
        widths.append(factor * (_run_quantile(parts) if enough else whole))
    reach = float(np.max(np.abs(force - centre)))
    return Band(centre, spread, rate_spread, reach, tuple(widths), factor, len(errors))


def _run_quantile(parts: Sequence[Array]) -> float:
    """Quantile at ``LEVEL`` in which every run weighs the same, however long it is."""
    kept = [p for p in parts if len(p)]
    values = np.concatenate(kept)
    weights = np.concatenate([np.full(len(p), 1.0 / len(p)) for p in kept])
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    return float(values[order][min(int(np.searchsorted(share, LEVEL)), len(values) - 1)])


def _angle(force: Array, rate: Array, centre: float, spread: float, rate_spread: float) -> Array:
    """Place in the loading cycle, rad: 0 at the peak, a quarter turn on while loading."""
    return np.asarray(np.arctan2(rate / rate_spread, (force - centre) / spread))


def _cell(angle: Array) -> Array:
    return np.asarray(np.floor(np.mod(angle, 2 * np.pi) * CELLS / (2 * np.pi)).astype(int) % CELLS)

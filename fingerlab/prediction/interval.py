"""A 90 % interval of the modelled force, calibrated on runs that the fit has not seen.

The width is read from errors of held-out runs, so that it knows what a covariance of parameters does not:
what repeats in the error and belongs to the model, and what differs from run to run. Each held-out run is a
draw of its own (as in the jackknife+ of Barber, Candes, Ramdas and Tibshirani 2021, by runs); samples within
a run are not. The width depends on where in the loading cycle the modelled force stands: an error at the peak
says little about one at rest. A factor makes the bands of the other runs hold for the run left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.sessions.model import Array

LEVEL = 0.90
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

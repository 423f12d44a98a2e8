"""What the review of a run shows besides its curves: markers, values at a time, strokes over one another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import parsed
from fingerlab.library.pyramid import BASE, MOST_SAMPLES, Pyramid
from fingerlab.sessions.format import CHANNEL_UNITS, RATE_TOLERANCE
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.trajectory import told_frequency

MOST_CYCLES = 60
"""Strokes drawn over one another; of more than that, evenly chosen ones."""
POINTS_A_CYCLE = 400


@dataclass(frozen=True)
class Marker:
    """A moment of a run, s, with what was noted or what happened."""

    time: float
    note: str


def channels_of(run: Run) -> tuple[str, ...]:
    """The channels of the contract that a run has, without time and without those that were never read."""
    return tuple(name for name in CHANNEL_UNITS if name != "time" and run.has(name))


def markers_of(run: Run) -> tuple[Marker, ...]:
    """The markers that the recording holds, in the order of time; what is not understood is left out."""
    text = run.attributes.get("markers")
    try:
        items = parsed(text) if isinstance(text, str) else text
    except ValueError:
        return ()
    found = []
    for item in items if isinstance(items, (list, tuple)) else ():
        time = item.get("time") if isinstance(item, Mapping) else None
        if isinstance(time, (int, float)) and math.isfinite(time):
            found.append(Marker(float(time), str(item.get("note", "")) or "marker"))
    return tuple(sorted(found, key=lambda marker: marker.time))


def load_between(
    run: Run, pyramid: Pyramid, channels: Sequence[str], left: float, right: float
) -> dict[str, Array] | None:
    """Every sample between two times (s) with ``time``; None where that is more than a view may read.

    Raises:
        UserError: the file can no longer be read.
    """
    first, last = pyramid.samples_between(left, right)
    if last - first > MOST_SAMPLES:
        return None
    return run.load(["time", *channels], first, last)


def broken_at_gaps(time: Array, values: Array, rate_hz: float) -> tuple[Array, Array]:
    """The series with a NaN in each gap in time, so that no line is drawn where nothing was recorded.

    Args:
        time: s, shape (n,). values: shape (n,).
    """
    gaps = np.flatnonzero(np.diff(time) * rate_hz > 1.0 + RATE_TOLERANCE)
    if not len(gaps):
        return time, values
    return np.insert(time, gaps + 1, time[gaps]), np.insert(values, gaps + 1, np.nan)


def values_at(
    run: Run, pyramid: Pyramid, channels: Sequence[str], time: float
) -> tuple[float, dict[str, float]]:
    """The sample nearest to a time: its own time (s) and its values (SI).

    Raises:
        UserError: the file can no longer be read.
    """
    first, last = pyramid.samples_between(time, time)
    piece = run.load(["time", *channels], max(first - BASE, 0), last)
    nearest = int(np.argmin(np.abs(piece["time"] - time)))
    return float(piece["time"][nearest]), {name: float(piece[name][nearest]) for name in channels}


@dataclass(frozen=True)
class Cycles:
    """Strokes of a periodic run over one another.

    Attributes:
        period: s. count: how many are in ``series``; total: how many the run has.
        series: channel -> times within the period (s) and values, NaN between two strokes.
    """

    period: float
    count: int
    total: int
    series: Mapping[str, tuple[Array, Array]]


def period_of(run: Run) -> float | None:
    """Length of one stroke, s, as the trajectory tells it; None where the motion does not repeat so."""
    frequency = told_frequency(run)
    return None if frequency is None else 1.0 / frequency


def fold(run: Run, pyramid: Pyramid, channels: Sequence[str]) -> Cycles:
    """Lay the strokes of a run over one another, each from a whole multiple of the period.

    Raises:
        UserError: the run is not periodic, or the file can no longer be read.
    """
    period = period_of(run)
    if period is None:
        raise UserError(
            f"Run {run.name} is no sine with a frequency; strokes can be laid over one another in one."
        )
    total = int((pyramid.last_time - pyramid.first_time) / period)
    if total < 1:
        raise UserError(f"Run {run.name} is shorter than one stroke of {period:g} s.")
    chosen = np.unique(np.linspace(0, total - 1, min(total, MOST_CYCLES)).astype(int))
    parts: dict[str, list[tuple[Array, Array]]] = {name: [] for name in channels}
    for k in chosen:
        start = pyramid.first_time + k * period
        piece = load_between(run, pyramid, channels, start, start + period)
        if piece is None:
            raise UserError(f"Run {run.name} has strokes of {period:g} s, too long to lay over one another.")
        inside = np.flatnonzero((piece["time"] >= start) & (piece["time"] < start + period))
        thin = inside[:: max(len(inside) // POINTS_A_CYCLE, 1)]
        for name in channels:
            # A sample of "nothing" at the end, so that no line runs back to the beginning.
            times = np.append(piece["time"][thin] - start, period)
            parts[name].append((times, np.append(piece[name][thin], np.nan)))
    series = {
        name: (np.concatenate([t for t, _ in pieces]), np.concatenate([y for _, y in pieces]))
        for name, pieces in parts.items()
    }
    return Cycles(period, len(chosen), total, series)

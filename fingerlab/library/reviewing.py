"""The review of a run: hours of curves without reading their samples, markers, values at a time, strokes.

What a long run shows from afar is its smallest and largest values, in levels. The finest has one pair for
:data:`BASE` samples, each further level one for :data:`FACTOR` times as many. Ten hours at 1 kHz (36 million
samples) are 281,250 pairs, with the coarser levels 3.0 MB a channel in single precision; the samples would be
288 MB. A view so narrow that :data:`BASE` samples are wider than a pixel is read from the file: at most
:data:`MOST_SAMPLES`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.plain_data import parsed
from fingerlab.sessions.model import CHANNEL_UNITS, RATE_TOLERANCE, Array, Run
from fingerlab.sessions.reading import open_session
from fingerlab.sessions.trajectory import commanded_frequency

BASE = 128
FACTOR = 4
LEVELS = 6
PIECE = BASE * FACTOR ** (LEVELS - 1)
"""131,072 samples are read together: one pair of the coarsest level, 1 MB a channel."""
MOST_SAMPLES = 4 * PIECE
"""Samples read for one view, 4 MB a channel; whatever is longer is drawn from the pyramid."""


class Pyramid:
    """The pairs of one run, and the time at which each stretch begins. Filled piece by piece.

    A part that is not filled yet is NaN, and its time is what the sampling rate makes it. One thread may
    fill while another reads: what is read is then older, never wrong.
    """

    def __init__(self, run: Run, channels: Sequence[str]) -> None:
        self.length = run.length
        self.rate_hz = run.sample_rate_hz
        self.channels = tuple(channels)
        self.filled = 0
        counts = [-(-run.length // (BASE * FACTOR**k)) for k in range(LEVELS)]
        self._levels = {
            name: [np.full((count, 2), np.nan, dtype=np.float32) for count in counts] for name in channels
        }
        self._time = np.arange(counts[0]) * (BASE / run.sample_rate_hz)
        self.last_time = (run.length - 1) / run.sample_rate_hz

    @property
    def complete(self) -> bool:
        """Whether every sample has been seen."""
        return self.filled == self.length

    @property
    def first_time(self) -> float:
        """Time of the first sample, s."""
        return float(self._time[0])

    @property
    def bytes_held(self) -> int:
        """Memory of all pairs and times."""
        pairs = sum(level.nbytes for levels in self._levels.values() for level in levels)
        return pairs + self._time.nbytes

    def add(self, time: Array, samples: dict[str, Array]) -> None:
        """Take the next samples of every channel; all pieces but the last are :data:`PIECE` long."""
        start, count = self.filled, len(time)
        first = start // BASE
        own = time[::BASE]
        self._time[first : first + len(own)] = own
        rest = self._time[first + len(own) :]
        rest[:] = time[-1] + 1 / self.rate_hz + np.arange(len(rest)) * (BASE / self.rate_hz)
        self.last_time = float(time[-1]) + (self.length - start - count) / self.rate_hz
        for name in self.channels:
            pairs = _pairs(samples[name])
            for k, level in enumerate(self._levels[name]):
                place = start // (BASE * FACTOR**k)
                level[place : place + len(pairs)] = pairs
                starts = np.arange(0, len(pairs), FACTOR)
                low, high = np.fmin.reduceat(pairs[:, 0], starts), np.fmax.reduceat(pairs[:, 1], starts)
                pairs = np.column_stack((low, high))
        self.filled = start + count

    def samples_between(self, left: float, right: float) -> tuple[int, int]:
        """First sample and the one after the last that may lie between two times, s; a little more."""
        first = max(int(np.searchsorted(self._time, left)) - 1, 0) * BASE
        last = min(int(np.searchsorted(self._time, right)) + 1, len(self._time)) * BASE
        return first, min(max(last, first + 1), self.length)

    def series(self, name: str, left: float, right: float, buckets: int) -> tuple[Array, Array]:
        """A channel between two times as a line through the extremes, for a picture that is so wide.

        Args:
            buckets: pixels; from the coarsest level that still has as many stretches in between.

        Returns:
            Times (s) and values, two a stretch, at most ``2 * FACTOR * buckets`` and a few more where the
            finest level is not too coarse for the picture; NaN where nothing is filled yet.
        """
        first, last = self.samples_between(left, right)
        k = LEVELS - 1
        while k > 0 and (last - first) / (BASE * FACTOR**k) < buckets:
            k -= 1
        step = FACTOR**k
        a, b = first // BASE // step, -(-last // (BASE * step))
        pairs = self._levels[name][k][a:b].astype(np.float64)
        starts = self._time[a * step : b * step : step]
        ends = np.append(starts[1:], self._time[b * step] if b * step < len(self._time) else self.last_time)
        times = np.column_stack((starts, (starts + ends) / 2)).ravel()
        return times, pairs.ravel()

    def extremes(self, name: str) -> tuple[float, float]:
        """Smallest and largest value filled so far; NaN where there is none."""
        top = self._levels[name][-1]
        if not np.isfinite(top).any():
            return float("nan"), float("nan")
        return float(np.nanmin(top[:, 0])), float(np.nanmax(top[:, 1]))


def fill(
    pyramid: Pyramid,
    run: Run,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> None:
    """Read the rest of a run into its pyramid, a piece at a time.

    Raises:
        UserError: the file can no longer be read, or breaks the format.
        Cancelled: ``cancelled`` answered True; what is filled stays.
    """
    while not pyramid.complete:
        if cancelled is not None and cancelled():
            raise Cancelled
        start = pyramid.filled
        piece = run.load(["time", *pyramid.channels], start, min(start + PIECE, run.length))
        pyramid.add(piece["time"], piece)
        if progress is not None:
            progress(pyramid.filled / pyramid.length)


def _pairs(values: Array) -> Array:
    starts = np.arange(0, len(values), BASE)
    pairs = np.column_stack((np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)))
    return pairs.astype(np.float32)


COLUMNS = 96
CHANNEL = "motor_position"
SAMPLES_A_COLUMN = 4096
"""Of a stretch longer than this only its beginning is read: 4 s at 1 kHz, several strokes."""


@dataclass(frozen=True)
class Thumbnail:
    """Attributes: low, high: rad, shape (columns,). breaks: columns at which a new run begins."""

    low: Array
    high: Array
    breaks: tuple[int, ...]


def make_thumbnail(path: Path, columns: int = COLUMNS) -> Thumbnail:
    """Read a session's thumbnail. Each run has columns in proportion to its length, and at least one.

    Reads at most ``SAMPLES_A_COLUMN`` samples a column, however long the session is: of a ten-hour file a
    column shows the beginning of its stretch, not each spike in it.

    Raises:
        UserError: the file cannot be read as a session.
    """
    runs = [run for run in open_session(path).runs if run.has(CHANNEL)]
    if len(runs) > columns:
        runs = [runs[k] for k in np.linspace(0, len(runs) - 1, columns).astype(int)]
    lows: list[Array] = []
    highs: list[Array] = []
    breaks, used = [], 0
    for run, count in zip(runs, _shares(runs, columns), strict=True):
        breaks.append(used)
        low, high = _columns(run, count)
        lows.append(low)
        highs.append(high)
        used += count
    if not runs:
        return Thumbnail(np.empty(0), np.empty(0), ())
    return Thumbnail(np.concatenate(lows), np.concatenate(highs), tuple(breaks))


def _shares(runs: list[Run], columns: int) -> list[int]:
    """Columns of each run: one each, the rest in proportion to the lengths."""
    spare = columns - len(runs)
    ends = np.cumsum([run.length for run in runs], dtype=np.float64)
    cuts = np.rint(spare * ends / ends[-1]).astype(int) if runs else np.empty(0, dtype=int)
    return [int(n) + 1 for n in np.diff(cuts, prepend=0)]


def _columns(run: Run, count: int) -> tuple[Array, Array]:
    edges = np.linspace(0, run.length, count + 1).astype(int)
    low, high = np.full(count, np.nan), np.full(count, np.nan)
    whole = run.length <= count * SAMPLES_A_COLUMN
    values = run.channel(CHANNEL) if whole else None
    for k in range(count):
        first, last = int(edges[k]), max(int(edges[k + 1]), int(edges[k]) + 1)
        last = min(last, first + SAMPLES_A_COLUMN, run.length)
        part = values[first:last] if values is not None else run.channel(CHANNEL, first, last)
        if len(part):
            low[k], high[k] = part.min(), part.max()
    return low, high


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
    frequency = commanded_frequency(run)
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

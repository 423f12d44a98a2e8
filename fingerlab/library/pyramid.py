"""Smallest and largest value in stretches of a long run, so that hours pan without reading the samples.

The finest level has one pair for :data:`BASE` samples, each further level one for :data:`FACTOR` times as
many. Ten hours at 1 kHz (36 million samples) are 281,250 pairs, with the coarser levels 3.0 MB a channel in
single precision; the samples would be 288 MB. A view so narrow that :data:`BASE` samples are wider than a
pixel is read from the file: at most :data:`MOST_SAMPLES`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fingerlab.core.errors import Cancelled
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.reading import open_session

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
                pairs = _coarser(pairs)
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


def _coarser(pairs: Array) -> Array:
    starts = np.arange(0, len(pairs), FACTOR)
    low, high = np.fmin.reduceat(pairs[:, 0], starts), np.fmax.reduceat(pairs[:, 1], starts)
    return np.column_stack((low, high))


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

"""A session's motor position, small: smallest and largest value in each of a few columns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.reading import open_session

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

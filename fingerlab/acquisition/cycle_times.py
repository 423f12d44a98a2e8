"""How long the control loop's cycles really take: mean and longest of the last seconds."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from fingerlab.acquisition.columns import COLUMN, RowFlag
from fingerlab.sessions.model import Array

WINDOW_S = 10.0
"""Long enough to read a single long cycle, short enough to be about the present (assumed)."""


class CycleTimes:
    """Follows the measured cycle times in the rows of the ring.

    The first cycle, and the first after the device was started anew, last as long as the start takes: they
    are no cycles of the loop and are left out. Cycles that were lost make the one after them longer.
    """

    def __init__(self, rate_hz: float, seconds: float = WINDOW_S) -> None:
        self._samples = round(seconds * rate_hz)
        self._pieces: deque[tuple[int, float, int, float]] = (
            deque()
        )  # last index, sum (s), count, longest (s)
        self._before = -2

    def take(self, rows: Array) -> None:
        """Rows of the ring in their order, shape (n, columns)."""
        if not len(rows):
            return
        index = rows[:, COLUMN["index"]]
        follows = np.diff(index, prepend=self._before) == 1
        lost = (rows[:, COLUMN["flags"]].astype(np.int64) & RowFlag.LOST_BEFORE) != 0
        cycle = rows[:, COLUMN["cycle_time"]]
        good = cycle[(follows | lost) & np.isfinite(cycle)]
        self._before = int(index[-1])
        if len(good):
            self._pieces.append((self._before, float(good.sum()), len(good), float(good.max())))
        while self._pieces and self._pieces[0][0] <= self._before - self._samples:
            self._pieces.popleft()

    @property
    def mean(self) -> float:
        """Mean, s; NaN before the first cycle."""
        count = sum(piece[2] for piece in self._pieces)
        return sum(piece[1] for piece in self._pieces) / count if count else math.nan

    @property
    def longest(self) -> float:
        """Longest, s; NaN before the first cycle."""
        return max((piece[3] for piece in self._pieces), default=math.nan)

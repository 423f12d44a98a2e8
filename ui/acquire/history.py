"""The last minutes of what the bench gave: evenly spaced samples, gaps as NaN, ready to be drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fingerlab.sessions.model import Array

HISTORY_S = 240.0
"""How far one can scroll back: as far as the ring goes."""


class History:
    """A buffer whose newest samples always lie in one piece: two copies' length, moved when it is full.

    Sample ``index`` of the bench is at ``index - first``; samples that never came are NaN.
    """

    def __init__(self, names: Sequence[str], rate_hz: float, seconds: float = HISTORY_S) -> None:
        self.names = tuple(names)
        self.rate_hz = rate_hz
        self._row = {name: row for row, name in enumerate(self.names)}
        self._capacity = round(seconds * rate_hz)
        self._data = np.full((len(self.names), 2 * self._capacity), np.nan)
        self._begin = self._end = 0
        self._known: dict[str, int] = {}
        self.first = 0
        """Index of the oldest sample."""
        self.epoch = 0
        """Raised when all is forgotten: what was seen before may be other samples of the same index."""

    @property
    def stop(self) -> int:
        """Index after the newest sample."""
        return self.first + self._end - self._begin

    def __len__(self) -> int:
        return self._end - self._begin

    def clear(self, first: int = 0) -> None:
        """Forget all; the next sample is ``first``."""
        self._begin = self._end = 0
        self._known.clear()
        self.first = first
        self.epoch += 1

    def extend(self, index: Array, columns: Mapping[str, Array]) -> bool:
        """Append samples of increasing index, shape (n,); whether they follow without a gap.

        Columns that are not given are NaN until :meth:`fill`.
        """
        if not len(index):
            return True
        start, stop = int(index[0]), int(index[-1]) + 1
        whole = start == self.stop and stop - start == len(index)
        if not len(self) or start < self.stop or start - self.stop >= self._capacity:
            self.clear(start)
        room = min(stop - self.stop, self._capacity)
        if stop - self.stop > room:
            self.clear(stop - room)
        self._make_room(room)
        self._data[:, self._end : self._end + room] = np.nan
        place = self._end + np.asarray(index, dtype=np.intp) - self.stop
        good = place >= self._end
        for name, values in columns.items():
            self._data[self._row[name], place[good]] = values[good]
        self._end += room
        self._known.update(dict.fromkeys(columns, self.stop))
        self._drop_oldest()
        return whole

    def fill(self, stop: int, columns: Mapping[str, Array]) -> None:
        """Set columns of samples that end before index ``stop``, such as modelled ones that come later."""
        for name, values in columns.items():
            start = stop - len(values)
            low, high = max(start, self.first), min(stop, self.stop)
            if high > low:
                at = self._begin + low - self.first
                self._known[name] = high
                self._data[self._row[name], at : at + high - low] = values[low - start : high - start]

    def known(self, name: str) -> int:
        """Index after the newest sample of a column that will not change any more."""
        return self._known.get(name, self.first)

    def time(self, start: int, stop: int) -> Array:
        """Seconds since the bench's first sample, of samples ``start`` to ``stop``."""
        return np.arange(start, stop) / self.rate_hz

    def series(self, name: str, start: int, stop: int) -> tuple[int, Array]:
        """Samples from ``start`` to ``stop`` as far as they are here: index of the first, and a view."""
        low, high = max(start, self.first), min(stop, self.stop)
        if high <= low:
            return max(low, self.first), np.empty(0)
        at = self._begin + low - self.first
        return low, self._data[self._row[name], at : at + high - low]

    def value(self, name: str, index: int) -> float:
        """One sample, NaN where it is not here."""
        if not self.first <= index < self.stop:
            return float("nan")
        return float(self._data[self._row[name], self._begin + index - self.first])

    def _make_room(self, count: int) -> None:
        if self._end + count <= self._data.shape[1]:
            return
        kept = min(len(self), self._capacity)
        self.first = self.stop - kept
        self._data[:, :kept] = self._data[:, self._end - kept : self._end].copy()
        self._begin, self._end = 0, kept

    def _drop_oldest(self) -> None:
        extra = len(self) - self._capacity
        if extra > 0:
            self._begin += extra
            self.first += extra

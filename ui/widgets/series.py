"""Series of numbers on the screen: fewer points without losing a spike or a gap, and round ticks. No Qt.

pyqtgraph's own decimation drops the newest samples and does not handle NaN, hence this one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from fingerlab.sessions.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Series:
    """One curve: its name, the words of both axes with units, and its points, (n,) each."""

    name: str
    across: str
    up: str
    x: Array
    y: Array


@runtime_checkable
class ShowsSeries(Protocol):
    """A plot that says itself which numbers it shows, since they are no curves of pyqtgraph."""

    def shown_series(self) -> list[Series]:
        """What is shown now, to be saved as CSV."""


@runtime_checkable
class ShowsFigure(Protocol):
    """A plot that draws its own figure for paper, since it is more than curves."""

    def draw_figure(self, figure: Figure) -> None:
        """Axes and all, on an empty figure; its title comes from elsewhere."""


def envelope(x: Array, y: Array, buckets: int) -> tuple[Array, Array]:
    """Smallest and largest value of ``y`` in each of ``buckets`` stretches of equal sample count.

    Args:
        x: increasing, shape (n,), any unit. y: shape (n,), NaN where there is a gap.
        buckets: at least 1; about one for each pixel.

    Returns:
        x and y of at most ``2 * buckets`` points; x and y themselves where they are no longer than that.
        A stretch that is NaN throughout stays NaN.
    """
    count = len(x)
    if count <= 2 * buckets:
        return x, y
    edges = np.linspace(0, count, buckets + 1).astype(np.intp)
    starts = edges[:-1]
    pairs = np.empty((buckets, 2))
    pairs[:, 0] = np.fmin.reduceat(y, starts)
    pairs[:, 1] = np.fmax.reduceat(y, starts)
    # Where the stretch falls, the larger value came first: draw it in that order.
    falling = y[starts] > y[edges[1:] - 1]
    pairs[falling] = pairs[falling, ::-1]
    places = np.empty((buckets, 2))
    places[:, 0] = x[starts]
    places[:, 1] = x[edges[1:] - 1]
    return places.ravel(), pairs.ravel()


def live_envelope(first: int, y: Array, bucket: int) -> tuple[Array, Array]:
    """The same for a series that grows: buckets begin at multiples of ``bucket``, so that they do not move.

    Args:
        first: number of the first sample. y: shape (n,), NaN where there is a gap.
        bucket: samples in a bucket, at least 1.

    Returns:
        Sample numbers and values, two a bucket (smallest and largest in the order in which the series goes
        through them); the series itself where a bucket is one or two samples.
    """
    count = len(y)
    if bucket <= 2 or count < 2:
        return np.arange(first, first + count, dtype=np.float64), y
    head = -first % bucket
    starts = np.arange(head, count, bucket, dtype=np.intp)
    if head:
        starts = np.concatenate((np.zeros(1, dtype=np.intp), starts))
    stops = np.append(starts[1:], count)
    low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    falling = y[starts] > y[stops - 1]
    values = np.empty(2 * len(starts))
    values[::2] = np.where(falling, high, low)
    values[1::2] = np.where(falling, low, high)
    places = np.empty(2 * len(starts))
    places[::2] = first + starts
    places[1::2] = first + stops - 1
    return places, values


ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)


def tick_step(low: float, high: float, most: int) -> float:
    """The round step with at most ``most`` multiples on the way (two wherever that is possible); or 0."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return 0.0
    rough = span / max(most, 2)
    step = _round_up(rough)
    while math.floor(high / step + 1e-9) - math.ceil(low / step - 1e-9) < 1:
        rough /= 2
        step = _round_up(rough)
    return step


def _round_up(rough: float) -> float:
    """The smallest round step that is not below ``rough``."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(power * factor for factor in ROUND_STEPS if power * factor >= rough * (1 - 1e-9))


@lru_cache(maxsize=64)
def round_ticks(low: float, high: float, most: int) -> tuple[tuple[float, str], ...]:
    """At most ``most`` round values (at least two wherever that is possible) and how they are written.

    Steps are 1, 2 or 5 times a power of ten.
    """
    step = tick_step(low, high, most)
    if not step:
        return ()
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(
        (number * step, f"{number * step:.{digits}f}".replace("-", "−")) for number in range(first, last + 1)
    )

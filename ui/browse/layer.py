"""One run on the plots: what of it is drawn now, from memory or from samples that were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fingerlab.library.pyramid import BASE, MOST_SAMPLES, Pyramid
from fingerlab.library.reviewing import broken_at_gaps
from fingerlab.sessions.model import Array, Run

MARGIN = 1.0
"""As much again on either side is at hand, so that a short move costs nothing."""


@dataclass
class Layer:
    """Attributes: number: 0 for the run under review, else that of its line (``overlays.py``).
    shift: s, added to the run's time on the screen. samples: read last, with ``time``; version: counts how
    often there were others. name: as the legend has it.
    """

    number: int
    run: Run
    pyramid: Pyramid
    name: str = ""
    shift: float = 0.0
    samples: Mapping[str, Array] = field(default_factory=dict)
    asked: tuple[float, float] | None = None
    version: int = 0
    _broken: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time on the screen."""
        return self.pyramid.first_time + self.shift, self.pyramid.last_time + self.shift

    def take(self, samples: Mapping[str, Array]) -> None:
        """Samples that were asked for are there."""
        self.samples = samples
        self.version += 1
        self._broken = {}

    def has_samples(self, left: float, right: float) -> bool:
        """Whether the samples at hand cover what lies between two times on the screen."""
        if not self.samples:
            return False
        time, (first, last) = self.samples["time"], self.span
        return bool(
            time[0] + self.shift <= max(left, first) + 1e-9
            and time[-1] + self.shift >= min(right, last) - 1e-9
        )

    def wants_samples(self, left: float, right: float, pixels: int) -> tuple[float, float] | None:
        """Times of the run to read because the pyramid is too coarse for the picture; None for none."""
        first, last = self.pyramid.samples_between(left - self.shift, right - self.shift)
        if last - first > 2 * BASE * pixels or self.has_samples(left, right):
            return None
        wide = right - left
        for margin in (MARGIN, 0.0):
            around = left - self.shift - margin * wide, right - self.shift + margin * wide
            first, last = self.pyramid.samples_between(*around)
            if last - first <= MOST_SAMPLES:
                return around
        return None

    def series(self, name: str, left: float, right: float, pixels: int) -> tuple[Array, Array]:
        """A channel around what lies between two times on the screen, fit to be drawn."""
        first, last = self.pyramid.samples_between(left - self.shift, right - self.shift)
        if last - first <= 2 * BASE * pixels and self.has_samples(left, right):
            if name not in self._broken:
                self._broken[name] = broken_at_gaps(
                    self.samples["time"], self.samples[name], self.run.sample_rate_hz
                )
            time, values = self._broken[name]
        else:
            wide = MARGIN * (right - left)
            time, values = self.pyramid.series(
                name, left - self.shift - wide, right - self.shift + wide, round(pixels * (1 + 2 * MARGIN))
            )
        return time + self.shift, values


def limits_of(parts: list[Array], least: float) -> tuple[float, float]:
    """A range that holds all values with some air, at least so high; around 0 where there are none."""
    good = [part[np.isfinite(part)] for part in parts]
    good = [part for part in good if len(part)]
    if not good:
        return -least / 2, least / 2
    low, high = min(float(p.min()) for p in good), max(float(p.max()) for p in good)
    middle, half = (low + high) / 2, max((high - low) * 0.54, least / 2)
    return middle - half, middle + half

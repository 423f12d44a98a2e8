"""Whether a reading stands still, from its last two seconds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fingerlab.sessions.model import Array

WINDOW_S = 2.0
"""A reading is judged by its last two seconds (assumed: a placed weight swings for about one)."""
BLOCK_S = 0.25
SHARE = 0.05
"""Means over a quarter of a second may differ by this share of the distance between marks (assumed): far
less than what tells neighbouring marks apart, far more than the sensors' noise."""
RATE_HZ = 20.0
"""Rate at which calibrations are recorded, as in the thesis; faster readings are averaged down to it."""

Light = Literal["none", "moving", "stable"]


class Averager:
    """Averages readings of any rate down to :data:`RATE_HZ`; slower ones go through as they are."""

    def __init__(self) -> None:
        self._slot: int | None = None
        self._volts: list[Array] = []

    def feed(self, time: Array, volts: Array) -> tuple[Array, Array]:
        """The means that have become complete: time of the slot's start (s) and volts, shapes (m,).

        Args:
            time: s, shape (n,), increasing, also from one call to the next. volts: V, shape (n,).
        """
        slots = np.floor(time * RATE_HZ + 1e-6).astype(np.int64)
        times: list[float] = []
        means: list[float] = []
        if not len(slots):
            return np.empty(0), np.empty(0)
        starts = np.flatnonzero(np.diff(slots, prepend=slots[0] - 1))
        for start, piece in zip(starts, np.split(volts, starts[1:]), strict=True):
            slot = int(slots[start])
            if self._slot is not None and slot != self._slot:
                times.append(self._slot / RATE_HZ)
                means.append(float(np.concatenate(self._volts).mean()))
                self._volts = []
            self._slot = slot
            self._volts.append(piece)
        return np.array(times), np.array(means)


@dataclass(frozen=True)
class Stillness:
    """How still a reading stands: the light, and by how much block means differ in the window, V."""

    light: Light
    spread: float


def judge(time: Array, volts: Array, tolerance: float) -> Stillness:
    """Judge the last two seconds.

    Args:
        time: s, shape (n,), increasing. volts: V, shape (n,); NaN where nothing is read.
        tolerance: how far block means may differ, V.
    """
    if not len(time) or not np.isfinite(volts[-1]):
        return Stillness("none", float("nan"))
    recent = time > time[-1] - WINDOW_S + 1e-9
    inside, when = volts[recent], time[recent]
    if when[-1] - when[0] < WINDOW_S - 3 * BLOCK_S / 2 or not np.isfinite(inside).all():
        return Stillness("moving", float("nan"))
    blocks = np.floor((when - when[0]) / BLOCK_S + 1e-6).astype(np.int64)
    counts = np.bincount(blocks)
    means = np.bincount(blocks, inside)[counts > 0] / counts[counts > 0]
    spread = float(np.ptp(means))
    return Stillness("stable" if spread <= tolerance else "moving", spread)

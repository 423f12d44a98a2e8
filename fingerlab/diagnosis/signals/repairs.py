"""Samples that are no measurements, put right before anything is filtered: lost ones, and single spikes.

A low-pass spreads one wrong sample over a tenth of a second, and a derivative makes much of it. A spike is
told by its size against its neighbours (Hampel's identifier, Pearson, "Outliers in process modeling and
identification", 2002), on the scale of the channel's own noise; a gap of a few milliseconds is crossed on a
straight line. Both are counted, by channel, and told as findings about the bench.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fingerlab.diagnosis.settings import (
    LEAST_SPIKE,
    LEAST_SPIKE_LOCALLY,
    LONGEST_BRIDGE_S,
    MOST_SPIKES_SHARE,
    PULSE_SAMPLES,
    SPIKE_NEIGHBOURS,
)
from fingerlab.sessions.model import Array

BRIDGED = "time"
"""Under this name the samples are counted that were lost and bridged."""


def bridged(samples: Mapping[str, Array], rate: float) -> tuple[dict[str, Array], int]:
    """The samples with short gaps filled on a straight line, and how many were filled.

    Args:
        samples: channels and their ``time`` (s), (n,) each. rate: samples a second.
    """
    time = samples["time"]
    steps = np.diff(time) * rate
    lost = np.rint(steps).astype(int) - 1
    lost[(lost < 0) | (lost > max(int(LONGEST_BRIDGE_S * rate), 1))] = 0
    if not lost.any():
        return dict(samples), 0
    place = np.concatenate(([0], np.cumsum(lost + 1)))
    every = np.arange(place[-1] + 1)
    return {name: np.interp(every, place, values) for name, values in samples.items()}, int(lost.sum())


def without_spikes(values: Array) -> tuple[Array, Array]:
    """A channel with its spikes on the line between their neighbours, and where they were, (spikes,)."""
    if len(values) < 2 * SPIKE_NEIGHBOURS + 1 or not np.isfinite(values).all():
        return values, NONE
    bend = np.abs(values[1:-1] - 0.5 * (values[2:] + values[:-2]))
    middle = len(bend) // 2
    scale = max(1.4826 * float(np.partition(bend, middle)[middle]), _step(values))
    suspects = np.flatnonzero(bend > 0.5 * LEAST_SPIKE * scale) + 1
    if not len(suspects) or not scale > 0:
        return values, NONE
    # A spike bends the line at its neighbours, too; which of them it is, those further off say.
    around = np.concatenate((np.arange(-SPIKE_NEIGHBOURS, 0), np.arange(1, SPIKE_NEIGHBOURS + 1)))
    near = values[np.clip(suspects[:, None] + around, 0, len(values) - 1)]
    usual = np.median(near, axis=1)
    local = np.median(np.abs(near - usual[:, None]), axis=1)
    off = np.abs(values[suspects] - usual)
    spikes = suspects[(off > LEAST_SPIKE * scale) & (off > LEAST_SPIKE_LOCALLY * local)]
    # So many in a row are a pulse that was measured: a rotor catching up with a cable that hung loose.
    rows = np.split(spikes, np.flatnonzero(np.diff(spikes) > 1) + 1)
    spikes = np.concatenate([row for row in rows if len(row) < PULSE_SAMPLES] or [NONE])
    if not len(spikes) or len(spikes) > max(MOST_SPIKES_SHARE * len(values), 1.0):
        return values, NONE
    good = np.ones(len(values), dtype=bool)
    good[spikes] = False
    kept = np.flatnonzero(good)
    repaired = values.copy()
    repaired[spikes] = np.interp(spikes, kept, values[kept])
    return repaired, spikes


NONE = np.zeros(0, dtype=int)


def _step(values: Array) -> float:
    """The step in which a channel is read: its smallest change, where it often does not change at all."""
    changes = np.abs(np.diff(values))
    return float(changes.min(where=changes > 0, initial=np.inf)) if (changes > 0).any() else 0.0

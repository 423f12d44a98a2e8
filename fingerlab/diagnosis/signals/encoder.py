"""What the counts of an encoder tell of a position: its step, and where it was between two counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fingerlab.diagnosis.settings import LEAST_WAIT, OFTEN_STILL, WIDE_CUTOFF_HZ
from fingerlab.sessions.model import Array


def smallest_step(values: Array) -> float:
    """The step in which a channel is read: its smallest change where it often does not change; else 0.

    Of what moves many steps from each sample to the next no step is seen.
    """
    changes = np.abs(np.diff(values))
    moved = changes > 0
    often = len(changes) > 0 and np.mean(~moved) >= OFTEN_STILL
    return float(changes.min(where=moved, initial=np.inf)) if often and moved.any() else 0.0


def between_counts(position: Array, step: float, rate: float) -> Array:
    """A position, (n,), put between the counts of its encoder by the times at which they change.

    A count that is read for several samples says when the position crossed its edges, far closer than where
    it is between them. What sticks at a reversal lets go over a few counts: read in whole ones, its friction
    is off by as much as there is of it. Through the edges, and how far the position went beyond the last one
    before it turned round, goes a monotone cubic. No position leaves the count that was read. Where counts
    change faster than the filters pass, the readings stay as they are: what is off by turns is averaged out,
    but edges half a sample early or late are not, and make the acceleration rough.

    Args:
        position: as read. step: of the encoder, same unit; 0 where there is none. rate: samples a second.
    """
    new = np.flatnonzero(np.diff(position)) + 1
    if not step or len(new) < 2:
        return position
    begins, ends = np.append(0, new), np.append(new, len(position))
    lasts = (ends - begins).astype(float)
    least = max(LEAST_WAIT, 0.5 * rate / WIDE_CUTOFF_HZ)
    waits, change = lasts >= least, position[new] - position[new - 1]
    one_count = np.abs(change) < 1.5 * step
    edges = one_count & (waits[:-1] | waits[1:])
    # A count's own reading stands where it changes at once, or by more than one.
    read = np.repeat(~waits, ends - begins)
    read[begins[waits & np.append(True, ~one_count)]] = True
    read[ends[waits & np.append(~one_count, True)] - 1] = True
    turned = one_count[:-1] & one_count[1:] & (change[:-1] * change[1:] < 0.0)
    turns = np.flatnonzero(waits[1:-1] & turned) + 1
    beyond = np.sign(change[turns - 1]) * (_overshoot(lasts, turns) - 0.5) * step
    samples = np.flatnonzero(read).astype(float)
    times = np.concatenate((new[edges] - 0.5, samples, 0.5 * (begins[turns] + ends[turns] - 1.0)))
    values = np.concatenate((
        0.5 * (position[new] + position[new - 1])[edges], position[read], position[begins[turns]] + beyond
    ))  # fmt: skip
    times, first = np.unique(times, return_index=True)
    found = _monotone_cubic(times, values[first], np.arange(len(position), dtype=float))
    return np.clip(found, position - 0.5 * step, position + 0.5 * step)


def _overshoot(lasts: Array, turns: NDArray[np.intp]) -> Array:
    """How far beyond the edge, in counts, a position went in those counts in which it turned round.

    On a parabola that spends T in this count and w in the one before, T^2 / (4 w (T + w)); one that would go
    further than the count is wide has rested in it, nobody knows where.

    Args:
        lasts: samples for which each reading lasted, (counts,). turns: some of them, neither first nor last.
    """
    here = lasts[turns]
    before, after = (
        here**2 / (4.0 * beside * (here + beside)) for beside in (lasts[turns - 1], lasts[turns + 1])
    )
    found = 0.5 * (before + after)
    return np.where(found < 1.0, found, 0.5)


def _monotone_cubic(times: Array, values: Array, at: Array) -> Array:
    """A cubic through points, (m,), at times (n,), that turns round at none but them.

    Fritsch and Butland (1984); as ``scipy.interpolate.PchipInterpolator``, without the quarter of a second
    that importing it takes.
    """
    width = np.diff(times)
    rise = np.diff(values) / width
    slopes = np.zeros(len(times))
    same = rise[:-1] * rise[1:] > 0.0
    left, right = (2.0 * width[1:] + width[:-1])[same], (width[1:] + 2.0 * width[:-1])[same]
    slopes[1:-1][same] = (left + right) / (left / rise[:-1][same] + right / rise[1:][same])
    place = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(width) - 1)
    way = np.clip((at - times[place]) / width[place], 0.0, 1.0)
    tangent = width[place]
    return np.asarray(
        values[place] * (1.0 + 2.0 * way) * (1.0 - way) ** 2
        + values[place + 1] * way**2 * (3.0 - 2.0 * way)
        + tangent * way * (1.0 - way) * (slopes[place] * (1.0 - way) - slopes[place + 1] * way)
    )

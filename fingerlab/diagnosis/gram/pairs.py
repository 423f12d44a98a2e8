"""Runs of one motion, before a known change of the machine and with it, as sums over their difference.

What a machine does in every run that no law tells is in both and cancels; what follows from the change
stays. The difference is divided by the root of two, so that it is as noisy as one run.
"""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.gram.decimation import Decimated
from fingerlab.diagnosis.gram.sums import PairSums, Sums
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.sessions.model import Array


def pair_sums(
    numbers: tuple[int, int], group: GroupKey, before: Decimated, after: Decimated
) -> PairSums | None:
    """The sums over a pair's first stretches; None: they have no moments in common.

    Constants are taken out: the sensors are set anew where a machine is changed.
    """
    common = in_common(before, after)
    return None if common is None else sums_of_difference(numbers, group, *common)


def in_common(before: Decimated, after: Decimated) -> tuple[Array, Array] | None:
    """Signals of both where the cable is taut and the motor moves in both, (n, signals) each."""
    count = min(len(before.time), len(after.time))
    common = (before.taut & ~before.rest)[:count] & (after.taut & ~after.rest)[:count]
    if common.sum() < 2:
        return None
    return before.columns[:count][common], after.columns[:count][common]


def difference_alone(first: Array, second: Array) -> Sums:
    """The sums over their difference, see :class:`PairSums`."""
    apart = _apart(first, second)
    return Sums(apart.T @ apart, taut_samples=len(apart))


def _apart(first: Array, second: Array) -> Array:
    apart = (second - first) / np.sqrt(2.0)
    return np.asarray(apart - apart.mean(axis=0))


def sums_of_difference(numbers: tuple[int, int], group: GroupKey, first: Array, second: Array) -> PairSums:
    """The sums over two runs' signals at the same moments, (n, signals) each."""
    apart = _apart(first, second)
    mean = 0.5 * (first + second)
    mean = mean - mean.mean(axis=0)
    sums = Sums(apart.T @ apart, taut_samples=len(apart))
    return PairSums(*numbers, group, sums, apart.T @ mean, mean.T @ mean)

"""Covariance of what a fitted model leaves of its equations, all of it or what does not repeat.

Where nothing repeats, noise and misfit look alike. All that a model leaves is its noise then: its weights are
those of greatest likelihood, and a model that leaves less is rewarded by its density alone.
"""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.groups import Group
from fingerlab.diagnosis.model import Model
from fingerlab.diagnosis.sums import BoolArray
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array


def row_covariance(
    model: Model, values: Array, group: Group, products: Array, samples: float, only: BoolArray | None = None
) -> Array:
    """Covariance (5, 5) of the equations' residuals.

    Args:
        products: of the model's active features, (k, k), over ``samples``.
        only: picks active features, (k,); None takes all.
    """
    h = model.features(values, group)
    if only is not None:
        h = np.where(only, h, 0.0)
    spread = np.zeros((len(h), len(Row)))
    spread[np.arange(len(h)), model.rows] = h
    return np.asarray(spread.T @ products @ spread / max(samples, 1.0))


def noise_covariance(model: Model, values: Array, group: Group) -> Array:
    """Covariance (5, 5) of what does not repeat in the equations' residuals, of one sample."""
    if not group.repeats:
        return row_covariance(model, values, group, group.whole.of(model.pick), group.samples)
    return row_covariance(model, values, group, group.noise[model.pick.square], group.noise_samples)


def floor_covariance(model: Model, values: Array, group: Group, weights: Array) -> Array:
    """The same for the floor that an answer tells, (5, 5): where nothing repeats, that of the ``weights``.

    They are the last model's, whose misfit counts as noise for all others.
    """
    if group.repeats:
        return noise_covariance(model, values, group)
    exist = np.flatnonzero(np.diag(weights) > 0)
    floor = np.zeros_like(weights)
    floor[np.ix_(exist, exist)] = np.linalg.inv(weights[np.ix_(exist, exist)])
    return floor

"""What a model leaves of the difference between two runs of one motion, before a known change and with it.

A model that is right tells the difference down to its noise. One that is wrong in the same way in both runs
does so, too: the pair says nothing of it. What is left says how wrong the model is about the change.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.fit.noise import noise_of_a_sample
from fingerlab.diagnosis.fit.weights import feature_weights, own_to_a_run, temperature
from fingerlab.diagnosis.gram.sums import Group, PairSums
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import MOST_PAIRED
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.sessions.model import Array


def paired_misfit(fitted: FittedModel, pair: PairSums, group: Group) -> tuple[float, float]:
    """Chi-square of a pair's difference without noise, and the independent values behind it.

    A friction that wanders between the two runs explains what it may.
    """
    model, values = fitted.model, fitted.fit.values
    told, pick = model.features(values, group), model.pick
    weights = feature_weights(fitted.weights[group.key], pick.rows) * EFFECTIVE_SHARE
    square = float(told @ (pair.difference.of(pick, noise_of_a_sample(group, pick.square)) * weights) @ told)
    own = own_to_a_run(model, values, told, group)
    if own.shape[1]:
        across, mean = (pick.among(products) * weights for products in (pair.across, pair.mean))
        pull = told @ across @ own
        square -= float(pull @ np.linalg.solve(own.T @ mean @ own + np.eye(own.shape[1]), pull))
    return square, EFFECTIVE_SHARE * group.equations * pair.difference.samples


def paired_log_odds(candidates: Sequence[FittedModel]) -> Array:
    """Log odds of models by what they leave of the pairs, against the best, (models,); 0 without pairs.

    They are limited, for the fits have seen the runs, too.
    """
    if not candidates or not len(candidates[0].paired):
        return np.zeros(len(candidates))
    left = np.array([np.maximum(one.paired[:, 0], 0.0) for one in candidates])  # (models, pairs)
    counts, best = candidates[0].paired[:, 1], left.min(axis=0)
    heat = np.array([temperature(m, c) for m, c in zip(best, counts, strict=True)])
    log = -0.5 * ((left - best) / heat).sum(axis=1)
    return np.asarray(np.maximum(log - log.max(), -MOST_PAIRED))


def paired_score(fitted: FittedModel, pair: int) -> float:
    """Error of a pair's difference in units of its floor; 1.0 is the floor."""
    square, count = fitted.paired[pair]
    return float(np.sqrt(1.0 + max(square, 0.0) / max(count, 1.0)))

"""How far the numbers of a model depend on the shapes of its effects, which no run tells exactly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import log_odds_of_misfits
from fingerlab.diagnosis.settings import LOOKING_ITERATIONS
from fingerlab.sessions.model import Array


def variance_over_shapes(scorer: Scorer, fitted: FittedModel) -> dict[str, float]:
    """Variance of every unknown, by key and in the model's units, over the shapes of the model's effects.

    About the values told, every shape by the odds by which laws are told apart: of friction that sticks only
    size over travel may show, and both are told at the one travel that left least.

    Args:
        scorer: on the shapes around those of the model; where there are none nothing is added.
    """
    found: dict[str, float] = {}
    for k, choice in enumerate(fitted.choices):
        if len(choice.effect.shapes) < 2:
            continue
        before, after = fitted.choices[:k], fitted.choices[k + 1 :]
        shapes = (Choice(choice.effect, i) for i in range(len(choice.effect.shapes)))
        tried = [
            scorer.score_in_sample(scorer.fit_same_law([*before, one, *after], fitted, LOOKING_ITERATIONS))
            for one in shapes
        ]
        left = np.array([max(one.misfit, 0.0) / max(one.count, 1.0) for one in tried])
        for key, variance in weighted_variance(fitted.values, [one.values for one in tried], left).items():
            found[key] = found.get(key, 0.0) + variance
    return found


def weighted_variance(
    told: Mapping[str, float], others: list[dict[str, float]], left: Array
) -> dict[str, float]:
    """Mean square by which unknowns differ from what is told of them, by key.

    Args:
        others: values of other models. left: squared score above one that each leaves, (models,).
    """
    log_odds = log_odds_of_misfits(left)
    share = np.exp(log_odds - log_odds.max())
    share /= share.sum()
    return {
        key: float(share @ [(one.get(key, value) - value) ** 2 for one in others])
        for key, value in told.items()
    }

"""The floor where no motion comes again: what the last model leaves, or a law of the state, if that is less.

Noise and misfit look alike there, and every model was weighed by what it leaves itself. That alone would make
any last model perfect. So each of its equations is asked what a law of the measured state, which knows no
physics, would still tell of its residual in runs that the law has not seen. Where it tells much, the residual
is no noise: the floor is what that law leaves, and the model stands above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.equations.model import Choice, Model
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.fit.noise import row_covariance
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.state_law import (
    left_out_covariance,
    told_by,
    torque_variance,
    variance_of_noise,
    without_run_means,
)
from fingerlab.diagnosis.gram.sums import ALL_NOISE, Group, TorqueNoise
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import (
    FULL_ITERATIONS,
    LEAST_NOISE,
    LEAST_STATE_SHARE,
    TOLD_BY_MEMORY,
    TOLD_BY_PATH,
)
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array


def weights_at_floor(reduction: Reduction, fitted: FittedModel) -> Weights:
    """Inverse covariance of the equations' floors, (5, 5) by group, below a model under its own weights.

    Raises:
        UserError: a run cannot be read. Cancelled: the user asked for it.
    """
    effects = at_found_shapes(fitted)
    reduced = reduction.by_state(effects)
    scorer = Scorer(replace(reduced, constants=reduction.constants, fixed=reduction.fixed))
    model = scorer.model([Choice(effect) for effect in effects], fitted.model.tip_law)
    values = np.array([fitted.values[u.key] for u in model.unknowns])
    found = {}
    for group in scorer.reduced.groups:
        weights = fitted.weights[group.key]
        share = np.ones(5) if group.repeats else _share_of_state(group, model, values)
        found[group.key] = weights / np.sqrt(np.outer(share, share))
    return found


def scored_in_floors(
    scorer: Scorer, fitted: Sequence[FittedModel], weights: Weights
) -> tuple[Scorer, list[FittedModel]]:
    """Models, fitted and held out under the weights at the floor, and what scores them in its units."""
    above = scorer.with_floor_weights()
    again = [above.fit(one.choices, one, FULL_ITERATIONS, weights) for one in fitted]
    return above, [above.score_held_out(one, residuals=True) for one in again]


def noise_below_floor(
    reduction: Reduction, first: tuple[Scorer, FittedModel], last: tuple[Scorer, FittedModel]
) -> TorqueNoise:
    """What is noise of that which no law of the state tells of a motor's torque, where nothing repeats.

    All of it, but where a law with memory, or one of each run's own, tells most of it and far more than a
    path of effects explains: then no model is right that leaves just that.

    Args:
        first: model of the path, with what scored it. last: the same.

    Raises:
        UserError: a run cannot be read.
    """
    reduced, (_, fitted) = first[0].reduced, last
    groups = reduced.groups
    if not (reduced.on_bench and any(group.bounded for group in groups)):
        return ALL_NOISE
    floor = max(1.0 / float(fitted.weights[group.key][Row.BENCH, Row.BENCH]) for group in groups)
    # A score does not count what a motor holds that sticks, nor how far below the floor a model comes.
    before, after = (min(one[1].score ** 2 * floor, _torque_left(*one)) for one in (first, last))
    if after < LEAST_NOISE * torque_variance([run for group in groups for run in group.state_products]):
        return ALL_NOISE
    runs = reduction.torque_with_memory()
    if reduced.constants is not None and reduced.constants.move_torque:
        runs = without_run_means(runs)
    noise = max(variance_of_noise(runs), LEAST_STATE_SHARE * floor)
    explained = (before - after) / max(before - noise, LEAST_STATE_SHARE * before)
    if noise >= TOLD_BY_MEMORY * floor or explained >= TOLD_BY_PATH:
        return ALL_NOISE
    return TorqueNoise(noise / floor, told_by(runs, noise))


def _torque_left(scorer: Scorer, fitted: FittedModel) -> float:
    """Mean square of what a model leaves of a motor's torque, (N m)^2."""
    model, values, groups = fitted.model, fitted.fit.values, scorer.reduced.groups
    squares = [
        row_covariance(model, values, group, group.whole.of(model.pick), 1.0)[Row.BENCH, Row.BENCH]
        for group in groups
    ]
    return float(sum(squares)) / max(sum(group.samples for group in groups), 1.0)


def _share_of_state(group: Group, model: Model, values: Array) -> Array:
    """Mean square of what a law of the state leaves of each equation's residual, in that of it all, (5,)."""
    coefficients, size = model.features(values, group), group.whole.products.shape[0]
    runs, rows = group.state_products, sorted({int(row) for row in model.rows})
    if not runs:
        return np.ones(len(Row))
    functions = len(runs[0][0]) - size
    residual = np.zeros((len(runs[0][0]), functions + len(rows)))
    residual[:functions, :functions] = np.eye(functions)
    for place, row in enumerate(rows):
        mine = model.rows == row
        np.add.at(residual[:, functions + place], functions + model.pick.signals[mine], coefficients[mine])
    of_rows = [[residual.T @ block @ residual for block in blocks] for blocks in runs]
    whole = np.diag(sum(sum(blocks) for blocks in of_rows))
    there = np.flatnonzero(whole[functions:] > 0.0)
    kept = np.array([*range(functions), *(functions + there)])
    square = np.ix_(kept, kept)
    left = left_out_covariance([[block[square] for block in blocks] for blocks in of_rows], len(there))
    share = np.ones(len(Row))
    if left is not None:
        own = whole[functions + there] / max(float(whole[0]), 1.0)
        share[np.array(rows)[there]] = np.clip(np.diag(left) / own, LEAST_STATE_SHARE, 1.0)
    return share

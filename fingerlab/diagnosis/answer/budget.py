"""What the mean squared error of each family of equations is made of: parts that add up to it.

The whole is the error of the model as given on runs left out of the fit. The path's models stand between it
and the floor, each with less of it; what one step takes away is a part:

* an *effect*: what the error falls by where it joins the model, in the order of the path; and, where the
  path holds few, what it falls by in every other order,
* *parameters* and *calibration*: what the last model misses on runs left out beyond what it misses where it
  has seen them all. It goes to the sensors as far as knowing their constants exactly would narrow what the
  model predicts, and to the bench's and the effects' constants for the rest,
* *between runs*: what a friction that wanders and a tip that is set down anew take up, a value for each run,
  beyond what the floor holds of it,
* the *floor*: the same as everywhere in the answer, by the last model,
* the *unknown*: what is left.

No part is below nothing or above the whole. What one effect takes away and a later one brings back is no
fall: an effect has what is still gone at the end of the path. An error that no model of the path lowers, and
one below the floor, is all floor and what is left: there is nothing to mend.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from fingerlab.diagnosis.answer.error_parts import Budget, BudgetPart, EquationError
from fingerlab.diagnosis.answer.errors import equation_errors, squares_by_family
from fingerlab.diagnosis.answer.results import PathStep
from fingerlab.diagnosis.equations.parameters import CABLE_OFFSET, TORQUE_ZERO
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import FULL_ITERATIONS, MOST_ORDERED
from fingerlab.sessions.model import Array

CALIBRATION = frozenset(
    {"torque_gain", TORQUE_ZERO, "force_gain", "load_gain", CABLE_OFFSET, "delay", "bench_offset"}
)
"""Unknowns of the sensors: gains of the current and of the load cell, zeros of the current and of the motor,
and the clock between the channels. A joint's constant torque may be its zero or its friction: it is none."""


def error_budget(
    base: FittedModel, errors: Mapping[str, EquationError], steps: Sequence[PathStep],
    path: Sequence[FittedModel], scorer: Scorer,
) -> dict[str, Budget]:  # fmt: skip
    """The budget of every family that the answer tells an error of.

    Args:
        base: the model as given. errors: its own, on runs left out, with the floors that the answer tells.
        steps: the path as it is told.
        path: its models, ``base`` first, under the weights of the last. scorer: of the later ones.
    """
    models = [base, *(scorer.score_held_out(one, residuals=True) for one in path[1:])]
    levels = [{name: error.rmse**2 for name, error in errors.items()}]
    levels += [_squares(scorer, one) for one in models[1:]]
    kept = {name: still_gone([level[name] for level in levels]) for name in errors}
    last = models[-1]
    seen = _squares(scorer, scorer.residuals_in_sample(last))
    alike = _squares(scorer, scorer.residuals_in_sample(last, own=True))
    falls = _in_any_order(scorer, models, levels, steps)
    spreads = _spreads(scorer, last)
    result = {}
    for name, error in errors.items():
        whole, after = kept[name][0], kept[name][-1]
        floor = min(after, error.floor**2)
        ends = np.maximum(np.minimum.accumulate([after, seen[name], alike[name], floor]), floor)
        uncertain, between, unknown = ends[:-1] - ends[1:]
        sensors, by_sensor, by_bench = spreads[name]
        parts = []
        for k, step in enumerate(steps[1:]):
            low, high, average = falls[name][k] if falls[name] else (None, None, None)
            fall = kept[name][k] - kept[name][k + 1]
            change = step.added or "", step.removed or ""
            parts.append(BudgetPart("effect", fall, *change, low, high, average, title=step.title))
        parts += [
            BudgetPart("unknown", unknown),
            BudgetPart("parameters", (1.0 - sensors) * uncertain, parameter=by_bench),
            BudgetPart("calibration", sensors * uncertain, parameter=by_sensor),
            BudgetPart("between_runs", between),
            BudgetPart("floor", floor),
        ]
        result[name] = Budget(
            error.unit, whole, tuple(replace(p, mean_square=float(p.mean_square)) for p in parts)
        )
    return result


def still_gone(levels: Sequence[float]) -> list[float]:
    """Squared errors along a path where what comes back later never went; none is above the first."""
    after = np.maximum.accumulate(levels[:0:-1])[::-1]
    return [levels[0], *(float(one) for one in np.minimum(after, levels[0]))]


def _squares(scorer: Scorer, fitted: FittedModel) -> dict[str, float]:
    return {name: error.rmse**2 for name, error in equation_errors(scorer.reduced, fitted).items()}


Falls = list[tuple[float, float, float]]
"""Of each effect of a path: least, most and average; none: there is one order, or too many."""


def _in_any_order(
    scorer: Scorer,
    models: Sequence[FittedModel],
    levels: Sequence[Mapping[str, float]],
    steps: Sequence[PathStep],
) -> dict[str, Falls]:
    """By how much each effect of the path lets an error fall, whatever stands in the model already.

    The average is over orders, each of which counts the same, as Shapley's is.
    """
    families, end = list(levels[0]), models[-1]
    names = [step.added for step in steps[1:] if step.added and not step.removed]
    keep = len(models[0].choices)
    many = len(names) != len(steps) - 1 or not 2 <= len(names) <= MOST_ORDERED
    if many or sorted(end.effect_ids[keep:]) != sorted(names):
        return {family: [] for family in families}
    known = {frozenset(names[:k]): level for k, level in enumerate(levels)}
    for size in range(1, len(names)):
        for chosen in map(frozenset, combinations(names, size)):
            if chosen not in known:
                choices = [c for k, c in enumerate(end.choices) if k < keep or c.effect.id in chosen]
                fitted = scorer.fit(choices, end, FULL_ITERATIONS, end.weights)
                known[chosen] = _squares(scorer, scorer.score_held_out(fitted, residuals=True))
    result: dict[str, Falls] = {}
    for family in families:
        falls: dict[str, list[float]] = {name: [] for name in names}
        for order in permutations(names):
            along = still_gone([known[frozenset(order[:k])][family] for k in range(len(order) + 1)])
            for name, before, after in zip(order, along, along[1:], strict=False):
                falls[name].append(before - after)
        result[family] = [(min(each), max(each), float(np.mean(each))) for each in falls.values()]
    return result


def _spreads(scorer: Scorer, fitted: FittedModel) -> dict[str, tuple[float, str, str]]:
    """What of the error that uncertain values make is the sensors', 0 to 1, by family.

    With the unknown of the sensors, and that of all others, whose exact value would narrow it most.
    """
    reduced, model, values = scorer.reduced, fitted.model, fitted.fit.values
    bends: dict[str, Array] = {}
    counts: dict[str, float] = {}
    for group in reduced.groups:
        jacobian = model.coefficients(values, group)[1]
        products = group.whole.of(model.pick)
        for name, (weights, _) in squares_by_family(reduced, fitted, group).items():
            bend = jacobian.T @ (products * weights[np.ix_(model.rows, model.rows)]) @ jacobian
            bends[name] = bends.get(name, np.zeros_like(bend)) + bend
            counts[name] = counts.get(name, 0.0) + group.samples
    covariance = fitted.fit.covariance
    sensor = np.array([not u.effect and u.name in CALIBRATION for u in model.unknowns])
    keys = [u.key for u in model.unknowns]
    result = {}
    for name, bend in bends.items():
        # Knowing one value exactly takes this off the trace of bend times covariance.
        gains = np.einsum("ij,jk,ki->i", covariance, bend, covariance) / np.maximum(
            np.diag(covariance), 1e-300
        )
        whole = float(np.sum(bend * covariance))
        left = float(np.sum(bend * _knowing(covariance, sensor))) if sensor.any() else whole
        share = float(np.clip(1.0 - left / whole, 0.0, 1.0)) if whole > 0.0 else 0.0
        result[name] = (share, _largest(gains, sensor, keys), _largest(gains, ~sensor, keys))
    return result


def _knowing(covariance: Array, known: Array) -> Array:
    """The covariance of all where those that are ``known`` (p,) are told exactly, (p, p)."""
    across = covariance[:, known]
    return np.asarray(
        covariance - across @ np.linalg.pinv(covariance[np.ix_(known, known)], hermitian=True) @ across.T
    )


def _largest(gains: Array, among: Array, keys: Sequence[str]) -> str:
    places = np.flatnonzero(among)
    return keys[places[int(np.argmax(gains[places]))]] if len(places) else ""

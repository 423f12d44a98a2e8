"""Models fitted and scored: to all runs, and on runs held out of the fit.

A run that was left out is predicted with constants that the others tell only so well. Its score is that of
the predictive density: the misfit at the best values, less what values that the others allow as well would
explain, and the price of having to find them. What a run has of its own is no failure of the model's law.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.diagnosis.equations.features import BoolArray
from fingerlab.diagnosis.equations.model import Choice, Model, build
from fingerlab.diagnosis.equations.parameters import TIP_LAWS, TORQUE_ZERO
from fingerlab.diagnosis.fit.noise import (
    fill_missing_noise,
    first_weights,
    limit_noise,
    noise_covariance,
    noise_weights,
    row_covariance,
)
from fingerlab.diagnosis.fit.solver import Fit, Fitter, LeftOut, starting_arms, surprise
from fingerlab.diagnosis.fit.weights import Data, FoldNumbers, Weighted, Weights, change, own_to_a_run
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.score.fitted_model import Trial, reach
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.sessions.model import Array

FULL_ITERATIONS = 8
"""A fit of so many iterations is meant to end, not to look round."""
SETTLED = 0.05
"""Weights that change by no larger share belong to their fit: a score then changes by some per mille."""
MOST_ROUNDS = 8


@dataclass
class Study:
    """The reduced sessions, and the weights under which models are compared."""

    reduced: Reduced
    weights: Weights = field(default_factory=dict)
    arms: dict[str, float] = field(default_factory=dict)
    touches: bool = False
    models: dict[tuple[object, ...], Model] = field(default_factory=dict)
    _scored: tuple[Weights, dict[int, tuple[Fit, Fitter]]] = field(default_factory=lambda: ({}, {}))

    def __post_init__(self) -> None:
        self.arms = starting_arms(self.reduced.layout, self.reduced.groups)
        fill_missing_noise(self.reduced)
        with ThreadPoolExecutor() as threads:  # large matrices, for once: a core each
            list(threads.map(limit_noise, self.reduced.groups))
        if not self.weights:
            self.weights = {g.key: first_weights() for g in self.reduced.groups}
        self.data = Data(self.reduced.groups)
        self.touches = any(g.in_contact for g in self.reduced.groups)

    def start_values(self, model: Model, like: Trial | None = None) -> Array:
        """Start of a fit: the values of ``like`` where they are shared, else arms from a regression."""
        values = model.start()
        known = dict(self.arms)
        if like is not None:
            known |= dict(zip((u.key for u in like.model.unknowns), like.fit.values, strict=True))
        for key, value in known.items():
            if key in model.index:
                values[model.index[key]] = value
        return np.clip(values, model.low, model.high)

    def fit(self, choices: Sequence[Choice], like: Trial | None = None, iterations: int = 10) -> Trial:
        """Fit nominal model, nuisances and ``choices`` to all runs.

        A fit to the end takes the law of the tip that fits best, others that of ``like``.
        """
        trial = self.fit_like(choices, like, iterations)
        return trial if iterations < FULL_ITERATIONS else self.with_best_law(trial, iterations)

    def fit_like(self, choices: Sequence[Choice], like: Trial | None, iterations: int) -> Trial:
        """The same with the law of the tip that ``like`` has."""
        return self._fit(choices, "slides" if like is None else like.model.tip_law, like, iterations)

    def with_best_law(self, trial: Trial, iterations: int) -> Trial:
        """The trial, or the same under another law of the tip if that fits better."""
        if not self.touches:
            return trial
        laws = [law for law in TIP_LAWS if law != trial.model.tip_law]
        others = [self._fit(trial.model.choices, law, trial, iterations) for law in laws]
        return min([trial, *others], key=lambda t: t.fit.cost)

    def _fit(self, choices: Sequence[Choice], law: str, like: Trial | None, iterations: int) -> Trial:
        model = self.model(choices, law)
        fit = Fitter(model, self.data, self.weights).run(self.start_values(model, like), iterations)
        return Trial(model, fit)

    def model(self, choices: Sequence[Choice], law: str = "slides") -> Model:
        """The model with these effects; built once, for most are fitted again under other weights."""
        key = (law, *((c.effect.id, c.shape) for c in choices))
        if key not in self.models:
            self.models[key] = build(self.reduced.layout, self.reduced.groups, choices, law)
        return self.models[key]

    def count(self, trial: Trial) -> Trial:
        """The trial with its misfit on every group of runs, in sample."""
        fitter = self._fitter(trial)
        misfits = self._in_sample(fitter, trial)
        return replace(
            trial,
            misfits=misfits,
            in_sample=misfits,
            touching=self._touching(),
            held_out=False,
            widening=fitter.widening,
            surprise=self._surprise(trial),
        )

    def told(self, trial: Trial) -> Trial:
        """A scored trial with what only an answer tells of it: its misfit in sample, and its effect's reach.

        Under the weights that it was scored with.
        """
        fitter = self._fitter(trial)
        in_sample = trial.in_sample if len(trial.in_sample) else self._in_sample(fitter, trial)
        return replace(trial, in_sample=in_sample, reach=reach(fitter, trial))

    def _in_sample(self, fitter: Fitter, trial: Trial) -> Array:
        """Chi-square without noise and independent values of each condition, (conditions, 2)."""
        return np.array(
            [
                self._square(fitter, trial.fit.values, i, tuple(group.of_condition(c)))
                for i, group in enumerate(self.reduced.groups)
                for c in group.conditions
            ]
        )

    def hold_out(self, trial: Trial, residuals: bool = False) -> Trial:
        """The same model with every run scored by a fit that has not seen it.

        The folds of one turn are left out together. A group with one run only is scored in sample. With
        ``residuals`` the equations' own residuals are kept too.
        """
        groups = self.reduced.groups
        scored: dict[tuple[int, int], list[tuple[float, float]]] = {}
        products = {g.key: np.zeros((5, 5)) for g in groups}
        fitter = self._fitter(trial)
        for turn in sorted({fold.turn for g in groups for fold in g.dealt}):
            left = fitter.without(trial.fit.values, turn)
            for i, group in enumerate(groups):
                unseen = group.of_turn(turn)
                for k, fold in enumerate(group.dealt):
                    if fold.turn == turn:
                        one = self._square(fitter, left.values, i, (k,), left if k in unseen else None)
                        scored.setdefault((i, fold.condition), []).append(one)
                        if residuals:
                            products[group.key] += self._products(trial.model, left.values, i, k)
        misfits = [np.sum(scored[i, c], axis=0) for i, g in enumerate(groups) for c in g.conditions]
        means = {g.key: products[g.key] / max(g.samples, 1) for g in groups}
        return replace(
            trial,
            misfits=np.array(misfits),
            in_sample=np.zeros((0, 2)),
            touching=self._touching(),
            held_out=True,
            residuals=means if residuals else {},
            widening=fitter.widening,
            surprise=self._surprise(trial),
        )

    def _touching(self) -> BoolArray:
        """Which conditions of all groups are in contact, (conditions,)."""
        return np.array([g.in_contact for g in self.reduced.groups for _ in g.conditions])

    def _surprise(self, trial: Trial, zero_spread: float | None = None) -> float:
        routings = {g.key[0] for g in self.reduced.groups if not g.in_contact}
        return surprise(trial.model, trial.fit.values, self.reduced.radius, routings, zero_spread)

    def narrowed(self, trial: Trial) -> float:
        """By how much a run of the motor alone would make the trial's constants more of a surprise."""
        return self._surprise(trial, self.zero_spread) - self._surprise(trial)

    @property
    def zero_spread(self) -> float:
        """Spread of the current's zero, N m."""
        return self.reduced.layout.nuisances[TORQUE_ZERO].typical

    def _fitter(self, trial: Trial) -> Fitter:
        """What scores the trial; kept while the weights stay, for what an answer tells asks it again."""
        if self._scored[0] is not self.weights:
            self._scored = self.weights, {}
        known = self._scored[1]
        if id(trial.fit) not in known:
            fitter = Fitter(trial.model, self.data, self.weights)
            fitter.hold(trial.fit.values)
            known[id(trial.fit)] = trial.fit, fitter  # with the fit, so that its identity stays its own
        return known[id(trial.fit)][1]

    def reweigh(self, trial: Trial) -> None:
        """Take the noise covariance that the trial's own features leave between cycles as the new weights."""
        model, values = trial.model, trial.fit.values
        self.weights = {g.key: noise_weights(model, values, g) for g in self.reduced.groups}

    def settle(self, choices: Sequence[Choice], like: Trial | None = None) -> Trial:
        """Fit and reweigh until the weights belong to the fit."""
        trial = self.fit(choices, like)
        for _ in range(MOST_ROUNDS):
            before = self.weights
            self.reweigh(trial)
            trial = self.fit(choices, trial)
            if change(before, self.weights) < SETTLED:
                break
        return trial

    def level(self, trial: Trial) -> float:
        """Twice the negative log density that noise alone has under the present weights, of all values.

        What a misfit lacks for likelihoods under different weights to be comparable: a model that calls more
        of its residual noise has a smaller misfit, and a lower density everywhere.
        """
        result = 0.0
        for group in self.reduced.groups:
            exist = np.diag(self.weights[group.key]) > 0
            weights = self.weights[group.key][np.ix_(exist, exist)]
            noise = noise_covariance(trial.model, trial.fit.values, group)[np.ix_(exist, exist)]
            each = float(np.trace(weights @ noise) - np.linalg.slogdet(weights)[1])
            result += EFFECTIVE_SHARE * group.samples * each
        return result

    def _square(
        self, fitter: Fitter, values: Array, i: int, part: FoldNumbers, left: LeftOut | None = None
    ) -> tuple[float, float]:
        """Reproducible chi-square of some folds of group i, and the independent values behind it.

        ``left``: what the other runs tell, where the fit has not seen these.
        """
        fold, sums = self.data.raw(i, part), fitter.part(i, part)
        group = self.reduced.groups[i]
        h = fitter.model.features(values, group)
        own = own_to_a_run(fitter.model, values, h, group, group.dealt[part[0]].condition)
        square = float(h @ sums.matrix @ h)
        if left is None:
            square -= explained(own, h, sums)
        else:
            square -= allowance(own, h, sums, fitter.model.coefficients(values, group)[1], left)
        return square, EFFECTIVE_SHARE * group.equations * fold.samples

    def _products(self, model: Model, values: Array, i: int, k: int) -> Array:
        """Sums of residual products over a fold, (5, 5); slack moments count where they are charged."""
        group = self.reduced.groups[i]
        fold = group.folds[k]
        products, slack = fold.of(model.pick), fold.slack(model.pick)
        if slack is not None and not model.slack_free:
            products = products + slack
        return row_covariance(model, values, group, products, 1.0)


def explained(own: Array, h: Array, sums: Weighted) -> float:
    """What of a misfit the run's own share of the features explains, less what that costs: as a Gaussian.

    Args:
        own: what one standard deviation of each part adds to the features, (k, parts).
        h: the features' coefficients, (k,). sums: weighted products of the features over the run.
    """
    if not own.shape[1]:
        return 0.0
    pull = own.T @ sums.matrix @ h
    stiffness = own.T @ sums.curvature @ own + np.eye(own.shape[1])
    return float(pull @ np.linalg.solve(stiffness, pull))


def allowance(own: Array, h: Array, sums: Weighted, jacobian: Array, left: LeftOut) -> float:
    """The same for a run that was left out, with what the constants may be otherwise, in twice log density.

    Args:
        jacobian: derivatives of the coefficients, (k, p). left: what the other runs tell.
    """
    free = np.flatnonzero(left.free)
    size = len(free)
    basis = np.concatenate((jacobian[:, free], own), axis=1)
    stiffness = np.eye(basis.shape[1])
    stiffness[:size, :size] = left.information[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.diag(stiffness))  # the unknowns have units of their own
    basis = basis * scale
    stiffness = stiffness * np.outer(scale, scale)
    after = stiffness + basis.T @ sums.curvature @ basis
    pull = basis.T @ sums.matrix @ h
    found = float(np.linalg.slogdet(after[:size, :size])[1] - np.linalg.slogdet(stiffness[:size, :size])[1])
    return float(pull @ np.linalg.solve(after, pull)) - found

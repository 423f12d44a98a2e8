"""Models fitted and scored: to all runs, and on runs held out of the fit.

A run that was left out is predicted with constants that the others tell only so well. Its score is that of
the predictive density: the misfit at the best values, less what values that the others allow as well would
explain, and the price of having to find them. What a run has of its own is no failure of the model's law.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from functools import cached_property
from operator import attrgetter

import numpy as np

from fingerlab.diagnosis.equations.model import Choice, Model, build
from fingerlab.diagnosis.equations.parameters import TIP_LAWS, TORQUE_ZERO
from fingerlab.diagnosis.fit.data import Data, FoldNumbers, Weights, change, random_effect_columns
from fingerlab.diagnosis.fit.noise import (
    add_encoder_noise,
    fill_missing_noise,
    first_weights,
    noise_covariance,
    noise_weights,
    products_of_rows,
)
from fingerlab.diagnosis.fit.priors import prior_penalty, starting_arms
from fingerlab.diagnosis.fit.random_effects import explained, own_share
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.gram.run_constants import EquationWeights, Offsets, RunConstants
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.score.fitted_model import FittedModel, FoldErrors, paired_misfit, sensitivity
from fingerlab.diagnosis.settings import FULL_ITERATIONS, HOPELESS, MOST_ROUNDS, SETTLED, USUAL_ITERATIONS
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array


class Scorer:
    """Fits and scores models on reduced sessions.

    What it is asked depends on its arguments alone: a fitted model brings the weights that it is scored
    under. Only what follows from values is kept (models, and what scores one).

    Attributes:
        reduced: the sessions; their noise is filled in and limited here.
        data: what a fit is shown of them.
    """

    def __init__(self, reduced: Reduced) -> None:
        self.reduced = reduced
        with ThreadPoolExecutor() as threads:  # large matrices, for once: a core each
            list(threads.map(attrgetter("whole"), reduced.groups))
            self._arms = starting_arms(reduced.layout, reduced.groups)
            add_encoder_noise(reduced)
            fill_missing_noise(reduced)
        self.data = Data(reduced.groups, reduced.constants)
        self._models: dict[tuple[object, ...], Model] = {}
        self._fitters: dict[tuple[object, ...], Fitter] = {}
        self._fitters_weights: tuple[bytes, ...] = ()
        self._above_weights = False

    @cached_property
    def bare(self) -> FittedModel:
        """The nominal model with its nuisances alone, under its own weights."""
        return self.fit_reweighted([])

    def with_constants(self, constants: RunConstants) -> Scorer:
        """The same on sessions whose runs have these constants of their own.

        Of a motor's torque they are no noise either.
        """
        if constants.move_torque and any(g.bounded for g in self.reduced.groups):
            return Scorer(replace(self.reduced, groups=self._without_bound(), constants=constants))
        other = self.fresh()
        other.reduced = replace(self.reduced, constants=constants)
        other.data = Data(self.reduced.groups, constants)
        other.__dict__.pop("bare", None)
        return other

    def with_late_told(self) -> Scorer:
        """The same for a motor alone, with a floor that a torque which is logged late does not pass below."""
        return Scorer(replace(self.reduced, groups=self._without_bound(), late_is_no_noise=True))

    def _without_bound(self) -> list[Group]:
        """The groups with nothing known of a noise that no law of the state tells."""
        return [replace(g, noise_samples=0.0, bounded=False) if g.bounded else g for g in self.reduced.groups]

    def with_late_torque(self) -> Scorer:
        """The same for a motor alone whose torque may be logged later than its position."""
        other = self.fresh()
        other.reduced = replace(self.reduced, layout=replace(self.reduced.layout, late_torque=True))
        other._models = {}
        other.__dict__.pop("bare", None)
        return other

    def with_floor_weights(self) -> Scorer:
        """The same, with a misfit above what the weights stand for where nothing repeats, too."""
        other = self.fresh()
        other._above_weights = True
        return other

    def fresh(self) -> Scorer:
        """The same, with nothing kept of what it has scored."""
        other = copy(self)
        other._fitters, other._fitters_weights = {}, ()
        return other

    @property
    def first_weights(self) -> Weights:
        """Weights before anything is known of the noise."""
        return {g.key: first_weights() for g in self.reduced.groups}

    @property
    def zero_spread(self) -> float:
        """Spread of the current's zero, N m."""
        return self.reduced.layout.nuisances[TORQUE_ZERO].typical

    def model(self, choices: Sequence[Choice], law: str = "slides") -> Model:
        """The model with these effects; built once, for most are fitted again under other weights."""
        key = _model_key(law, choices)
        if key not in self._models:
            layout = self.reduced.layout
            model = build(layout, self.reduced.groups, choices, law)
            self._models[key] = model.fixing(
                {u.key: self.reduced.fixed[u.key] / layout.scales.of(u.parameter.unit)
                 for u in model.unknowns if u.key in self.reduced.fixed}
            )  # fmt: skip
        return self._models[key]

    def start_values(self, model: Model, like: FittedModel | None = None) -> Array:
        """Start of a fit: the values of ``like`` where they are shared, else arms from a regression."""
        values = model.start()
        known = dict(self._arms)
        if like is not None:
            known |= like.values
        for key, value in known.items():
            if key in model.index:
                values[model.index[key]] = value
        return np.clip(values, model.low, model.high)

    def fit(
        self,
        choices: Sequence[Choice],
        like: FittedModel | None = None,
        iterations: int = USUAL_ITERATIONS,
        weights: Weights | None = None,
    ) -> FittedModel:
        """Fit nominal model, nuisances and ``choices`` to all runs.

        A fit to the end takes the law of the tip that fits best, others that of ``like``.

        Args:
            like: where the fit starts. weights: those of ``like`` if not given, else the first ones.
        """
        fitted = self.fit_same_law(choices, like, iterations, weights)
        return fitted if iterations < FULL_ITERATIONS else self.with_best_law(fitted, iterations)

    def fit_from_each(
        self, choices: Sequence[Choice], starts: Sequence[FittedModel], weights: Weights
    ) -> FittedModel:
        """The best fit to the end of those that begin at each of the models.

        Where a tip may stick or slide a fit has more than one end: a model is not to look worse than one with
        an effect more, which contains it, because it began elsewhere.
        """
        found = [self.fit(choices, one, FULL_ITERATIONS, weights) for one in starts]
        return min(found, key=lambda one: one.fit.cost)

    def fit_same_law(
        self,
        choices: Sequence[Choice],
        like: FittedModel | None,
        iterations: int,
        weights: Weights | None = None,
        law: str = "",
    ) -> FittedModel:
        """As :meth:`fit` with a law of the tip; empty: that of ``like``."""
        if weights is None:
            weights = self.first_weights if like is None else like.weights
        model = self.model(choices, law or ("slides" if like is None else like.model.tip_law))
        fit = Fitter(model, self.data, weights).run(self.start_values(model, like), iterations)
        return FittedModel(model, fit, weights)

    def with_best_law(self, fitted: FittedModel, iterations: int) -> FittedModel:
        """The model, or the same under another law of the tip if that fits better.

        Not one that leaves less than nothing: through it more of the recordings is noise than they hold.
        Noise alone scatters by some roots of the number of values; one for each value is far beyond that.
        """
        if not any(g.in_contact for g in self.reduced.groups):
            return fitted
        laws = [law for law in TIP_LAWS if law != fitted.model.tip_law]
        others = [self.fit_same_law(fitted.choices, fitted, iterations, law=law) for law in laws]
        return min([fitted, *others], key=lambda one: (one.fit.cost < -self.data.count, one.fit.cost))

    def own_weights(self, fitted: FittedModel) -> Weights:
        """Inverse of the noise covariance that the model's own features leave between cycles."""
        return {g.key: noise_weights(fitted.model, fitted.fit.values, g) for g in self.reduced.groups}

    def fit_reweighted(
        self,
        choices: Sequence[Choice],
        like: FittedModel | None = None,
        weights: Weights | None = None,
        most: float = np.inf,
    ) -> FittedModel:
        """Fit and reweigh until the weights belong to the fit; it starts as :meth:`fit` does.

        A model that comes out far above ``most``, a deviance, may be left half done.

        A tip that sticks leaves the weights wide in contact, and under wide weights nothing speaks against
        it: one that slides is then seen under its own weights, too.
        """
        settled = self._settled(self.fit(choices, like, weights=weights), most=most)
        if settled.model.tip_law == "slides" or not any(g.in_contact for g in self.reduced.groups):
            return settled
        sliding = self._settled(self.fit_same_law(choices, settled, FULL_ITERATIONS, law="slides"), "slides")
        return min(settled, sliding, key=self.deviance)

    def _settled(self, fitted: FittedModel, law: str | None = None, most: float = np.inf) -> FittedModel:
        """The model fitted again until its weights belong to it; under one ``law`` of the tip if told.

        Where fit and weights chase each other, as where noise is far above the motion in contact, the
        likeliest; it is known when they are where they have been before.
        """
        found: list[FittedModel] = []
        for _ in range(MOST_ROUNDS):
            before, weights = fitted.weights, self.own_weights(fitted)
            if law is None:
                fitted = self.fit(fitted.choices, fitted, weights=weights)
            else:
                fitted = self.fit_same_law(fitted.choices, fitted, FULL_ITERATIONS, weights, law)
            if change(before, fitted.weights) < SETTLED:
                return fitted
            if self.deviance(fitted) > most + HOPELESS * self.data.count:
                return fitted
            found.append(fitted)
            if any(change(one.weights, fitted.weights) < SETTLED for one in found[:-1]):
                break
        return min(found, key=self.deviance)

    def deviance(self, fitted: FittedModel) -> float:
        """Minus twice the log density of the data under a model and its own weights, up to a constant."""
        return fitted.fit.cost + self.noise_deviance(fitted)

    def noise_deviance(self, fitted: FittedModel) -> float:
        """Minus twice the log density that noise alone has under the model's weights, of all values.

        What a misfit lacks for likelihoods under different weights to be comparable: a model that calls more
        of its residual noise has a smaller misfit, and a lower density everywhere.
        """
        result = 0.0
        for group in self.reduced.groups:
            weights = fitted.weights[group.key]
            exist = np.diag(weights) > 0
            noise = noise_covariance(fitted.model, fitted.fit.values, group)
            each = np.trace(weights @ noise) - np.linalg.slogdet(weights[np.ix_(exist, exist)])[1]
            # Where a cable hangs loose its equation is taken to be as far off as its noise, in every model.
            less = np.trace(EquationWeights.of(weights).where_slack @ noise) + 1.0
            slack = group.whole.slack_samples * float(weights[Row.CABLE, Row.CABLE] > 0.0)
            result += EFFECTIVE_SHARE * float(group.samples * each + slack * less)
        return result

    def score_in_sample(self, fitted: FittedModel, residuals: bool = False) -> FittedModel:
        """The model with its misfit on every condition, by its values as they are.

        With ``residuals`` the equations' own residuals are kept too.
        """
        fitter = self._fitter(fitted)
        misfits = self._in_sample(fitter, fitted)
        found = self._scored(fitted, fitter, misfits=misfits, in_sample=misfits, held_out=False)
        if not residuals:
            return found
        return replace(found, residuals=self.residuals_in_sample(fitted).residuals)

    def score_held_out(self, fitted: FittedModel, residuals: bool = False) -> FittedModel:
        """The model with every run scored by a fit that has not seen it.

        The folds of one split are left out together. A group with one fold only is scored in sample. With
        ``residuals`` the equations' own residuals are kept too, and what is left fold by fold.
        """
        groups, values, fitter = self.reduced.groups, fitted.fit.values, self._fitter(fitted)
        products = {g.key: np.zeros((5, 5)) for g in groups}
        by_fold = {g.key: FoldErrors(np.zeros(len(g.dealt)), np.zeros((len(g.dealt), 5, 5))) for g in groups}
        seen = self._in_sample_folds(fitter, fitted)
        unseen = [folds.copy() for folds in seen]
        for split in sorted({fold.split for g in groups for fold in g.dealt}):
            left = fitter.without(values, split)
            for i, group in enumerate(groups):
                for k in group.of_split(split):
                    unseen[i][k, 0] += fitter.predictive_misfit(i, k, left)
                if residuals:
                    for k in (k for k, fold in enumerate(group.dealt) if fold.split == split):
                        found = self._products(fitter, left.values, i, k)
                        products[group.key] += found
                        by_fold[group.key].residuals[k] = found
        for group, folds in zip(groups, unseen, strict=True):
            by_fold[group.key].misfits[:] = folds[:, 0]
        misfits = np.array(
            [folds[g.of_condition(c)].sum(axis=0) for g, folds in zip(groups, unseen, strict=True)
             for c in g.conditions]
        )  # fmt: skip
        means = {g.key: products[g.key] / max(g.samples, 1) for g in groups} if residuals else {}
        # Of two conditions each may allow what the other does, and no values both: a model leaves no less on
        # runs that were left out than where it has seen them all.
        in_sample = self._of_conditions(seen)
        self._no_less(by_fold, seen, misfits, in_sample)
        misfits[:, 0] = np.maximum(misfits[:, 0], in_sample[:, 0])
        scored_model = self._scored(fitted, fitter, misfits=misfits, in_sample=in_sample, held_out=True)
        return replace(scored_model, residuals=means, folds=by_fold if residuals else {})

    def _no_less(
        self, by_fold: Mapping[GroupKey, FoldErrors], seen: Sequence[Array], held_out: Array, in_sample: Array
    ) -> None:
        """Let the folds of a condition leave what they do in sample where all of them together leave more so.

        Args:
            seen: as of :meth:`_in_sample_folds`. held_out, in_sample: of the conditions, (conditions, 2).
        """
        conditions = [(i, c) for i, group in enumerate(self.reduced.groups) for c in group.conditions]
        for (i, condition), out, within in zip(conditions, held_out, in_sample, strict=True):
            if within[0] > out[0]:
                group = self.reduced.groups[i]
                mine = group.of_condition(condition)
                by_fold[group.key].misfits[mine] = _no_less_than_nothing(seen[i][mine])[:, 0]

    def with_sensitivity(self, fitted: FittedModel) -> FittedModel:
        """A scored model with what only an answer needs: its misfit in sample, and its sensitivity."""
        fitter = self._fitter(fitted)
        in_sample = fitted.in_sample if len(fitted.in_sample) else self._in_sample(fitter, fitted)
        return replace(fitted, in_sample=in_sample, sensitivity=sensitivity(fitter, fitted))

    def penalty_of_bench_run(self, fitted: FittedModel) -> float:
        """By how much a run of the motor alone would add to the penalty of the model's constants."""
        return self._prior_penalty(fitted, self.zero_spread) - self._prior_penalty(fitted)

    def _scored(
        self, fitted: FittedModel, fitter: Fitter, misfits: Array, in_sample: Array, held_out: bool
    ) -> FittedModel:
        return replace(
            fitted,
            misfits=misfits,
            in_sample=in_sample,
            in_contact=np.array([g.in_contact for g in self.reduced.groups for _ in g.conditions]),
            held_out=held_out,
            runs=sum(g.independent_runs for g in self.reduced.groups),
            widening=fitter.widening,
            prior_penalty=self._prior_penalty(fitted),
            paired=self._paired(fitted),
        )

    def _paired(self, fitted: FittedModel) -> Array:
        """What is left of every pair's difference, (pairs, 2)."""
        groups = {g.key: g for g in self.reduced.groups}
        found = [paired_misfit(fitted, pair, groups[pair.group]) for pair in self.reduced.pairs]
        return np.array(found).reshape(-1, 2)

    def _prior_penalty(self, fitted: FittedModel, zero_spread: float | None = None) -> float:
        routings = {g.key[0] for g in self.reduced.groups if not g.in_contact}
        return prior_penalty(fitted.model, fitted.fit.values, self.reduced.radius, routings, zero_spread)

    def _fitter(self, fitted: FittedModel) -> Fitter:
        """What scores the model; those under the last weights are kept, for an answer asks them again."""
        weights = tuple(fitted.weights[g.key].tobytes() for g in self.reduced.groups)
        if weights != self._fitters_weights:
            self._fitters, self._fitters_weights = {}, weights
        key = (*_model_key(fitted.model.tip_law, fitted.choices), fitted.fit.values.tobytes())
        if key not in self._fitters:
            fitter = Fitter(fitted.model, self.data, fitted.weights)
            fitter.set_friction_weights(fitted.fit.values)
            self._fitters[key] = fitter
        return self._fitters[key]

    def _in_sample(self, fitter: Fitter, fitted: FittedModel) -> Array:
        """Chi-square without noise and independent values of each condition, (conditions, 2)."""
        return self._of_conditions(self._in_sample_folds(fitter, fitted))

    def _in_sample_folds(self, fitter: Fitter, fitted: FittedModel) -> list[Array]:
        """The same of each fold of every group, (folds, 2) each: without what its runs have of their own."""
        values, found = fitted.fit.values, []
        coefficients = fitter.coefficients(values)[0]
        for i, (group, h) in enumerate(zip(self.reduced.groups, coefficients, strict=True)):
            sums, samples = fitter.folds(i), np.array([fold.samples for fold in group.folds])
            squares = np.array([float(one @ h) for one in h @ sums.matrix])
            for condition in group.conditions:
                mine = group.of_condition(condition)
                own = random_effect_columns(fitter.model, values, h, group, condition)
                squares[mine] -= explained(own, h, sums[mine])
            if self._above_weights and not group.repeats:
                exist = np.count_nonzero(np.diag(fitter.weights[group.key]))
                squares -= EFFECTIVE_SHARE * samples * exist
            found.append(np.stack((squares, EFFECTIVE_SHARE * samples * group.equations), axis=1))
        return found

    def _of_conditions(self, folds: Sequence[Array]) -> Array:
        """What the folds of every condition have together, (conditions, 2)."""
        each = (
            found[group.of_condition(c)]
            for group, found in zip(self.reduced.groups, folds, strict=True)
            for c in group.conditions
        )
        return np.array([_no_less_than_nothing(found).sum(axis=0) for found in each])

    def run_offsets(self, fitted: FittedModel) -> list[Offsets]:
        """The constants that the runs of every group have of their own beside a scored model."""
        fitter = self._fitter(fitted)
        found = [self._offsets(fitter, fitted.fit.values, i, None) for i in range(len(self.reduced.groups))]
        return [one.by_run() for one in found if one is not None]

    def _offsets(self, fitter: Fitter, values: Array, i: int, part: FoldNumbers | None) -> Offsets | None:
        if self.data.constants is None:
            return None
        group, model = self.reduced.groups[i], fitter.model
        coefficients = model.features(values, group)
        return self.data.offsets(i, part, model, coefficients, fitter.equation_weights(i))

    def residuals_in_sample(self, fitted: FittedModel, own: bool = False) -> FittedModel:
        """The model with the mean products of its residuals where it has seen every run.

        Args:
            own: take off what a run has of its own: a friction that wanders, how a tip was set down.
        """
        fitter, values = self._fitter(fitted), fitted.fit.values
        coefficients, found = fitter.coefficients(values)[0], {}
        for i, group in enumerate(self.reduced.groups):
            products = np.zeros((5, 5))
            for k, fold in enumerate(group.dealt):
                h = coefficients[i]
                if own:
                    h = h + own_share(
                        random_effect_columns(fitter.model, values, h, group, fold.condition),
                        h,
                        fitter.part(i, (k,)),
                    )
                products += self._products(fitter, values, i, k, h)
            found[group.key] = products / max(group.samples, 1)
        return replace(fitted, residuals=found)

    def _products(
        self, fitter: Fitter, values: Array, i: int, k: int, coefficients: Array | None = None
    ) -> Array:
        """Sums of residual products over a fold, (5, 5); slack moments count where they are charged.

        Args:
            coefficients: of the model's features, (k,); None: those of the ``values``.
        """
        group, model = self.reduced.groups[i], fitter.model
        fold = group.folds[k]
        products, slack = fold.of(model.pick), fold.slack_cable(model.pick)
        if slack is not None and not model.slack_free:
            products = products + slack
        if coefficients is None:
            coefficients = model.features(values, group)
        found = products_of_rows(model, coefficients, products)
        if self.data.constants is None:
            return found
        offsets = self.data.offsets(i, (k,), model, coefficients, fitter.equation_weights(i))
        if offsets is None:
            return found
        return offsets.taken_off(found, model, coefficients, self.data.totals(i, (k,)))


def _no_less_than_nothing(folds: Array) -> Array:
    """Misfit and number of values of the folds of a condition, (folds, 2), none of them noise below nothing.

    A model whose steep law turns the sensors' noise into more than there is, by more than a value each, is as
    far off as that.
    """
    misfit, values = folds.sum(axis=0)
    return folds if misfit >= -values else folds * np.array([-1.0, 1.0])


def _model_key(law: str, choices: Sequence[Choice]) -> tuple[object, ...]:
    """What tells models on the same sessions apart."""
    return (law, *((c.effect.id, c.shape, c.effect.widened) for c in choices))

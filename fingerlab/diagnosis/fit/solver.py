"""Fitting a model to Gram matrices: Gauss-Newton within bounds, priors as extra observations.

What one run has of its own is integrated out, and what a friction holds at rest is weighed apart. Both follow
from the friction's size, so that size is found first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from fingerlab.diagnosis.equations.coefficients import DELAY
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.equations.parameters import CHANGED_OFFSET, LOSSES
from fingerlab.diagnosis.fit.bounded_step import bounded_step, scaled_inverse
from fingerlab.diagnosis.fit.data import (
    Data,
    FeatureProducts,
    FoldNumbers,
    Weighted,
    Weights,
    random_effect_columns,
    tells_set_down,
    temperature_of,
)
from fingerlab.diagnosis.fit.random_effects import BoundTerms, LeftOut, RandomEffects
from fingerlab.diagnosis.gram.run_constants import EquationWeights, schur_complement, taken_up_by_folds
from fingerlab.diagnosis.gram.sums import feature_weights
from fingerlab.diagnosis.settings import (
    LEAST_GAIN,
    LEAST_GAIN_SHARE,
    MOST_ITERATIONS,
    RUN_VARIATION_BOUND,
    SETTLING_ITERATIONS,
    STEP_FRACTIONS,
    WEAK_PRIOR,
)
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.sessions.model import Array, IntArray

FIXED_WEIGHT = 1e12
"""Weight of the prior of an unknown that is fixed: its deviation is a millionth of what it usually is."""


@dataclass(frozen=True)
class Fit:
    """Best values and their inverse covariance (information), with the cost reached.

    ``with_own``: the information if nothing in a run were its own; None: nothing is.
    """

    values: Array
    information: Array
    cost: float
    with_own: Array | None = None

    @cached_property
    def covariance(self) -> Array:
        """Of the unknowns, (p, p)."""
        return scaled_inverse(self.information)

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of every unknown, given what else is unknown, (p,)."""
        return self.deviations_at(1.0)

    def deviations_at(self, temperature: float) -> Array:
        """The same where what the model leaves weighs so many times less, (p,); not what runs differ by."""
        by_noise = self.covariance if self.with_own is None else scaled_inverse(self.with_own)
        return np.sqrt(np.maximum(np.diag(self.covariance + (temperature - 1.0) * by_noise), 0.0))


@dataclass(frozen=True)
class Slopes:
    """How a cost changes around some values.

    Attributes:
        gradient: half of it, (p,). bend: Gauss-Newton curvature without noise, (p, p).
        held: curvature of the priors, (p, p). jacobian: of the features' coefficients, (groups, k, p).
        beyond: curvature with noise that the bounds of what runs have of their own add, (p, p) each.
    """

    gradient: Array
    bend: Array
    held: Array
    jacobian: Array
    beyond: list[Array]


def predictive_misfit(left: LeftOut, pull: Array, bend: Array, low: Array, high: Array) -> float:
    """What a run adds to the cost of the others, each at its best, beyond its own misfit at the fit of all.

    Both are looked at from the fit of all runs, near which the cost is a parabola: where the others hardly
    tell some constants, theirs is far away, and what noise is taken off there is no longer that of the
    recordings.

    Args:
        left: what the others tell. pull, bend: half the slope, (p,), and the curvature, (p, p), of the run's
            misfit there. low, high: bounds of a step, (p,).
    """
    gradient, information = left.gradient + pull, left.information + bend
    step = bounded_step(np.zeros(len(pull)), gradient, information, low, high)
    return left.fall - _fall(gradient, information, step) + left.widening(bend)


def _fall(gradient: Array, information: Array, step: Array) -> float:
    """By how much a parabola falls along a step."""
    return -float(2.0 * gradient @ step + step @ information @ step)


class Fitter:
    """Fits one model; keeps the weighted Gram matrices that all its iterations share."""

    def __init__(self, model: Model, data: Data, weights: Weights) -> None:
        self.model = model
        self.data = data
        self.weights = weights
        self._parts: dict[tuple[int, FoldNumbers | None], Weighted] = {}
        self._folds: dict[int, Weighted] = {}
        self._constants: dict[int, tuple[Array, Array] | None] = {}
        self._stacked: Weighted | None = None
        self._cables = tuple(g.cable_sign for g in data.groups)
        self._whole: tuple[Array, list[tuple[Array, Array]], tuple[Array, Array]] | None = None
        self.has_stiction = bool(model.stiction) and any(g.whole.rest is not None for g in data.groups)
        self.widening = 0.0  # see Data.stiction_weights, all groups together
        self._stiction: list[Array | None] = [None] * len(data.groups)
        self.has_random_effects = bool(model.run_varying) or bool(model.set_down.any())
        self._own: dict[int, list[RandomEffects]] = {}  # by group
        self._still: dict[int, Array] = {}
        self._weight: dict[int, Array] = {}
        self._change: dict[int, Array] = {}
        self._slack: dict[int, Array] = {}
        self._mean = model.start()
        self._stiffness = self._prior_weight() / model.spread**2
        self._prior_information = np.diag(self._stiffness)
        self._low, self._high = model.low, model.high

    @property
    def sums(self) -> list[Weighted]:
        """Weighted products over each group, less what is a run's own."""
        found = []
        for i in range(len(self.data.groups)):
            whole = self.part(i, None)
            for one in self._own.get(i, ()):  # integrated out as a Gaussian: it tells nothing of other runs
                taken = one.schur_complement_of_all
                whole = Weighted(whole.curvature - taken.curvature, whole.matrix - taken.matrix)
            found.append(whole)
        return found

    def _weighed(
        self, own: dict[int, list[RandomEffects]], coefficients: Array
    ) -> dict[int, list[RandomEffects]]:
        """The runs' own parts, held the more firmly the more the model leaves all the same.

        What weighs less than its face value must not be bought with a friction of each run's own.
        """
        groups = self.data.groups
        left = sum(float(h @ self.part(i, None).matrix @ h) for i, h in enumerate(coefficients))
        left -= sum(one.explained(coefficients[i]) for i, each in own.items() for one in each)
        temperature = temperature_of(left, EFFECTIVE_SHARE * sum(g.equations * g.samples for g in groups))
        bound = RUN_VARIATION_BOUND / np.sqrt(temperature)  # of the narrower distribution, too
        return {
            i: [replace(one, precision=temperature, bound=bound) for one in each] for i, each in own.items()
        }

    def _seen(self, i: int) -> Weighted:
        """Weighted products over every fold as they count in those of the group, (folds, k, k)."""
        sums = self.folds(i)
        if i not in self._own:
            return sums
        seen = Weighted(sums.curvature.copy(), sums.matrix.copy())
        for one in self._own[i]:
            seen.curvature[one.folds] -= one.schur_complement.curvature
            seen.matrix[one.folds] -= one.schur_complement.matrix
        return seen

    def stacked(self) -> Weighted:
        """The same for all groups together, (groups, k, k)."""
        if self._stacked is None:
            sums = self.sums
            self._stacked = Weighted(
                np.stack([s.curvature for s in sums]), np.stack([s.matrix for s in sums])
            )
        return self._stacked

    def part(self, i: int, part: FoldNumbers | None) -> Weighted:
        """Weighted products over group ``i``, or over some of its folds."""
        if part is not None and len(part) == 1 and len(self.data.groups[i].folds) > 1:
            return self.folds(i)[part[0]]
        if (i, part) not in self._parts:
            found = self._weighted(i, self.data.gathered(i, part, self.model))
            constants = self._by_constants(i)
            if constants is not None:
                posterior_covariance, pull = (one[self.data.runs_of(i, part)] for one in constants)
                found = found.less(schur_complement(pull, posterior_covariance, pull))
            self._parts[i, part] = found
        return self._parts[i, part]

    def folds(self, i: int) -> Weighted:
        """The same over each of the folds of group ``i``, (folds, k, k)."""
        if i not in self._folds:
            count = len(self.data.groups[i].folds)
            if count == 1:
                self._folds[i] = self.part(i, None)[None]
                return self._folds[i]
            found = self._weighted(i, self.data.gathered_folds(i, self.model))
            constants = self._by_constants(i)
            if constants is not None:
                runs = [self.data.runs_of(i, (k,)) for k in range(count)]
                found = found.less(taken_up_by_folds(*constants, runs))
            self._folds[i] = found
        return self._folds[i]

    def _weighted(self, i: int, gathered: FeatureProducts) -> Weighted:
        """What was gathered in group ``i``, weighted."""
        return self.data.weighted(
            gathered, self.model, self._weight_of(i), partial(self._less, i), partial(self._where_slack, i)
        )

    def _weight_of(self, i: int) -> Array:
        """Weight of each product of the model's features in group ``i``, (k, k)."""
        if i not in self._weight:
            self._weight[i] = self._of_products(self.weights[self.data.groups[i].key])
        return self._weight[i]

    def _by_constants(self, i: int) -> tuple[Array, Array] | None:
        """How well the constants of a group's runs are known, and the features' products with them."""
        if self.data.constants is None:
            return None
        if i not in self._constants:
            constants = self.data.by_constants(i, None, self.equation_weights(i), [self.model.pick])
            self._constants[i] = None if constants is None else (constants[0], constants[1][0])
        return self._constants[i]

    def _of_products(self, weights: Array) -> Array:
        """Weight of each product of the model's features, (k, k), from that of the equations, (5, 5)."""
        return EFFECTIVE_SHARE * feature_weights(weights, self.model.rows)

    def _less(self, i: int) -> Array:
        """How the weight of each product changes where the motor stands, (k, k)."""
        if i not in self._change:
            self._change[i] = self._of_products(self.standing(i))
        return self._change[i]

    def _where_slack(self, i: int) -> Array:
        """The same where the cable is slack, (k, k)."""
        if i not in self._slack:
            weights = self.weights[self.data.groups[i].key]
            self._slack[i] = self._of_products(EquationWeights.of(weights).where_slack)
        return self._slack[i]

    def equation_weights(self, i: int) -> EquationWeights:
        """Those of group ``i``, and what comes on top of them."""
        return EquationWeights.of(self.weights[self.data.groups[i].key], self.standing(i))

    def standing(self, i: int) -> Array:
        """How the weights of group ``i`` change where the motor stands, (5, 5)."""
        if i not in self._still:
            self._still[i] = self.data.standing(i, self.weights[self.data.groups[i].key])
        stiction = self._stiction[i]
        return self._still[i] if stiction is None else self._still[i] + stiction

    def set_friction_weights(self, values: Array, apart: bool = True, trusted: bool = False) -> None:
        """Weigh the moments at rest, and what differs from run to run, as the friction of ``values`` does.

        ``apart``: whether what is a run's own is set apart; ``trusted``: as if the model left nothing.
        """
        if not (self.has_stiction or self.has_random_effects):
            return
        coefficients = self.model.terms.of(values, self._cables)
        self._stacked = self._whole = None
        if self.has_stiction:
            found = [
                self.data.stiction_weights(i, self.model, coefficients[i], self.weights[g.key])
                for i, g in enumerate(self.data.groups)
            ]
            self._stiction = [None if one is None else one[0] for one in found]
            self.widening = sum(one[1] for one in found if one is not None)
            resting = {i for i, one in enumerate(found) if one is not None}  # others are weighed as before
            self._parts = {key: one for key, one in self._parts.items() if key[0] not in resting}
            self._folds = {i: one for i, one in self._folds.items() if i not in resting}
            self._change = {i: one for i, one in self._change.items() if i not in resting}
            self._constants = {i: one for i, one in self._constants.items() if i not in resting}
        if self.has_random_effects and apart:
            self._own = self._random_effects(values, coefficients, trusted)
            if not trusted:
                self._own = self._weighed(self._own, coefficients)

    def _random_effects(
        self, values: Array, coefficients: Array, trusted: bool
    ) -> dict[int, list[RandomEffects]]:
        """What the runs have of their own, by group; no group is there without any.

        ``trusted``: however far it would go.
        """
        result: dict[int, list[RandomEffects]] = {}
        bound = np.inf if trusted else RUN_VARIATION_BOUND
        for i, group in enumerate(self.data.groups):
            alike: dict[bool, list[int]] = {}  # conditions whose runs have the same parts
            for condition in group.conditions:
                alike.setdefault(tells_set_down(group, condition), []).append(condition)
            for conditions in alike.values():
                parts = random_effect_columns(self.model, values, coefficients[i], group, conditions[0])
                folds = np.array(sorted(k for c in conditions for k in group.of_condition(c)))
                if parts.shape[1] and len(folds):
                    curved, pulled = self._across(i, parts, folds)
                    result.setdefault(i, []).append(RandomEffects(parts, folds, curved, pulled, 1.0, bound))
        return result

    def _across(self, i: int, parts: Array, folds: IntArray) -> tuple[Array, Array]:
        """Products of the features with some parts over folds of group ``i``, (folds, k, parts) each."""
        if i in self._folds or self.data.constants is not None or len(self.data.groups[i].folds) == 1:
            sums = self.folds(i)[folds]
            return sums.curvature @ parts, sums.matrix @ parts
        live = np.flatnonzero(parts.any(axis=1))  # few: those of frictions
        gathered = self.data.gathered_folds(i, self.model).of(folds, live)
        sums = self.data.weighted(
            gathered,
            self.model,
            self._weight_of(i)[:, live],
            lambda: self._less(i)[:, live],
            lambda: self._where_slack(i)[:, live],
        )
        return sums.curvature @ parts[live], sums.matrix @ parts[live]

    def coefficients(self, values: Array) -> tuple[Array, Array]:
        """Of the model's features for every group, (groups, k), with their derivatives, (groups, k, p)."""
        return self.model.terms.with_jacobian(values, self._cables)

    def cost(self, values: Array) -> float:
        """Minus twice the log posterior, up to a constant."""
        result = float(((values - self._mean) ** 2 * self._stiffness).sum())
        if self.model.tie is not None:
            result += self.model.tie.cost(values)
        coefficients = self.model.terms.of(values, self._cables)
        for h, matrix in zip(coefficients, self.stacked().matrix, strict=True):
            result += float(h @ matrix @ h)
        for i, each in self._own.items():
            result += sum(one.misfit_at_bounds(coefficients[i]) for one in each)
        return result

    def _prior_weight(self) -> Array:
        """1 for nuisances; weak for moment arms, offsets and effects, of which nothing is known.

        A loss that is seen in contact alone may be the tip's friction as well, and is as free.
        """
        groups = self.data.groups
        pressed = {g.key[0] for g in groups} - {g.key[0] for g in groups if not g.in_contact}
        weak = [
            u.open or (u.name in LOSSES and u.cable in pressed) or (u.key == DELAY and self.model.delayed)
            for u in self.model.unknowns
        ]
        fixed = [u.key in self.model.fixed for u in self.model.unknowns]
        return np.where(fixed, FIXED_WEIGHT, np.where(weak, WEAK_PRIOR, 1.0))

    def run(self, start: Array | None = None, iterations: int = MOST_ITERATIONS) -> Fit:
        """Newton steps with halving from ``start``; stops when the cost no longer falls.

        What a friction may hold at rest, and by how much it differs from run to run, follows from its size,
        so that size is found first.
        """
        known = self._mean if start is None else start
        if not (self.has_stiction or self.has_random_effects):
            return self._run(known, iterations)
        self.set_friction_weights(known, trusted=True)
        fit = self._run(known, iterations)
        if self._own and fit.cost < -EFFECTIVE_SHARE * sum(g.samples for g in self.data.groups):
            return self._together(known, iterations)
        if iterations < SETTLING_ITERATIONS:
            return fit
        self.set_friction_weights(fit.values)
        fit = self._run(fit.values, iterations)
        return replace(fit, with_own=self._information_with_own(fit.values)) if self._own else fit

    def _together(self, start: Array, iterations: int) -> Fit:
        """The fit with the same friction in all runs.

        Where what the runs have of their own takes away more than there is, noise was taken from a fold that
        does not hold it: such a cost has no least value, and a fit runs away along it.
        """
        self.has_random_effects, self._own, self._stacked, self._whole = False, {}, None, None
        return self.run(start, iterations)

    def _information_with_own(self, values: Array) -> Array:
        """Curvature of the cost, with noise, (p, p), if nothing in a run were its own."""
        own, self._own, self._stacked = self._own, {}, None
        information = self.normal_equations(values)[1]
        self._own, self._stacked = own, None
        return information

    def _run(self, start: Array, iterations: int) -> Fit:
        values = np.clip(start, self._low, self._high)
        cost, slopes = self.cost(values), None
        for _ in range(iterations):
            slopes = self._slopes(values)
            # The cost's own curvature, which lacks the noise, converges in a few steps; where it is too weak
            # to be trusted, the one with noise takes shorter ones.
            least = max(LEAST_GAIN, LEAST_GAIN_SHARE * cost)
            values, gain = self._improve(values, cost, slopes.gradient, slopes.bend, least)
            if gain < -least:
                information = self._information(slopes)
                values, gain = self._improve(values, cost, slopes.gradient, information, least)
            cost -= max(gain, 0.0)
            if gain < least:
                break
        return Fit(values, np.eye(len(values)) if slopes is None else self._information(slopes), cost)

    def _improve(
        self, values: Array, cost: float, gradient: Array, curvature: Array, least: float
    ) -> tuple[Array, float]:
        """The best point found along the step that ``curvature`` tells, and by how much the cost falls there.

        A change by less than ``least`` either way is taken for the end. Where the curvature is that of no
        minimum there is no such step, and the gain is minus infinity.
        """
        if not (curvature.diagonal() > 0).all():  # what was taken away as noise is more than there was
            return values, -np.inf
        step = bounded_step(values, gradient, curvature, self._low, self._high)
        gain = 0.0
        for fraction in STEP_FRACTIONS:
            trial = np.clip(values + fraction * step, self._low, self._high)
            gain = cost - self.cost(trial)
            if gain > 0.0:
                return trial, gain
            if gain > -least:
                break
        return values, gain

    def without(self, values: Array, split: int) -> LeftOut:
        """One step from the fit ``values`` to that of the runs without the folds of a split.

        A group of which nothing would be left stays in.
        """
        if self._whole is None or not np.array_equal(self._whole[0], values):
            features, jacobians = self.coefficients(values)
            each = [self._seen(i) for i in range(len(self.data.groups))]
            pulls = [
                ((h @ sums.matrix)[:, None] @ jacobian)[:, 0]
                for h, jacobian, sums in zip(features, jacobians, each, strict=True)
            ]
            bends = [
                jacobian.T @ (sums.curvature @ jacobian)
                for jacobian, sums in zip(jacobians, each, strict=True)
            ]
            for i, one in self._beyond(features):
                pulls[i][one.folds] += one.slope @ jacobians[i]
                bends[i][one.folds] += one.along(jacobians[i]).curvature
            self._whole = values, list(zip(pulls, bends, strict=True)), self.normal_equations(values)
        _, folds, (gradient, information) = self._whole
        for group, (pull, bend) in zip(self.data.groups, folds, strict=True):
            for k in group.of_split(split):
                gradient = gradient - pull[k]
                information = information - bend[k]
        if np.any(np.diag(information) < self._stiffness):
            # What runs have of their own is not quite the same without the others; the prior stays.
            information = information.copy()
            np.fill_diagonal(information, np.maximum(np.diag(information), self._stiffness))
        step = bounded_step(values, gradient, information, self._low, self._high)
        step[self._of_changes] = 0.0
        fall = _fall(gradient, information, step)
        values = np.clip(values + step, self._low, self._high)
        free = (values > self._low) & (values < self._high)
        return LeftOut(values, information, free, gradient, fall)

    def predictive_misfit(self, i: int, k: int, left: LeftOut) -> float:
        """What fold ``k`` of group ``i`` adds to the misfit of the runs but those of its split.

        In twice log density, beyond what it leaves at the fit of all runs.
        """
        assert self._whole is not None, "of a split that was left out"
        values, folds, _ = self._whole
        pull, bend = folds[i][0][k], folds[i][1][k]
        low, high = self._low - values, self._high - values
        low[self._of_changes], high[self._of_changes] = 0.0, 0.0
        return predictive_misfit(left, pull, bend, low, high)

    @cached_property
    def _of_changes(self) -> list[int]:
        """Unknowns that only the runs with one known change of the machine tell, and no others could."""
        return [i for key, i in self.model.index.items() if key.startswith(CHANGED_OFFSET)]

    def normal_equations(self, values: Array) -> tuple[Array, Array]:
        """Half the gradient of the cost, (p,), and its Gauss-Newton curvature with noise, (p, p)."""
        slopes = self._slopes(values)
        return slopes.gradient, self._information(slopes)

    def _slopes(self, values: Array) -> Slopes:
        """Half the gradient of the cost, and its Gauss-Newton curvature without noise."""
        gradient, held = self._stiffness * (values - self._mean), self._prior_information
        if self.model.tie is not None:
            pull, curvature = self.model.tie.expansion(values)
            gradient, held = gradient + pull, held + curvature
        h, jacobian = self.coefficients(values)
        slopes = (self.stacked().matrix @ jacobian).reshape(-1, len(values))
        gradient = gradient + h.reshape(-1) @ slopes
        bend = held + jacobian.reshape(-1, len(values)).T @ slopes
        beyond = []
        for i, one in self._beyond(h):
            along = one.along(jacobian[i])
            gradient = gradient + one.slope.sum(axis=0) @ jacobian[i]
            bend = bend + along.matrix.sum(axis=0)
            beyond.append(along.curvature.sum(axis=0))
        return Slopes(gradient, bend, held, jacobian, beyond)

    def _information(self, at: Slopes) -> Array:
        """The curvature with noise, (p, p); asked for at few of the points that a fit goes through."""
        size = at.jacobian.shape[-1]
        bent = (self.stacked().curvature @ at.jacobian).reshape(-1, size)
        information = at.held + at.jacobian.reshape(-1, size).T @ bent
        for curvature in at.beyond:
            information = information + curvature
        return np.asarray(information)

    def _beyond(self, coefficients: Array) -> Iterator[tuple[int, BoundTerms]]:
        """What the bounds of the runs' own parts add, with the number of their group."""
        for i, each in self._own.items():
            for one in each:
                found = one.beyond(coefficients[i])
                if found is not None:
                    yield i, found

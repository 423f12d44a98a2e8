"""Fitting a model to Gram matrices: Gauss-Newton within bounds, priors as extra observations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from fingerlab.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.diagnosis.model import Model
from fingerlab.diagnosis.numerics import bounded_step, scaled_inverse
from fingerlab.diagnosis.sums import BoolArray
from fingerlab.diagnosis.weighing import Data, FoldNumbers, Weighted, Weights, feature_weights
from fingerlab.sessions.model import Array

SETTLING_ITERATIONS = 4
"""With fewer, a fit only looks round, and friction at rest is taken as it was at the start."""
LEAST_GAIN = 1e-3
LEAST_SHARE = 1e-6
"""A step that lowers the cost by less than this, or by less than this share of it, is the last; the cost is
twice a log probability."""

WEAK_PRIOR = 0.01
"""Weight of the prior of what nothing is known of: arms, offsets, and gains of effects."""


@dataclass(frozen=True)
class Fit:
    """Best values and their inverse covariance (information), with the cost reached."""

    values: Array
    information: Array
    cost: float

    @cached_property
    def covariance(self) -> Array:
        """Of the unknowns, (p, p)."""
        return scaled_inverse(self.information)

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of every unknown, given what else is unknown, (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


@dataclass(frozen=True)
class LeftOut:
    """What the runs but those of one turn tell.

    Attributes:
        values: of the unknowns, (p,). information: how well they are known, (p, p).
        free: those that no bound holds, (p,).
    """

    values: Array
    information: Array
    free: BoolArray


class Fitter:
    """Fits one model; keeps the weighted Gram matrices that all its iterations share."""

    def __init__(self, model: Model, data: Data, weights: Weights) -> None:
        self.model = model
        self.data = data
        self.weights = weights
        self._parts: dict[tuple[int, FoldNumbers | None], Weighted] = {}
        self._stacked: Weighted | None = None
        self._cables = tuple(g.cable_sign for g in data.groups)
        self._whole: tuple[Array, tuple[Array, Array], tuple[Array, Array]] | None = None
        self.sticks = bool(model.sticking) and any(g.whole.rest is not None for g in data.groups)
        self.widening = 0.0  # see Data.held, all groups together
        self._held: list[Array | None] = [None] * len(data.groups)
        self._still: dict[int, Array] = {}
        self._weight: dict[int, Array] = {}
        self._change: dict[int, Array] = {}
        self._mean = model.start()
        self._stiffness = self._prior_weight() / model.spread**2
        self._low, self._high = model.low, model.high

    @property
    def sums(self) -> list[Weighted]:
        """Weighted products over each group."""
        return [self.part(i, None) for i in range(len(self.data.groups))]

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
        if (i, part) not in self._parts:
            if i not in self._weight:
                self._weight[i] = self._of_products(self.weights[self.data.groups[i].key])
            self._parts[i, part] = self.data.weighted(
                i, part, self.model, self._weight[i], partial(self._less, i)
            )
        return self._parts[i, part]

    def _of_products(self, weights: Array) -> Array:
        """Weight of each product of the model's features, (k, k), from that of the equations, (5, 5)."""
        return EFFECTIVE_SHARE * feature_weights(weights, self.model.rows)

    def _less(self, i: int) -> Array:
        """How the weight of each product changes where the motor stands, (k, k)."""
        if i not in self._change:
            self._change[i] = self._of_products(self.standing(i))
        return self._change[i]

    def standing(self, i: int) -> Array:
        """How the weights of group ``i`` change where the motor stands, (5, 5)."""
        if i not in self._still:
            self._still[i] = self.data.standing(i, self.weights[self.data.groups[i].key])
        held = self._held[i]
        return self._still[i] if held is None else self._still[i] + held

    def hold(self, values: Array) -> None:
        """Weigh the moments at rest as the friction of ``values`` allows."""
        if not self.sticks:
            return
        found = [
            self.data.held(i, self.model, values, self.weights[g.key]) for i, g in enumerate(self.data.groups)
        ]
        self._held = [None if one is None else one[0] for one in found]
        self.widening = sum(one[1] for one in found if one is not None)
        self._parts.clear()
        self._change.clear()
        self._stacked = self._whole = None

    def cost(self, values: Array) -> float:
        """Minus twice the log posterior, up to a constant."""
        result = float(np.sum((values - self._mean) ** 2 * self._stiffness))
        if self.model.tie is not None:
            result += self.model.tie.cost(values)
        for h, matrix in zip(
            self.model.features_of(values, self._cables), self.stacked().matrix, strict=True
        ):
            result += float(h @ matrix @ h)
        return result

    def _prior_weight(self) -> Array:
        """1 for nuisances; weak for moment arms, offsets and effects, of which nothing is known.

        A loss that is seen in contact alone may be the tip's friction as well, and is as free.
        """
        groups = self.data.groups
        pressed = {g.key[0] for g in groups} - {g.key[0] for g in groups if not g.in_contact}
        losses = tuple(f"loss_{joint}@{routing}" for joint in ("mcp", "pip") for routing in pressed)
        weak = [
            u.open or u.key.startswith(losses) or (u.key == "delay" and u.gain.high > 0.01)
            for u in self.model.unknowns
        ]
        return np.where(weak, WEAK_PRIOR, 1.0)

    def run(self, start: Array | None = None, iterations: int = 12) -> Fit:
        """Newton steps with halving from ``start``; stops when the cost no longer falls.

        What a friction may hold at rest follows from its size, so that size is found first.
        """
        known = self._mean if start is None else start
        if not self.sticks:
            return self._run(known, iterations)
        self.hold(known)
        fit = self._run(known, iterations)
        if iterations < SETTLING_ITERATIONS:
            return fit
        self.hold(fit.values)
        return self._run(fit.values, iterations)

    def _run(self, start: Array, iterations: int) -> Fit:
        values = np.clip(start, self._low, self._high)
        cost = self.cost(values)
        information = np.eye(len(values))
        for _ in range(iterations):
            gradient, information, bend = self._expansion(values)
            # The cost's own curvature, which lacks the noise, converges in a few steps; where it is too weak
            # to be trusted, the one with noise takes shorter ones.
            least = max(LEAST_GAIN, LEAST_SHARE * cost)
            values, gain = self._improve(values, cost, gradient, bend, least)
            if gain < -least:
                values, gain = self._improve(values, cost, gradient, information, least)
            cost -= max(gain, 0.0)
            if gain < least:
                break
        return Fit(values, information, cost)

    def _improve(
        self, values: Array, cost: float, gradient: Array, curvature: Array, least: float
    ) -> tuple[Array, float]:
        """The best point found along the step that ``curvature`` tells, and by how much the cost falls there.

        A change by less than ``least`` either way is taken for the end. Where the curvature is that of no
        minimum there is no such step, and the gain is minus infinity.
        """
        if not np.all(np.diag(curvature) > 0):  # what was taken away as noise is more than there was
            return values, -np.inf
        step = bounded_step(values, gradient, curvature, self._low, self._high)
        gain = 0.0
        for fraction in (1.0, 0.5, 0.2, 0.05):
            trial = np.clip(values + fraction * step, self._low, self._high)
            gain = cost - self.cost(trial)
            if gain > 0.0:
                return trial, gain
            if gain > -least:
                break
        return values, gain

    def without(self, values: Array, turn: int) -> LeftOut:
        """One step from the fit ``values`` to that of the runs without the folds of a turn.

        A group of which nothing would be left stays in.
        """
        if self._whole is None or not np.array_equal(self._whole[0], values):
            coefficients = self.model.coefficients_of(values, self._cables)
            self._whole = (values, coefficients, self.normal_equations(values))
        _, (features, jacobians), (gradient, information) = self._whole
        for i, group in enumerate(self.data.groups):
            for k in group.of_turn(turn):
                fold = self.part(i, (k,))
                h, jacobian = features[i], jacobians[i]
                gradient = gradient - (h @ fold.matrix) @ jacobian
                information = information - jacobian.T @ (fold.curvature @ jacobian)
        step = bounded_step(values, gradient, information, self._low, self._high)
        values = np.clip(values + step, self._low, self._high)
        return LeftOut(values, information, (values > self._low) & (values < self._high))

    def normal_equations(self, values: Array) -> tuple[Array, Array]:
        """Half the gradient of the cost, (p,), and its Gauss-Newton curvature with noise, (p, p)."""
        gradient, information, _ = self._expansion(values)
        return gradient, information

    def _expansion(self, values: Array) -> tuple[Array, Array, Array]:
        """Half the gradient of the cost, (p,); its Gauss-Newton curvature with noise and without, (p, p)."""
        gradient = self._stiffness * (values - self._mean)
        information = np.diag(self._stiffness)
        if self.model.tie is not None:
            pull, hold = self.model.tie.expansion(values)
            gradient, information = gradient + pull, information + hold
        sums = self.stacked()
        h, jacobian = self.model.coefficients_of(values, self._cables)
        across = jacobian.reshape(-1, len(values)).T
        slopes = (sums.matrix @ jacobian).reshape(-1, len(values))
        bent = (sums.curvature @ jacobian).reshape(-1, len(values))
        return gradient + h.reshape(-1) @ slopes, information + across @ bent, information + across @ slopes

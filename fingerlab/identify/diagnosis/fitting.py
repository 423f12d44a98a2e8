"""Fitting a model to Gram matrices: Gauss-Newton within bounds, priors as extra observations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fingerlab.identify.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.identify.diagnosis.features import NO_SHIFT, Layout
from fingerlab.identify.diagnosis.model import Model
from fingerlab.identify.diagnosis.reduction import Group, GroupKey
from fingerlab.identify.diagnosis.standing import (
    HELD_SHARE,
    change_of_weight,
    encoder_spread,
    log_widening,
)
from fingerlab.identify.diagnosis.sums import BoolArray, IntArray, Sums, total
from fingerlab.physics.effects.base import Row
from fingerlab.sessions.model import Array

SLACK_SPREAD_M = 1e-4
"""Cable that may hang loose at no tension before that is called slack, m; assumed."""

Weights = Mapping[GroupKey, Array]
"""Inverse covariance of the equations' noise for each group, (5, 5) over :class:`Row`."""


@dataclass(frozen=True)
class Weighted:
    """Weighted products of a model's features, (k, k) each.

    ``curvature`` holds noise, so that it is positive; ``matrix`` does not: it gives cost and gradient.
    """

    curvature: Array
    matrix: Array


class Data:
    """Sums over the runs that a fit may see, with noise and without.

    Taking the noise away keeps noisy regressors from being pulled towards zero (Fuller, "Measurement Error
    Models", 1987, section 2.2): a tension that carries current noise would otherwise hide cable stretch.
    """

    def __init__(self, groups: Sequence[Group]) -> None:
        self.groups = groups
        self.clean = [[f.without(_noise_of_a_sample(g)) for f in g.folds] for g in groups]
        self._totals = [total(folds) for folds in self.clean]

    def raw(self, i: int, k: int | None) -> Sums:
        """Fold ``k`` of group ``i``, or all its folds as one."""
        return self.groups[i].whole if k is None else self.groups[i].folds[k]

    def noiseless(self, i: int, k: int | None) -> Sums:
        """The same without noise."""
        return self._totals[i] if k is None else self.clean[i][k]

    def weighted(self, i: int, k: int | None, model: Model, weights: Array, standing: Array) -> Weighted:
        """What a fit needs of group ``i``, or of its fold ``k``; a slack cable costs unless it may be so.

        ``standing`` changes the weights where the motor stands; both (5, 5).
        """
        raw, clean = self.raw(i, k), self.noiseless(i, k)
        weight = EFFECTIVE_SHARE * feature_weights(weights, model.rows)
        curvature, matrix = raw.of(model.pick) * weight, clean.of(model.pick) * weight
        still, quiet = raw.at_rest(model.pick), clean.at_rest(model.pick)
        if still is not None and quiet is not None:
            less = EFFECTIVE_SHARE * feature_weights(standing, model.rows)
            curvature, matrix = curvature + still * less, matrix + quiet * less
        slack = None if model.slack_free else raw.slack(model.pick)
        if slack is not None:
            charge = slack * (EFFECTIVE_SHARE / SLACK_SPREAD_M**2)
            curvature, matrix = curvature + charge, matrix + charge
        return Weighted(curvature, matrix)

    def standing(self, i: int, weights: Array) -> Array:
        """How the encoder's step changes the weights of group ``i`` where the motor stands, (5, 5)."""
        return change_of_weight(weights, encoder_spread(self.groups[i].encoder_variance))

    def held(self, i: int, model: Model, values: Array, weights: Array) -> tuple[Array, float] | None:
        """What friction that sticks does to group ``i`` where the motor stands; None: nothing.

        The change of the weights, (5, 5), beside the encoder's, and by how much the logarithm of the density
        falls at all those moments together because the residual may lie further out.
        """
        group = self.groups[i]
        if group.whole.rest is None or not model.sticking:
            return None
        products = group.whole.of(model.pick)
        spread = encoder_spread(group.encoder_variance)
        own = np.zeros((5, 5))
        for mine in model.sticking:
            own += HELD_SHARE * row_covariance(model, values, group, products, group.samples, mine)
        change = change_of_weight(weights, spread + own) - change_of_weight(weights, spread)
        widening = log_widening(weights, spread + own) - log_widening(weights, spread)
        return change, EFFECTIVE_SHARE * group.whole.rest_samples * widening


def _noise_of_a_sample(group: Group) -> Array:
    """What noise adds to the products of signals at one sample, (signals, signals)."""
    return group.noise / max(group.noise_samples, 1.0)


MOST_NOISE = 0.995
"""Noise may make up at most this share of any combination of features."""
RIDGE = 1e-9
"""Share of its own size below which a combination of features is rounding."""


def limit_noise(group: Group) -> None:
    """Cut the group's noise back to what its own recordings hold, in every combination of signals.

    The noise is read from the runs with a cycle; in a combination that those runs happen to excite more
    than the others it would exceed the whole, and a fit could run away along it.
    """
    if group.noise_samples <= 0:
        return
    whole = group.whole
    noise = _noise_of_a_sample(group)
    noise = _limited(noise, whole.taut() / max(whole.taut_samples, 1))
    if whole.loose is not None:
        noise = _limited(noise, whole.products / whole.samples)
    group.noise = noise * group.noise_samples


def _limited(noise: Array, whole: Array) -> Array:
    """``noise`` cut back to a share of ``whole`` in every direction; both (n, n), of one sample."""
    size = np.diag(whole)
    live = np.flatnonzero(size > 0)
    scale = 1.0 / np.sqrt(size[live])
    among = np.ix_(live, live)
    units = np.outer(scale, scale)
    # In units of the whole (its Cholesky factor) the noise is a share between 0 and 1 in every direction.
    factor = np.linalg.cholesky(whole[among] * units + RIDGE * np.eye(len(live)))
    half = np.linalg.solve(factor, noise[among] * units)
    shares, directions = np.linalg.eigh(np.linalg.solve(factor, half.T))
    wrong = (shares > MOST_NOISE) | (shares < 0.0)
    excess = shares[wrong] - np.clip(shares[wrong], 0.0, MOST_NOISE)
    reach = factor @ directions[:, wrong]
    limited = np.zeros_like(noise)
    limited[among] = noise[among] - (reach * excess) @ reach.T / units
    return limited


SETTLING_ITERATIONS = 4
"""With fewer, a fit only looks round, and friction at rest is taken as it was at the start."""
LEAST_GAIN = 1e-3
LEAST_SHARE = 1e-6
"""A step that lowers the cost by less than this, or by less than this share of it, is the last; the cost is
twice a log probability."""


@dataclass(frozen=True)
class Fit:
    """Best values and their inverse covariance (information), with the cost reached."""

    values: Array
    information: Array
    cost: float

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of every unknown, given what else is unknown, (p,)."""
        scale = 1.0 / np.sqrt(np.diag(self.information))
        covariance = np.linalg.pinv(self.information * np.outer(scale, scale), hermitian=True)
        return np.asarray(scale * np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def feature_weights(weights: Array, rows: IntArray) -> Array:
    """Weight of each product of features, (k, k)."""
    return np.asarray(weights[rows[:, None], rows])


class Fitter:
    """Fits one model; keeps the weighted Gram matrices that all its iterations share."""

    def __init__(self, model: Model, data: Data, weights: Weights) -> None:
        self.model = model
        self.data = data
        self.weights = weights
        self.sums: list[Weighted] = []
        self._parts: dict[tuple[int, int | None], Weighted] = {}
        self._whole: tuple[Array, list[tuple[Array, Array]], tuple[Array, Array]] | None = None
        self.sticks = bool(model.sticking) and any(g.whole.rest is not None for g in data.groups)
        self.widening = 0.0  # see Data.held, all groups together
        self._held: list[Array | None] = [None] * len(data.groups)
        self._still = [data.standing(i, weights[g.key]) for i, g in enumerate(data.groups)]
        self._weigh()
        self._mean = model.start()
        self._stiffness = self._prior_weight() / model.spread**2
        self._low, self._high = model.low, model.high

    def _weigh(self) -> None:
        self._parts.clear()
        self.sums = [self.part(i, None) for i in range(len(self.data.groups))]
        self._whole = None

    def part(self, i: int, k: int | None) -> Weighted:
        """Weighted products over group ``i``, or over its fold ``k``."""
        if (i, k) not in self._parts:
            weights = self.weights[self.data.groups[i].key]
            self._parts[i, k] = self.data.weighted(i, k, self.model, weights, self.standing(i))
        return self._parts[i, k]

    def standing(self, i: int) -> Array:
        """How the weights of group ``i`` change where the motor stands, (5, 5)."""
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
        self._weigh()

    def cost(self, values: Array) -> float:
        """Minus twice the log posterior, up to a constant."""
        result = float(np.sum((values - self._mean) ** 2 * self._stiffness))
        if self.model.tie is not None:
            result += self.model.tie.cost(values)
        for group, sums in zip(self.data.groups, self.sums, strict=True):
            h = self.model.features(values, group)
            result += float(h @ sums.matrix @ h)
        return result

    def _prior_weight(self) -> Array:
        """1 for nuisances; weak for moment arms, offsets and effects, of which nothing is known.

        A loss that is seen in contact alone may be the tip's friction as well, and is as free.
        """
        pressed = {f"@{g.key[0]}" for g in self.data.groups} - {
            f"@{g.key[0]}" for g in self.data.groups if g.key[1] == "free"
        }
        free: tuple[str, ...] = ("arm_", "offset", "bench_inertia", "bench_gain", "bench_offset")
        free += tuple(f"loss_{joint}{routing}" for joint in ("mcp", "pip") for routing in pressed)
        return np.array(
            [
                0.01
                if u.key.startswith(free) or "." in u.key or (u.key == "delay" and u.gain.high > 0.01)
                else 1.0
                for u in self.model.unknowns
            ]
        )

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

        A change by less than ``least`` either way is taken for the end.
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

    def without(self, values: Array, k: int) -> Array:
        """One step from the fit ``values`` to that of the runs without fold ``k`` of any group, (p,).

        A group with one fold only stays in.
        """
        if self._whole is None or not np.array_equal(self._whole[0], values):
            coefficients = [self.model.coefficients(values, g) for g in self.data.groups]
            self._whole = (values, coefficients, self.normal_equations(values))
        _, coefficients, (gradient, information) = self._whole
        for i, group in enumerate(self.data.groups):
            if 1 < len(group.folds) > k:
                fold = self.part(i, k)
                h, jacobian = coefficients[i]
                gradient = gradient - (h @ fold.matrix) @ jacobian
                information = information - jacobian.T @ (fold.curvature @ jacobian)
        step = bounded_step(values, gradient, information, self._low, self._high)
        return np.clip(values + step, self._low, self._high)

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
        bend = information
        for group, sums in zip(self.data.groups, self.sums, strict=True):
            h, jacobian = self.model.coefficients(values, group)
            slopes = sums.matrix @ jacobian
            gradient = gradient + h @ slopes
            information = information + jacobian.T @ (sums.curvature @ jacobian)
            bend = bend + jacobian.T @ slopes
        return gradient, information, bend


def bounded_step(values: Array, gradient: Array, information: Array, low: Array, high: Array) -> Array:
    """Minimiser of the quadratic model inside the bounds (active set with release, as in BVLS)."""
    scale = 1.0 / np.sqrt(np.diag(information))
    matrix = information * np.outer(scale, scale) + 1e-9 * np.eye(len(values))
    slope = gradient * scale
    floor, ceiling = (low - values) / scale, (high - values) / scale
    step = np.zeros(len(values))
    # What stands at a bound and is pushed outwards starts fixed; it is let go below if that was wrong.
    fixed = ((floor > -1e-12) & (slope > 0)) | ((ceiling < 1e-12) & (slope < 0))
    quick = _pivoted(matrix, slope, floor, ceiling, fixed)
    if quick is not None:
        return quick * scale
    for _ in range(6 * len(values)):
        free = np.flatnonzero(~fixed)
        target = step.copy()
        if len(free):
            rest = slope[free] + matrix[free][:, fixed] @ step[fixed]
            target[free] = np.linalg.solve(matrix[free][:, free], -rest)
        out = ~fixed & ((target < floor - 1e-12) | (target > ceiling + 1e-12))
        if out.any():
            # Go as far as the first bound on the way, and stay there.
            change = target - step
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.where(change > 0, (ceiling - step) / change, (floor - step) / change)
            room[~out] = np.inf
            first = int(np.argmin(room))
            step = step + max(0.0, float(room[first])) * change
            step[first] = ceiling[first] if change[first] > 0 else floor[first]
            fixed[first] = True
            continue
        step = target
        pull = slope + matrix @ step
        wrong = fixed & (((step <= floor) & (pull < -1e-6)) | ((step >= ceiling) & (pull > 1e-6)))
        if not wrong.any():
            break
        fixed[int(np.argmax(np.where(wrong, np.abs(pull), -1.0)))] = False
    return step * scale


PIVOTING_ROUNDS = 40
PATIENCE = 2
"""Rounds in which all wrong bounds are exchanged without their number falling, before it is one at a time."""


def _pivoted(matrix: Array, slope: Array, floor: Array, ceiling: Array, outwards: BoolArray) -> Array | None:
    """The same minimiser by exchanging all wrong bounds at once; None where that does not settle.

    Block principal pivoting (Judice and Pires 1994): nearly always two or three solves. Where their number
    does not fall any more, only the last of the wrong bounds is exchanged, which cannot go in circles.
    ``outwards`` are the unknowns that stand at a bound and are pushed out of it.
    """
    at_floor, at_ceiling = outwards & (floor > -1e-12), outwards & (ceiling < 1e-12)
    fewest, patience = len(slope) + 1, PATIENCE
    for _ in range(PIVOTING_ROUNDS):
        step = np.where(at_floor, floor, 0.0)
        step[at_ceiling] = ceiling[at_ceiling]
        held = at_floor | at_ceiling
        free = (~held).nonzero()[0]
        if len(free):
            rest = slope + matrix @ step
            step[free] = np.linalg.solve(matrix[free[:, None], free], -rest[free])
        pull = slope + matrix @ step
        now_floor = (at_floor & (pull > -1e-6)) | (~held & (step < floor - 1e-12))
        now_ceiling = (at_ceiling & (pull < 1e-6)) | (~held & (step > ceiling + 1e-12))
        wrong = ((now_floor != at_floor) | (now_ceiling != at_ceiling)).nonzero()[0]
        if len(wrong) == 0:
            return np.asarray(step)
        if len(wrong) < fewest:
            fewest, patience = len(wrong), PATIENCE
        else:
            patience -= 1
        if patience >= 0:
            at_floor, at_ceiling = now_floor, now_ceiling
        else:
            last = wrong[-1]
            at_floor[last], at_ceiling[last] = now_floor[last], now_ceiling[last]
    return None


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
    return row_covariance(model, values, group, group.noise[model.pick.square], group.noise_samples)


def starting_arms(layout: Layout, groups: Sequence[Group]) -> dict[str, float]:
    """Moment arms (m) of each routing from a straight regression of tension on joint torque."""
    arms: dict[str, float] = {}
    order = sorted(groups, key=lambda g: g.key[1] != "free")
    zero_shift = NO_SHIFT
    for group in order:
        routing = {1: "flexion", -1: "extension"}.get(group.cable_sign)
        if routing is None or f"arm_mcp@{routing}" in arms:
            continue
        gram = group.whole.of(layout.every)
        for row, name in ((Row.MCP, "arm_mcp"), (Row.PIP, "arm_pip")):

            def pick(wanted: set[str], row: Row = row, shift: int | None = None) -> list[int]:
                return [
                    i
                    for i, f in enumerate(layout.features)
                    if f.owner is None and f.row == row and f.parameter in wanted and f.shift == shift
                ]

            torque = pick({"proximal_mass", "distal_mass", "mcp_stiffness", "pip_stiffness", "force_gain"})
            loss = pick({"loss_mcp", "loss_pip"})
            pull = pick({"torque_gain"}, shift=zero_shift)
            inertia = pick({"rotor_inertia"}, shift=zero_shift)
            size = len(layout.features)
            left = np.zeros((size, 2))
            left[torque, 0] = group.cable_sign
            left[loss, 1] = 1.0
            right = np.zeros(size)
            right[pull] = 1.0
            right[inertia] = -layout.features[inertia[0]].constant
            solution = np.linalg.lstsq(left.T @ gram @ left, left.T @ gram @ right, rcond=None)[0]
            slope = float(solution[0])
            arms[f"{name}@{routing}"] = float(np.clip(1.0 / slope if slope > 1e-9 else 0.01, 0.003, 0.035))
    return arms

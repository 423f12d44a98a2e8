"""Fitting a model to Gram matrices: Gauss-Newton within bounds, priors as extra observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from fingerlab.identify.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.identify.diagnosis.features import NO_SHIFT, Layout
from fingerlab.identify.diagnosis.groups import Group, GroupKey
from fingerlab.identify.diagnosis.model import Model
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

Part = tuple[int, ...]
"""Folds of a group, by number."""


@dataclass(frozen=True)
class Weighted:
    """Weighted products of a model's features, (k, k) each.

    ``curvature`` holds noise, so that it is positive; ``matrix`` does not: it gives cost and gradient.
    """

    curvature: Array
    matrix: Array


@dataclass(frozen=True)
class Gathered:
    """Products of a model's features in one group or fold, (k, k) each: see :class:`Sums`.

    All samples with noise and without, those at rest with noise and without, and those of a slack cable.
    """

    raw: Array
    clean: Array
    still: Array | None
    quiet: Array | None
    slack: Array | None


class Data:
    """Sums over the runs that a fit may see, with noise and without.

    Taking the noise away keeps noisy regressors from being pulled towards zero (Fuller, "Measurement Error
    Models", 1987, section 2.2): a tension that carries current noise would otherwise hide cable stretch.
    """

    def __init__(self, groups: Sequence[Group]) -> None:
        self.groups = groups
        self._noise = [_noise_of_a_sample(g) for g in groups]
        self._taut_noise = [
            noise if g.taut_noise is None else g.taut_noise
            for g, noise in zip(groups, self._noise, strict=True)
        ]
        self._kept: dict[tuple[int, int], tuple[Model, Gathered]] = {}
        self._joined: dict[tuple[int, Part], Sums] = {}
        self._at_rest: dict[int, tuple[Array, Array, float]] = {}

    @property
    def count(self) -> float:
        """Decimated samples of all groups, as independent values of one equation."""
        return EFFECTIVE_SHARE * sum(group.samples for group in self.groups)

    def raw(self, i: int, part: Part | None) -> Sums:
        """Sums over some folds of group ``i``, or over all."""
        group = self.groups[i]
        if part is None or len(part) == len(group.folds):
            return group.whole
        if len(part) == 1:
            return group.folds[part[0]]
        if (i, part) not in self._joined:
            self._joined[i, part] = total([group.folds[k] for k in part])
        return self._joined[i, part]

    @cached_property
    def noiseless(self) -> list[Sums]:
        """All folds of every group as one, without noise."""
        noises = zip(self._noise, self._taut_noise, strict=True)
        return [g.whole.without(*noise) for g, noise in zip(self.groups, noises, strict=True)]

    def weighted(
        self, i: int, part: Part | None, model: Model, weight: Array, standing: Callable[[], Array]
    ) -> Weighted:
        """What a fit needs of group ``i``, or of a part of it; a slack cable costs unless it may be so.

        ``weight`` of each product of the model's features, (k, k); ``standing`` gives by how much it changes
        where the motor stands, if it ever does.
        """
        found = self.gathered(i, part, model)
        curvature, matrix = found.raw * weight, found.clean * weight
        if found.still is not None and found.quiet is not None:
            less = standing()
            curvature += found.still * less
            matrix += found.quiet * less
        if found.slack is not None and not model.slack_free:
            charge = found.slack * (EFFECTIVE_SHARE / SLACK_SPREAD_M**2)
            curvature += charge
            matrix += charge
        return Weighted(curvature, matrix)

    def gathered(self, i: int, part: Part | None, model: Model) -> Gathered:
        """Products of the model's features; those over whole groups are kept: they are asked for often."""
        whole = part is None or len(part) == len(self.groups[i].folds)
        known = self._kept.get((id(model), i)) if whole else None
        if known is not None:
            return known[1]
        sums, pick = self.raw(i, part), model.pick
        noise = self._noise[i][pick.square]
        found = Gathered(
            sums.of(pick),
            sums.of(pick, noise, self._taut_noise[i][pick.square]),
            sums.at_rest(pick),
            sums.at_rest(pick, noise),
            sums.slack(pick),
        )
        if whole:
            self._kept[id(model), i] = model, found  # with the model, so that its identity stays its own
        return found

    def standing(self, i: int, weights: Array) -> Array:
        """How the encoder's step changes the weights of group ``i`` where the motor stands, (5, 5)."""
        return self._standing(i, weights)[0]

    def _standing(self, i: int, weights: Array) -> tuple[Array, float]:
        """The same, and the log widening that goes with it; kept while the weights stay the same array."""
        known = self._at_rest.get(i)
        if known is None or known[0] is not weights:
            spread = encoder_spread(self.groups[i].encoder_variance)
            known = weights, change_of_weight(weights, spread), log_widening(weights, spread)
            self._at_rest[i] = known
        return known[1:]

    def held(self, i: int, model: Model, values: Array, weights: Array) -> tuple[Array, float] | None:
        """What friction that sticks does to group ``i`` where the motor stands; None: nothing.

        The change of the weights, (5, 5), beside the encoder's, and by how much the logarithm of the density
        falls at all those moments together because the residual may lie further out.
        """
        group = self.groups[i]
        if group.whole.rest is None or not model.sticking:
            return None
        products = self.gathered(i, None, model).raw
        spread = encoder_spread(group.encoder_variance)
        h, own = model.features(values, group), np.zeros((5, 5))
        for mine in map(np.flatnonzero, model.sticking):
            share = np.zeros((len(mine), 5))
            share[np.arange(len(mine)), model.rows[mine]] = h[mine]
            own += share.T @ products[mine[:, None], mine] @ share
        own *= HELD_SHARE / max(group.samples, 1.0)
        usual, wide = self._standing(i, weights)
        change = change_of_weight(weights, spread + own) - usual
        widening = log_widening(weights, spread + own) - wide
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
    noise = _limited(_noise_of_a_sample(group), whole.products / whole.samples)
    group.noise = noise * group.noise_samples
    if whole.loose is not None:
        # Few taut moments hold little of it; what is not in them says nothing of how noisy the others are.
        group.taut_noise = _limited(noise, whole.taut() / max(whole.taut_samples, 1))


def _limited(noise: Array, whole: Array) -> Array:
    """``noise`` cut back to a share of ``whole`` in every direction; both (n, n), of one sample."""
    size = np.diag(whole)
    live = np.flatnonzero(size > 0)
    scale = 1.0 / np.sqrt(size[live])
    among = np.ix_(live, live)
    units = np.outer(scale, scale)
    # In units of the whole (its Cholesky factor) the noise is a share between 0 and 1 in every direction.
    factor = _factor(whole[among] * units)
    half = np.linalg.solve(factor, noise[among] * units)
    shares, directions = np.linalg.eigh(np.linalg.solve(factor, half.T))
    wrong = (shares > MOST_NOISE) | (shares < 0.0)
    excess = shares[wrong] - np.clip(shares[wrong], 0.0, MOST_NOISE)
    reach = factor @ directions[:, wrong]
    limited = np.zeros_like(noise)
    limited[among] = noise[among] - (reach * excess) @ reach.T / units
    return limited


def _factor(products: Array) -> Array:
    """Cholesky factor of products with ones on the diagonal, lifted to be definite, (n, n)."""
    ridge = RIDGE * np.eye(len(products))
    try:
        return np.asarray(np.linalg.cholesky(products + ridge))
    except np.linalg.LinAlgError:
        # Products of the taut moments are those of all less those of the slack ones: where nearly all is
        # slack, what is left of a signal may be rounding, which is no product of anything.
        sizes, directions = np.linalg.eigh(products)
        return np.asarray(np.linalg.cholesky((directions * np.maximum(sizes, 0.0)) @ directions.T + ridge))


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
    def covariance(self) -> Array:
        """Of the unknowns, (p, p)."""
        scale = 1.0 / np.sqrt(np.maximum(np.diag(self.information), 1e-300))
        scaled = np.linalg.pinv(self.information * np.outer(scale, scale), hermitian=True)
        return np.asarray(scaled * np.outer(scale, scale))

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of every unknown, given what else is unknown, (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def feature_weights(weights: Array, rows: IntArray) -> Array:
    """Weight of each product of features, (k, k)."""
    return weights.take(rows, axis=0).take(rows, axis=1)


class Fitter:
    """Fits one model; keeps the weighted Gram matrices that all its iterations share."""

    def __init__(self, model: Model, data: Data, weights: Weights) -> None:
        self.model = model
        self.data = data
        self.weights = weights
        self._parts: dict[tuple[int, Part | None], Weighted] = {}
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

    def part(self, i: int, part: Part | None) -> Weighted:
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

    def without(self, values: Array, turn: int) -> Array:
        """One step from the fit ``values`` to that of the runs without the folds of a turn, (p,).

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
        sums = self.stacked()
        h, jacobian = self.model.coefficients_of(values, self._cables)
        across = jacobian.reshape(-1, len(values)).T
        slopes = (sums.matrix @ jacobian).reshape(-1, len(values))
        bent = (sums.curvature @ jacobian).reshape(-1, len(values))
        return gradient + h.reshape(-1) @ slopes, information + across @ bent, information + across @ slopes


def bounded_step(values: Array, gradient: Array, information: Array, low: Array, high: Array) -> Array:
    """Minimiser of the quadratic model inside the bounds (active set with release, as in BVLS)."""
    scale = 1.0 / np.sqrt(np.diag(information))
    matrix = information * np.outer(scale, scale) + 1e-9 * np.eye(len(values))
    slope = gradient * scale
    floor, ceiling = (low - values) / scale, (high - values) / scale
    quick = _pivoted(matrix, slope, floor, ceiling)
    if quick is not None:
        return quick * scale
    step = np.zeros(len(values))
    # What stands at a bound and is pushed outwards starts fixed; it is let go below if that was wrong.
    fixed = ((floor > -1e-12) & (slope > 0)) | ((ceiling < 1e-12) & (slope < 0))
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


def _pivoted(matrix: Array, slope: Array, floor: Array, ceiling: Array) -> Array | None:
    """The same minimiser by exchanging all wrong bounds at once; None where that does not settle.

    Block principal pivoting (Judice and Pires 1994): nearly always two or three solves. Where their number
    does not fall, only the last of the wrong bounds is exchanged, which cannot go in circles. What stands at
    a bound starts there: between two steps of a fit, or two models that are alike, that hardly changes.
    """
    at_floor = floor > -1e-12
    at_ceiling = (ceiling < 1e-12) & ~at_floor
    fewest = len(slope) + 1
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
            fewest = len(wrong)
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

"""Fitting a model to Gram matrices: Gauss-Newton within bounds, priors as extra observations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.identify.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.identify.diagnosis.features import NO_SHIFT, BoolArray, IntArray, Layout
from fingerlab.identify.diagnosis.model import Model
from fingerlab.identify.diagnosis.reduction import Fold, Group, GroupKey
from fingerlab.physics.effects.base import Row
from fingerlab.sessions.model import Array

SLACK_SPREAD_M = 1e-4
"""Cable that may hang loose at no tension before that is called slack, m; assumed."""

Weights = Mapping[GroupKey, Array]
"""Inverse covariance of the equations' noise for each group, (5, 5) over :class:`Row`."""


class Data:
    """Sums over the runs that a fit may see: feature products with noise and without, and slack moments.

    ``rows`` is the equation of every feature, shape (features,).
    """

    def __init__(self, groups: Sequence[Group], rows: IntArray) -> None:
        self.groups = groups
        self._rows = rows
        self.clean = [[f.gram - noise_share(g, f) for f in g.folds] for g in groups]
        self._totals = [
            (
                g.gram,
                sum(clean[1:], clean[0]),
                g.slack,
            )
            for g, clean in zip(groups, self.clean, strict=True)
        ]
        self._weighted: dict[int, tuple[Array, tuple[Array, Array, Array]]] = {}

    def part(self, i: int, k: int | None) -> tuple[Fold, Array]:
        """Fold ``k`` of group ``i``, or all its folds as one, and its feature products without noise."""
        folds = self.groups[i].folds
        if k is not None:
            return folds[k], self.clean[i][k]
        gram, clean, slack = self._totals[i]
        taut, loose = sum(f.taut_samples for f in folds), sum(f.slack_samples for f in folds)
        return Fold(gram, slack, taut, loose), clean

    def weighted(self, i: int, model: Model, weights: Array) -> tuple[Array, Array, Array]:
        """Weighted sums over group ``i`` for a model's features: raw, without noise, slack; each (k, k)."""
        every = self.weighted_all(i, weights)
        return tuple(total[model.chosen] for total in every)

    def weighted_fold(self, i: int, k: int, model: Model, weights: Array) -> tuple[Array, Array, Array]:
        """The same for fold ``k`` alone."""
        fold = self.groups[i].folds[k]
        parts = tuple(m[model.chosen] for m in (fold.gram, self.clean[i][k], fold.slack))
        return self._weigh(parts, model.rows, weights)

    def weighted_all(self, i: int, weights: Array) -> tuple[Array, Array, Array]:
        """The same for all features and all folds, (features, features) each.

        Kept until other weights come: most fits differ only in which features they take.
        """
        known = self._weighted.get(i)
        if known is None or known[0] is not weights:
            known = (weights, self._weigh(self._totals[i], self._rows, weights))
            self._weighted[i] = known
        return known[1]

    @staticmethod
    def _weigh(sums: tuple[Array, ...], rows: IntArray, weights: Array) -> tuple[Array, Array, Array]:
        gram, clean, slack = sums
        weight = EFFECTIVE_SHARE * feature_weights(weights, rows)
        return gram * weight, clean * weight, slack * (EFFECTIVE_SHARE / SLACK_SPREAD_M**2)


def noise_share(group: Group, fold: Fold) -> Array:
    """What noise alone adds to a fold's feature products, (features, features).

    Taking it away keeps noisy regressors from being pulled towards zero (Fuller, "Measurement Error
    Models", 1987, section 2.2): a tension that carries current noise would otherwise hide cable stretch.
    """
    if group.noise_samples <= 0:
        return np.zeros_like(group.noise)
    counts = np.where(group.cable_rows, fold.taut_samples, fold.taut_samples + fold.slack_samples)
    return group.noise / group.noise_samples * np.minimum.outer(counts, counts)


MOST_NOISE = 0.995
"""Noise may make up at most this share of any combination of features."""
RIDGE = 1e-9
"""Share of its own size below which a combination of features is rounding."""


def limit_noise(group: Group) -> None:
    """Cut the group's noise back to what its own recordings hold, in every combination of features.

    The noise is read from the runs with a cycle; in a combination that those runs happen to excite more
    than the others it would exceed the whole, and a fit could run away along it.
    """
    if group.noise_samples <= 0:
        return
    whole = group.gram / max(sum(f.taut_samples for f in group.folds), 1)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    scale[np.diag(whole) <= 0] = 0.0
    whole, noise = (m * np.outer(scale, scale) for m in (whole, group.noise / group.noise_samples))
    # In units of the whole (its Cholesky factor) the noise is a share between 0 and 1 in every direction.
    live = np.flatnonzero(scale)
    factor = np.linalg.cholesky(whole[np.ix_(live, live)] + RIDGE * np.eye(len(live)))
    half = np.linalg.solve(factor, noise[np.ix_(live, live)])
    shares, directions = np.linalg.eigh(np.linalg.solve(factor, half.T))
    wrong = (shares > MOST_NOISE) | (shares < 0.0)
    excess = shares[wrong] - np.clip(shares[wrong], 0.0, MOST_NOISE)
    reach = factor @ directions[:, wrong]
    limited = noise.copy()
    limited[np.ix_(live, live)] -= (reach * excess) @ reach.T
    back = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
    group.noise = limited * np.outer(back, back) * group.noise_samples


@dataclass(frozen=True)
class Fit:
    """Best values and their inverse covariance (information), with the cost reached."""

    values: Array
    information: Array
    cost: float


def feature_weights(weights: Array, rows: IntArray) -> Array:
    """Weight of each product of features, (k, k)."""
    return np.asarray(weights[np.ix_(rows, rows)])


class Fitter:
    """Fits one model; keeps the weighted Gram matrices that all its iterations share."""

    def __init__(self, model: Model, data: Data, weights: Weights) -> None:
        self.model = model
        self.data = data
        self.weights = weights
        self.matrices = []  # without noise: cost and gradient
        self.curvatures = []  # with noise, hence positive: the step
        for i, group in enumerate(data.groups):
            curvature, matrix, loose = data.weighted(i, model, weights[group.key])
            if not model.slack_free:
                matrix, curvature = matrix + loose, curvature + loose
            self.matrices.append(matrix)
            self.curvatures.append(curvature)
        self._mean = model.start()
        self._stiffness = self._prior_weight() / model.spread**2
        self._low, self._high = model.low, model.high
        self._whole: tuple[Array, tuple[Array, Array]] | None = None
        self._at: tuple[Array, list[tuple[Array, Array]]] | None = None

    def cost(self, values: Array) -> float:
        """Minus twice the log posterior, up to a constant."""
        total = float(np.sum((values - self._mean) ** 2 * self._stiffness))
        for group, matrix in zip(self.data.groups, self.matrices, strict=True):
            h = self.model.features(values, group)
            total += float(h @ matrix @ h)
        return total

    def _prior_weight(self) -> Array:
        """1 for nuisances; weak for moment arms, losses, offsets and effects, of which nothing is known."""
        free = ("arm_", "loss_", "offset", "bench_inertia", "bench_gain", "bench_offset")
        return np.array(
            [
                0.01
                if u.key.startswith(free) or "." in u.key or (u.key == "delay" and u.gain.high > 0.01)
                else 1.0
                for u in self.model.unknowns
            ]
        )

    def run(self, start: Array | None = None, iterations: int = 12) -> Fit:
        """Gauss-Newton with step halving from ``start``; stops when the cost no longer falls."""
        values = np.clip(self._mean if start is None else start, self._low, self._high)
        cost = self.cost(values)
        information = np.eye(len(values))
        for _ in range(iterations):
            gradient, information = self.normal_equations(values)
            step = bounded_step(values, gradient, information, self._low, self._high)
            improved = False
            for fraction in (1.0, 0.5, 0.2, 0.05):
                trial = np.clip(values + fraction * step, self._low, self._high)
                trial_cost = self.cost(trial)
                if trial_cost < cost:
                    gain = cost - trial_cost
                    values, cost, improved = trial, trial_cost, True
                    break
            if not improved or gain < 1e-3:
                break
        return Fit(values, information, cost)

    def without(self, values: Array, k: int) -> Array:
        """One step from the fit ``values`` to that of the runs without fold ``k`` of any group, (p,).

        A group with one fold only stays in.
        """
        if self._whole is None or not np.array_equal(self._whole[0], values):
            self._whole = (values, self.normal_equations(values))
        gradient, information = self._whole[1]
        for i, group in enumerate(self.data.groups):
            if 1 < len(group.folds) > k:
                curvature, matrix, loose = self.data.weighted_fold(i, k, self.model, self.weights[group.key])
                if not self.model.slack_free:
                    matrix, curvature = matrix + loose, curvature + loose
                h, jacobian = self.model.coefficients(values, group)
                gradient = gradient - (h @ matrix) @ jacobian
                information = information - jacobian.T @ (curvature @ jacobian)
        step = bounded_step(values, gradient, information, self._low, self._high)
        return np.clip(values + step, self._low, self._high)

    def normal_equations(self, values: Array) -> tuple[Array, Array]:
        """Half the gradient of the cost, (p,), and its Gauss-Newton curvature, (p, p)."""
        gradient = self._stiffness * (values - self._mean)
        information = np.diag(self._stiffness)
        for group, matrix, curvature in zip(self.data.groups, self.matrices, self.curvatures, strict=True):
            h, jacobian = self.model.coefficients(values, group)
            gradient = gradient + (h @ matrix) @ jacobian
            information = information + jacobian.T @ (curvature @ jacobian)
        return gradient, information


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


PIVOTING_ROUNDS = 8


def _pivoted(matrix: Array, slope: Array, floor: Array, ceiling: Array, outwards: BoolArray) -> Array | None:
    """The same minimiser by exchanging all wrong bounds at once; None where that does not settle.

    Block principal pivoting (Judice and Pires 1994): nearly always two or three solves, but it may cycle.
    ``outwards`` are the unknowns that stand at a bound and are pushed out of it.
    """
    at_floor, at_ceiling = outwards & (floor > -1e-12), outwards & (ceiling < 1e-12)
    for _ in range(PIVOTING_ROUNDS):
        held = at_floor | at_ceiling
        step = np.where(at_floor, floor, np.where(at_ceiling, ceiling, 0.0))
        free = np.flatnonzero(~held)
        if len(free):
            rest = slope + matrix @ step
            step[free] = np.linalg.solve(matrix[np.ix_(free, free)], -rest[free])
        pull = slope + matrix @ step
        now_floor = (at_floor & (pull > -1e-6)) | (~held & (step < floor - 1e-12))
        now_ceiling = (at_ceiling & (pull < 1e-6)) | (~held & (step > ceiling + 1e-12))
        if np.array_equal(now_floor, at_floor) and np.array_equal(now_ceiling, at_ceiling):
            return np.asarray(step)
        at_floor, at_ceiling = now_floor, now_ceiling
    return None


def row_covariance(
    model: Model,
    values: Array,
    group: Group,
    matrix: Array,
    samples: float,
    only: BoolArray | None = None,
) -> Array:
    """Covariance (5, 5) of the equations' residuals from a matrix of feature products over ``samples``.

    ``only`` picks active features, (k,); None takes all.
    """
    rows = model.rows
    h = model.features(values, group)
    if only is not None:
        h = np.where(only, h, 0.0)
    spread = np.zeros((len(h), len(Row)))
    spread[np.arange(len(h)), rows] = h
    covariance = spread.T @ matrix[model.chosen] @ spread
    return np.asarray(covariance / max(samples, 1.0))


def starting_arms(layout: Layout, groups: Sequence[Group]) -> dict[str, float]:
    """Moment arms (m) of each routing from a straight regression of tension on joint torque."""
    arms: dict[str, float] = {}
    order = sorted(groups, key=lambda g: g.key[1] != "free")
    zero_shift = NO_SHIFT
    for group in order:
        routing = {1: "flexion", -1: "extension"}.get(group.cable_sign)
        if routing is None or f"arm_mcp@{routing}" in arms:
            continue
        gram = group.gram
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

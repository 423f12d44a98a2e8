"""What a fit is shown of the recordings: products of its model's features, without noise, weighted.

The weights are the inverse covariance of the equations' noise, other ones where the motor stands, and what a
slack cable costs. Friction differs from run to run by a share of itself, a tip that sticks by how it was set
down.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fingerlab.diagnosis.equations.features import FeatureSet
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.equations.parameters import SET_DOWN
from fingerlab.diagnosis.fit.noise import (
    change_of_weight,
    encoder_spread,
    limited_noise,
    log_widening,
    noise_of_a_sample,
)
from fingerlab.diagnosis.gram.run_constants import EquationWeights, Offsets, RunConstants, RunTotals
from fingerlab.diagnosis.gram.sums import Group, Sums, total
from fingerlab.diagnosis.settings import (
    CORRELATED_VALUES,
    LEAST_REPEATS,
    MOST_FOLD_BYTES,
    RUN_VARIATION,
    SET_DOWN_N,
    SLACK_SPREAD_M,
    STICTION_MEAN_SQUARE,
    STROKE_VALUES,
    VALUES_OF_A_MOTION,
)
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.sessions.model import Array, IntArray

Weights = Mapping[GroupKey, Array]
"""Inverse covariance of the equations' noise for each group, (5, 5) over :class:`Row`."""


FoldNumbers = tuple[int, ...]
"""Folds of a group, by number."""


def change(before: Weights, after: Weights) -> float:
    """By how much the weight of an equation changed most: 0.1 is by a tenth, up or down."""
    return max((_change(before[key], after[key]) for key in after), default=0.0)


def _change(before: Array, after: Array) -> float:
    exist = np.diag(after) > 0  # an equation exists in a group of runs or does not, whatever its weight
    ratios = np.diag(after)[exist] / np.diag(before)[exist]
    return float(np.max(np.maximum(ratios, 1.0 / ratios), initial=1.0)) - 1.0


@dataclass(frozen=True)
class Weighted:
    """Weighted products of a model's features, (k, k) each, or (folds, k, k).

    ``curvature`` holds noise, so that it is positive; ``matrix`` does not: it gives cost and gradient.
    """

    curvature: Array
    matrix: Array

    def __getitem__(self, fold: Any) -> Weighted:
        """Of one or more of several folds."""
        return Weighted(self.curvature[fold], self.matrix[fold])

    def less(self, taken: Array) -> Weighted:
        """With this taken off both."""
        return Weighted(self.curvature - taken, self.matrix - taken)


@dataclass(frozen=True)
class FeatureProducts:
    """Products of a model's features in a group, (k, k) each, or its folds, (folds, k, k): see :class:`Sums`.

    Of all samples, of those ``at_rest``, and of those where the cable is slack: the cable equation's own
    (``slack_cable``), and all others' (``slack_others``). Those that end in ``denoised`` are without noise.
    """

    products: Array
    denoised: Array
    at_rest: Array | None
    at_rest_denoised: Array | None
    slack_cable: Array | None
    slack_others: Array | None
    slack_others_denoised: Array | None

    def __getitem__(self, fold: int) -> FeatureProducts:
        """Of one of several folds."""
        return self._each(lambda part: part[fold])

    def of(self, folds: IntArray, columns: IntArray) -> FeatureProducts:
        """Of some of several folds, the products of all features with some."""
        every = len(folds) == len(self.products)
        return self._each(lambda part: (part if every else part[folds]).take(columns, axis=2))

    def _each(self, taken: Callable[[Array], Array]) -> FeatureProducts:
        products, denoised, *parts = vars(self).values()
        others = (None if part is None else taken(part) for part in parts)
        return FeatureProducts(taken(products), taken(denoised), *others)

    @property
    def bytes(self) -> int:
        """That it takes."""
        return sum(part.nbytes for part in vars(self).values() if part is not None)


class Data:
    """Sums over the runs that a fit may see, with noise and without.

    Taking the noise away keeps noisy regressors from being pulled towards zero (Fuller, "Measurement Error
    Models", 1987, section 2.2): a tension that carries current noise would otherwise hide cable stretch.
    """

    def __init__(self, groups: Sequence[Group], constants: RunConstants | None = None) -> None:
        """``constants``: that every run has of its own; None: there are none."""
        self.groups = groups
        self.constants = constants
        self._noise: dict[tuple[int, bytes], tuple[Array, ...]] = {}
        self._kept: dict[tuple[int, bytes], FeatureProducts] = {}
        self._folds: OrderedDict[tuple[int, bytes], FeatureProducts] = OrderedDict()
        self._folds_bytes = 0
        self._joined: dict[tuple[int, FoldNumbers], Sums] = {}
        self._at_rest: dict[int, tuple[bytes, Array]] = {}

    @property
    def count(self) -> float:
        """Decimated samples of all groups, as independent values of one equation."""
        return EFFECTIVE_SHARE * sum(group.samples for group in self.groups)

    def raw(self, i: int, part: FoldNumbers | None) -> Sums:
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
        return [g.whole.without(noise_of_a_sample(g)) for g in self.groups]

    def weighted(
        self,
        found: FeatureProducts,
        model: Model,
        weight: Array,
        standing: Callable[[], Array],
        slack: Callable[[], Array],
    ) -> Weighted:
        """What a fit needs of what was gathered; a slack cable costs unless it may be so.

        ``weight`` of each product of the model's features, (k, k); ``standing`` and ``slack`` give by how
        much it changes where the motor stands and where the cable is slack, if that ever happens.
        """
        curvature, matrix = found.products * weight, found.denoised * weight
        if found.slack_others is not None and found.slack_others_denoised is not None:
            less = slack()
            curvature += found.slack_others * less
            matrix += found.slack_others_denoised * less
        if found.at_rest is not None and found.at_rest_denoised is not None:
            less = standing()
            curvature += found.at_rest * less
            matrix += found.at_rest_denoised * less
        if found.slack_cable is not None and not model.slack_free:
            charge = found.slack_cable * (EFFECTIVE_SHARE / SLACK_SPREAD_M**2)
            curvature += charge
            matrix += charge
        return Weighted(curvature, matrix)

    def gathered(self, i: int, part: FoldNumbers | None, model: Model) -> FeatureProducts:
        """Products of the model's features; those over whole groups are kept: they are asked for often."""
        whole = part is None or len(part) == len(self.groups[i].folds)
        key = i, model.active.tobytes()
        if not whole:
            return self._gathered(i, [self.raw(i, part)], model.pick)[0]
        if key not in self._kept:
            self._kept[key] = self._gathered(i, [self.raw(i, part)], model.pick)[0]
        return self._kept[key]

    def gathered_folds(self, i: int, model: Model) -> FeatureProducts:
        """The same for every fold of a group, (folds, k, k); kept for the models that were asked for last."""
        key = i, model.active.tobytes()
        found = self._folds.pop(key, None)
        if found is None:
            found = self._gathered(i, self.groups[i].folds, model.pick)
            self._folds_bytes += found.bytes
        self._folds[key] = found
        while self._folds_bytes > MOST_FOLD_BYTES and len(self._folds) > 1:
            self._folds_bytes -= self._folds.popitem(last=False)[1].bytes
        return found

    def _gathered(self, i: int, parts: Sequence[Sums], pick: FeatureSet) -> FeatureProducts:
        """Of several parts of group ``i``, (parts, k, k)."""
        slack_noise, moving_noise, rest_noise = self._noise_of(i, pick)
        raw = _of_each(pick, [part.products for part in parts])
        slack = _of_each(pick, [part.slack for part in parts])
        still = _of_each(pick, [part.rest for part in parts])
        assert raw is not None
        others = None
        if slack is not None:
            others = slack * (1.0 - pick.in_cable)
            raw -= slack * pick.in_cable
        samples, taut, rest = (
            np.array(counts)[:, None, None]
            for counts in zip(*((p.samples, p.taut_samples, p.rest_samples) for p in parts), strict=True)
        )
        loose = samples - taut, np.where(pick.in_cable, 0.0, slack_noise)
        standing = rest, rest_noise
        return FeatureProducts(
            raw,
            _less(raw, (taut - rest, moving_noise), standing, loose),
            still,
            None if still is None else _less(still, standing),
            None if slack is None else slack * pick.both_cable,
            others,
            None if others is None else _less(others, loose),
        )

    def _noise_of(self, i: int, pick: FeatureSet) -> tuple[Array, ...]:
        """What noise adds to products of features of a group, (k, k) each, as of :func:`limited_noise`."""
        signals, place = pick.each_once
        key = i, signals.tobytes()
        if key not in self._noise:
            self._noise[key] = limited_noise(self.groups[i], signals)
        square = place[:, None], place[None, :]
        return tuple(one[square] for one in self._noise[key])

    def by_constants(
        self, i: int, part: FoldNumbers | None, weights: EquationWeights, picks: Sequence[FeatureSet]
    ) -> tuple[Array, list[Array]] | None:
        """What ``schur_complement`` needs to take the runs' own constants out of products of some features.

        How well the constants are known, and for each of the ``picks`` its products with them; None: the runs
        of group ``i`` have none.
        """
        totals = self.totals(i, part)
        if self.constants is None or not totals:
            return None
        key = self.groups[i].key
        posterior_covariance = self.constants.posterior_covariance(key, totals, weights)
        return posterior_covariance, [self.constants.pull(key, totals, pick, weights) for pick in picks]

    def offsets(
        self, i: int, part: FoldNumbers | None, model: Model, coefficients: Array, weights: EquationWeights
    ) -> Offsets | None:
        """The constants of the runs of group ``i`` beside the residuals that a model leaves; None: none.

        Args:
            coefficients: of the model's active features, (k,).
        """
        found = self.by_constants(i, part, weights, [model.pick])
        if self.constants is None or found is None:
            return None
        posterior_covariance, (pull,) = found
        spreads = self.constants.spreads
        sources = spreads * np.einsum("rst,rkt,k->rs", posterior_covariance, pull, coefficients)
        deviations = spreads * np.sqrt(np.einsum("rss->rs", posterior_covariance))
        rows = sources @ self.constants.shares[self.groups[i].key].T
        return Offsets(tuple(t.number for t in self.totals(i, part)), sources, deviations, rows)

    def runs_of(self, i: int, part: FoldNumbers | None) -> Any:
        """Index of the runs of some folds among those of group ``i``, fold after fold."""
        if part is None:
            return slice(None)
        counts = np.array([len(fold.totals) for fold in self.groups[i].folds])
        ends = np.cumsum(counts)
        return np.concatenate([np.arange(ends[k] - counts[k], ends[k]) for k in part])

    def totals(self, i: int, part: FoldNumbers | None) -> list[RunTotals]:
        """Sums of the signals over the runs of some folds of group ``i``, or of all."""
        folds = self.groups[i].folds
        return [t for k in (range(len(folds)) if part is None else part) for t in folds[k].totals]

    def standing(self, i: int, weights: Array) -> Array:
        """How the encoder's step changes the weights of group ``i`` where the motor stands, (5, 5).

        It is kept while the weights stay the same.
        """
        key, known = weights.tobytes(), self._at_rest.get(i)
        if known is None or known[0] != key:
            spread = encoder_spread(self.groups[i].encoder_variance)
            known = key, change_of_weight(weights, spread)
            self._at_rest[i] = known
        return known[1]

    def stiction_weights(
        self, i: int, model: Model, coefficients: Array, weights: Array
    ) -> tuple[Array, float] | None:
        """What friction that sticks does to group ``i`` where the motor stands; None: nothing.

        The change of the weights, (5, 5), beside the encoder's, and by how much the logarithm of the density
        falls at all those moments together because the residual may lie further out. What a standstill holds
        is one unknown force, however long it is looked at. ``coefficients`` are the features', (k,).
        """
        group = self.groups[i]
        if group.whole.rest is None or not model.stiction:
            return None
        products = self.gathered(i, None, model).products
        spread = encoder_spread(group.encoder_variance)
        own = np.zeros((5, 5))
        for mine in map(np.flatnonzero, model.stiction):
            share = np.zeros((len(mine), 5))
            share[np.arange(len(mine)), model.rows[mine]] = coefficients[mine]
            own += share.T @ products[mine[:, None], mine] @ share
        own *= STICTION_MEAN_SQUARE / max(group.samples, 1.0)
        change = change_of_weight(weights, spread + own) - self.standing(i, weights)
        whole = group.whole
        values = max(EFFECTIVE_SHARE * whole.rest_samples / max(whole.standstills, 1), 1.0)  # of a standstill
        wide = log_widening(weights, values * (spread + own)) - log_widening(weights, values * spread)
        return change, min(whole.standstills, EFFECTIVE_SHARE * whole.rest_samples) * wide


def _of_each(pick: FeatureSet, products: Sequence[Array | None]) -> Array | None:
    """Products of the features in every part, (parts, k, k), zero where a part has none; None: none has."""
    if all(one is None for one in products):
        return None
    found = np.zeros((len(products), len(pick.rows), len(pick.rows)))
    for place, one in zip(found, products, strict=True):
        if one is not None:
            place[:] = pick.among(one)
    return found


def _less(products: Array, *noise: tuple[Array, Array]) -> Array:
    """Products of every part, (parts, k, k), less noise: samples, (parts, 1, 1), and that of one, (k, k)."""
    for samples, of_a_sample in noise:
        if samples.any():
            products = products - samples * of_a_sample
    return products


def temperature_of(misfit: float, count: float, runs: int = 0) -> float:
    """How much less than its face value a misfit of ``count`` independent values weighs.

    What no model explains is systematic and stays the same for a while; in short runs for no longer than
    a motion has different values.

    Args:
        runs: that the values are of; 0: long ones.
    """
    alike = CORRELATED_VALUES
    if runs:
        alike = float(np.clip(count / (runs * VALUES_OF_A_MOTION), STROKE_VALUES, CORRELATED_VALUES))
    return 1.0 + alike * max(misfit, 0.0) / max(count, 1.0)


def tells_set_down(group: Group, condition: int) -> bool:
    """Whether how a tip was set down is told from what the condition of a group's runs does."""
    return group.in_contact and len(group.of_condition(condition)) >= LEAST_REPEATS


def random_effect_columns(
    model: Model, values: Array, coefficients: Array, group: Group, condition: int = 0
) -> Array:
    """What one standard deviation of all that a run has of its own adds to the features, (k, parts).

    Args:
        values: of the model's unknowns, (p,).
        coefficients: of the features at these values, (k,).
        group, condition: to which the run belongs.
    """
    parts = [np.where(mine, RUN_VARIATION * coefficients, 0.0) for mine in model.run_varying]
    place = model.index.get(SET_DOWN)
    if place is not None and tells_set_down(group, condition):
        once = values.copy()
        once[place] = SET_DOWN_N  # the column is linear in it
        parts.append(np.where(model.set_down, model.features(once, group), 0.0))
    parts = [part for part in parts if part.any()]
    return np.stack(parts, axis=1) if parts else np.zeros((len(coefficients), 0))

"""A fitted model: its values, the weights under which it was fitted and scored, and its scores.

The misfit of a model is counted in units of the repeatability floor: chi-square per independent value, after
what noise alone would give has been taken away. It is reproducible by construction. A model's *sensitivity*
is what its last effect would do to these data at its typical strength, as far as the other unknowns cannot
take its place.

Two runs of one motion, before a known change and with it, are a pair. A model that is right tells their
difference down to its noise. One that is wrong in the same way in both runs does so, too: the pair says
nothing of it. What is left says how wrong the model is about the change.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fingerlab.diagnosis.equations.model import Choice, Model
from fingerlab.diagnosis.equations.parameters import KNOWN_CONSTANTS
from fingerlab.diagnosis.fit.bounded_step import bounded_step
from fingerlab.diagnosis.fit.data import Weights, random_effect_columns, temperature_of
from fingerlab.diagnosis.fit.noise import noise_of_a_sample
from fingerlab.diagnosis.fit.solver import Fit, Fitter
from fingerlab.diagnosis.gram.sums import Group, PairSums, feature_weights
from fingerlab.diagnosis.settings import AT_BOUND, CLEARLY_SHOWN, MOST_PAIRED, MOST_WIDENED
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.diagnosis.signals.scales import Scales, powers_of
from fingerlab.effects.base import ALONE, Effect
from fingerlab.sessions.model import Array, BoolArray


@dataclass(frozen=True)
class Sensitivity:
    """What the last effect of a model would do at its typical strength.

    Attributes:
        falls: by how much the misfit would fall with the effect, (conditions,); chi-square.
        strengths: the typical strength by key of the unknown, SI.
    """

    falls: Array
    strengths: Mapping[str, float]


def at_bound(value: float, low: float, high: float) -> bool:
    """Whether a value stands at one of its bounds; a bound of zero is a matter of sign."""
    near_low, near_high = ((1.0 - AT_BOUND) * abs(bound) for bound in (low, high))
    return (low != 0.0 and value < low + near_low) or (high != 0.0 and value > high - near_high)


def at_assumed_bounds(fitted: FittedModel, place: int = -1) -> list[str]:
    """Unknowns of the effect at a ``place`` of the model that stand at a bound which nobody measured."""
    effect = fitted.choices[place].effect
    found = []
    for name in _of_assumed_ranges(effect):
        index = fitted.model.index.get(_key_of(effect, name))
        gain = effect.unknowns[name]
        if index is not None and at_bound(float(fitted.fit.values[index]), gain.low, gain.high):
            found.append(name)
    return found


def _of_assumed_ranges(effect: Effect) -> list[str]:
    """Unknowns whose range nobody measured: strengths with a unit.

    A bound of zero is a matter of sign, one that a rig file or a data sheet gives is known, and a number
    without a unit does not grow with the machine.
    """
    return [
        name
        for name, gain in effect.unknowns.items()
        if gain.limits is None and gain.source.startswith("assumed") and any(powers_of(gain.unit))
    ]


def _key_of(effect: Effect, name: str) -> str:
    """The key of one of an effect's unknowns; a nuisance that it sets free keeps its own."""
    return name if name in effect.relaxes else f"{effect.id}.{name}"


def reaching(effect: Effect, values: Mapping[str, float], scales: Scales) -> Effect:
    """The effect with assumed ranges as wide as some values of its unknowns ask for, as a search makes them.

    Args:
        values: SI, by key; others may be among them. scales: in whose units the ranges are.
    """
    keys = {name: _key_of(effect, name) for name in _of_assumed_ranges(effect)}
    reduced = {n: values[k] / scales.of(effect.unknowns[n].unit) for n, k in keys.items() if k in values}
    for _ in range(MOST_WIDENED):
        known = effect.unknowns
        names = [name for name, value in reduced.items() if not known[name].low <= value <= known[name].high]
        if not names:
            break
        effect = effect.wider(names)
    return effect


def at_bounds(fitted: FittedModel) -> list[str]:
    """Strengths of the last effect that stand at the edge of what is allowed, whoever says so.

    A bound of zero is a matter of sign, and one near a point of a grid gives way to the next point.
    """
    effect, found = fitted.last_effect, []
    for name, key in own_keys(fitted, effect).items():
        if name not in effect.unknowns or effect.unknowns[name].limits is not None:
            continue
        place = fitted.model.index[key]
        low, high = float(fitted.model.low[place]), float(fitted.model.high[place])
        value = float(fitted.fit.values[place])
        if low < high and at_bound(value, low, high):
            found.append(name)
    return found


def nearest(models: Iterable[FittedModel]) -> list[FittedModel]:
    """One model of the same effects each, those that leave least first."""
    each = {tuple(one.effect_ids): one for one in sorted(models, key=lambda one: -one.misfit)}
    return sorted(each.values(), key=lambda one: one.misfit)


def at_found_shapes(fitted: FittedModel) -> list[Effect]:
    """The model's effects, each with the one shape that was found as its grid."""
    return [replace(c.effect, shapes=(c.effect.shapes[c.shape],)) for c in fitted.choices]


def with_shapes_of(catalogue: Sequence[Effect], found: Sequence[Effect]) -> list[Effect]:
    """The catalogue with the effects that were found in place of their namesakes."""
    return [next((f for f in found if f.id == e.id), e) for e in catalogue]


def with_other_laws(found: Sequence[Effect], catalogue: Sequence[Effect]) -> list[Effect]:
    """The effects, each at the one shape that was found; of friction that has several laws the grid stays.

    Beside others another of them may be right: what is best for an effect alone may stand for what is still
    missing. The shape that was found stands among its neighbours.
    """
    known = {effect.id: effect for effect in catalogue}
    return [_within_grid(effect, known.get(effect.id, effect)) for effect in found]


def _within_grid(found: Effect, grid: Effect) -> Effect:
    places = range(len(grid.shapes))
    if not any(one.get(ALONE) for one in found.shapes) or len({grid.law_at(i) for i in places}) < 2:
        return found
    (shape,), shapes = found.shapes, list(grid.shapes)
    unknowns = sorted(found.law_at(0))
    alike = [i for i in places if set(unknowns) >= grid.law_at(i)]
    own = np.array([shape[name] for name in unknowns])
    apart = {i: np.log(own / [grid.shapes[i].get(name, shape[name]) for name in unknowns]) for i in alike}
    nearest = min(apart, key=lambda i: float(np.abs(apart[i]).sum()), default=len(shapes) - 1)
    shapes.insert(nearest + int(nearest in apart and apart[nearest].sum() > 0.0), shape)
    return replace(grid, shapes=tuple(shapes))


NO_SENSITIVITY = Sensitivity(np.zeros(0), {})


@dataclass(frozen=True)
class FoldErrors:
    """What a model leaves of every fold of a group.

    Attributes:
        misfits: chi-square without noise, (folds,); those of a condition sum to the condition's.
        residuals: sums of products of the equations' residuals, (folds, 5, 5) over ``Row``, noise included.
    """

    misfits: Array
    residuals: Array


@dataclass(frozen=True)
class FittedModel:
    """A model with its fit, the weights of that fit, and the misfit left on each run under them.

    Attributes:
        weights: inverse covariance of the equations' noise under which it was fitted and scored.
        misfits: one line a condition of each group, (conditions, 2): chi-square without noise, independent
            values; from held-out runs where ``held_out`` is set; empty: not scored.
        in_contact: which conditions press on the load cell, (conditions,).
        in_sample: as ``misfits``, always of the fit to all runs; empty where it was not asked for.
        residuals: mean products of the equations' residuals for each group, (5, 5) over ``Row``, noise
            included; empty where it was not asked for.
        folds: the same fold by fold for each group, beside its misfit; empty where it was not asked for.
        runs: that it was scored on; at most as many as there are folds.
        widening: what it costs in twice the log density that sticking friction may hold any value at rest.
        prior_penalty: what the constants of the joints' equations cost in twice the log density.
        sensitivity: what the last effect would do; empty where it was not asked for.
        paired: one line for each pair of runs before a known change and with it, (pairs, 2), as ``misfits``.
    """

    model: Model
    fit: Fit
    weights: Weights
    misfits: Array = field(default_factory=lambda: np.zeros((0, 2)))
    in_contact: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    held_out: bool = False
    in_sample: Array = field(default_factory=lambda: np.zeros((0, 2)))
    residuals: Mapping[GroupKey, Array] = field(default_factory=dict)
    folds: Mapping[GroupKey, FoldErrors] = field(default_factory=dict)
    runs: int = 0
    widening: float = 0.0
    prior_penalty: float = 0.0
    sensitivity: Sensitivity = NO_SENSITIVITY
    paired: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def choices(self) -> tuple[Choice, ...]:
        """Its effects, each at a point of its grid, in the order in which they were added."""
        return self.model.choices

    @property
    def effect_ids(self) -> list[str]:
        """Ids of its effects."""
        return [choice.effect.id for choice in self.model.choices]

    @property
    def last_effect(self) -> Effect:
        """The effect that was added last; there must be one."""
        return self.model.choices[-1].effect

    def choice_of(self, effect: Effect) -> Choice:
        """The effect as the model holds it: of several that are equal a model is made with the first."""
        return next(c for c in self.choices if c.effect.id == effect.id)

    @property
    def values(self) -> dict[str, float]:
        """Value of every unknown by key, SI."""
        return {u.key: float(v) for u, v in zip(self.model.unknowns, self.fit.values, strict=True)}

    @property
    def misfit(self) -> float:
        """Chi-square without noise, every condition counting with the root of its length."""
        return float(self.misfits[:, 0] @ condition_weights(self.misfits[:, 1]))

    @property
    def misfit_in_contact(self) -> float:
        """The part of it that lies in contact."""
        weighted = self.misfits[:, 0] * condition_weights(self.misfits[:, 1])
        return float(weighted[self.in_contact].sum())

    @property
    def misfit_in_sample(self) -> float:
        """As ``misfit``, of the fit to all runs."""
        return float(self.in_sample[:, 0] @ condition_weights(self.in_sample[:, 1]))

    @property
    def sensitive_fall(self) -> float:
        """By how much the misfit would fall with the last effect if it had its typical strength."""
        if not len(self.sensitivity.falls):
            return 0.0
        return float(self.sensitivity.falls @ condition_weights(self.misfits[:, 1]))

    @property
    def count(self) -> float:
        """Independent values behind ``misfit``."""
        return float(self.misfits[:, 1].sum())

    def temperature(self, misfit: float | None = None) -> float:
        """The :func:`temperature_of` of its misfit, or of another one of the same runs."""
        return temperature_of(self.misfit if misfit is None else misfit, self.count, self.runs)

    @cached_property
    def constants(self) -> dict[str, float]:
        """How far off the rig's constants are where the runs put them, in tolerances, by unknown.

        One that an effect of the model sets free is not among them.
        """
        free = {name for choice in self.choices for name in choice.effect.relaxes}
        return {
            unknown.key: float(value) / unknown.parameter.typical
            for unknown, value in zip(self.model.unknowns, self.fit.values, strict=True)
            if unknown.name in KNOWN_CONSTANTS - free and not unknown.effect
        }

    @property
    def constants_off(self) -> float:
        """The same of all of them, as a chi-square."""
        return sum(off**2 for off in self.constants.values())

    def strength_beside(self, base: FittedModel) -> float:
        """Of the last effect, in multiples of what its sensitivity is of; root mean square.

        What an effect sets free of which nothing is known, as a moment arm, is told by how it has changed.
        """
        return self._strength(base, self.sensitivity.strengths)

    def strength_of_all(self, base: FittedModel) -> float:
        """The same of every strength that the last effect's law has, not of those alone that show best.

        A spring that differs at one joint may be hidden there, and be told by the rig's constants.
        """
        own, offsets = own_keys(self, self.last_effect), self.last_effect.offsets
        keys = [key for name, key in own.items() if name not in offsets]
        index, unknowns = self.model.index, self.model.unknowns
        return self._strength(base, {key: unknowns[index[key]].parameter.typical for key in keys})

    def _strength(self, base: FittedModel, typical: Mapping[str, float]) -> float:
        before, found = base.values, []
        for key, size in typical.items():
            one = self.model.unknowns[self.model.index[key]]
            usual = before.get(key, 0.0) if one.parameter.open and not one.effect else 0.0
            found.append((float(self.fit.values[self.model.index[key]]) - usual) / size)
        return float(np.sqrt(np.mean(np.square(found)))) if found else 0.0

    @property
    def score(self) -> float:
        """Error over all equations and samples in units of the repeatability floor; 1.0 is the floor."""
        return float(np.sqrt(1.0 + max(float(self.misfits[:, 0].sum()), 0.0) / max(self.count, 1.0)))


def condition_weights(counts: Array) -> Array:
    """What each value of a condition counts, (conditions,); 1 on average.

    What no model explains is partly the same in every run of a condition, and partly another in each: a
    condition counts with the root of its length.

    Args:
        counts: independent values of each condition, (conditions,).
    """
    if not len(counts) or counts.sum() <= 0:
        return np.ones(len(counts))
    weights = 1.0 / np.sqrt(np.maximum(counts, 1.0))
    return np.asarray(weights * counts.sum() / float(weights @ counts))


def own_keys(fitted: FittedModel, effect: Effect) -> dict[str, str]:
    """Name of each of the effect's parameters -> key of the unknown, as far as its law at hand uses it."""
    if effect.special == "delay":
        return {"delay": "delay"}
    keys = {name: f"{effect.id}.{name}" for name in effect.gains} | {name: name for name in effect.relaxes}
    shape = next((c.shape for c in fitted.choices if c.effect.id == effect.id), None)
    if shape is not None and not effect.special:
        layout = fitted.model.layout
        used = {layout.features[i].parameter for i in layout.indices(effect.id, shape)}
        keys = {name: key for name, key in keys.items() if name in effect.relaxes or name in used}
    return {name: key for name, key in keys.items() if key in fitted.model.index}


def sensitivity(fitter: Fitter, fitted: FittedModel) -> Sensitivity:
    """What the last effect would do at its typical strength, whichever of its gains shows best."""
    if not fitted.choices:
        return NO_SENSITIVITY
    effect = fitted.last_effect
    names = [n for n in own_keys(fitted, effect).items() if n[0] not in effect.offsets]
    places = [fitted.model.index[key] for _, key in names]
    typical = np.array([fitted.model.unknowns[i].parameter.typical for i in places])
    if not places:
        return NO_SENSITIVITY
    patterns = list(np.diag(typical)) + ([typical] if len(places) > 1 else [])
    best = NO_SENSITIVITY
    for pattern in patterns:
        falls = _falls(fitter, fitted, _unbound(fitted, places, pattern))
        if falls.sum() < CLEARLY_SHOWN * fitter.data.count:
            falls = _falls(fitter, fitted, _moved(fitted, fitted.fit.values, places, pattern))
        if not len(best.falls) or falls.sum() > best.falls.sum():
            strengths = {key: float(s) for (_, key), s in zip(names, pattern, strict=True) if s}
            best = Sensitivity(falls, strengths)
    return best


def values_if_there(fitted: FittedModel) -> Array:
    """Values of the unknowns, (p,), likeliest by the old runs if the last effect is there and they hid it.

    It has the strengths of its sensitivity, in the sense in which it came out: how strong that was is mostly
    chance. What else could be it stands where the fit has it, and does about the difference what hides that
    best, within its bounds.
    """
    places = [fitted.model.index[key] for key in fitted.sensitivity.strengths]
    typical = np.array(list(fitted.sensitivity.strengths.values()))
    found = fitted.fit.values[places]
    strengths = np.copysign(typical, np.where(found == 0.0, typical, found))
    moved = fitted.fit.values + _moved(fitted, fitted.fit.values, places, strengths - found)
    return np.asarray(np.clip(moved, fitted.model.low, fitted.model.high))


def _unbound(fitted: FittedModel, places: list[int], strengths: Array) -> Array:
    """As ``_moved``, but beyond the bounds of the others: what is seen then is seen the more within them."""
    covariance = fitted.fit.covariance
    own = np.linalg.lstsq(covariance[np.ix_(places, places)], strengths, rcond=None)[0]
    return np.asarray(covariance[:, places] @ own)


def _moved(fitted: FittedModel, values: Array, places: list[int], strengths: Array) -> Array:
    """The strengths at their places, and what the other unknowns do about them within their bounds, (p,)."""
    start = np.zeros(len(values))
    start[places] = strengths
    own = np.zeros(len(start), dtype=bool)
    own[places] = True
    low = np.where(own, start, np.minimum(fitted.model.low - values, 0.0))
    high = np.where(own, start, np.maximum(fitted.model.high - values, 0.0))
    information = fitted.fit.information
    return np.asarray(start + bounded_step(start, information @ start, information, low, high))


def _falls(fitter: Fitter, fitted: FittedModel, moved: Array) -> Array:
    """Chi-square that ``moved`` unknowns stand for, (conditions,)."""
    falls = []
    for i, group in enumerate(fitter.data.groups):
        change = fitted.model.coefficients(fitted.fit.values, group)[1] @ moved
        for condition in group.conditions:
            matrix = fitter.part(i, tuple(group.of_condition(condition))).matrix
            falls.append(max(float(change @ matrix @ change), 0.0))
    return np.array(falls)


def paired_misfit(fitted: FittedModel, pair: PairSums, group: Group) -> tuple[float, float]:
    """Chi-square of a pair's difference without noise, and the independent values behind it.

    A friction that wanders between the two runs explains what it may.
    """
    model, values = fitted.model, fitted.fit.values
    coefficients, pick = model.features(values, group), model.pick
    weights = feature_weights(fitted.weights[group.key], pick.rows) * EFFECTIVE_SHARE
    square = float(
        coefficients
        @ (pair.difference.of(pick, noise_of_a_sample(group, pick.square)) * weights)
        @ coefficients
    )
    own = random_effect_columns(model, values, coefficients, group)
    if own.shape[1]:
        across, mean = (pick.among(products) * weights for products in (pair.across, pair.mean))
        pull = coefficients @ across @ own
        square -= float(pull @ np.linalg.solve(own.T @ mean @ own + np.eye(own.shape[1]), pull))
    return square, EFFECTIVE_SHARE * group.equations * pair.difference.samples


def paired_log_odds(candidates: Sequence[FittedModel]) -> Array:
    """Log odds of models by what they leave of the pairs, against the best, (models,); 0 without pairs.

    They are limited, for the fits have seen the runs, too.
    """
    if not candidates or not len(candidates[0].paired):
        return np.zeros(len(candidates))
    left = np.array([np.maximum(one.paired[:, 0], 0.0) for one in candidates])  # (models, pairs)
    counts, best = candidates[0].paired[:, 1], left.min(axis=0)
    temperature = np.array([temperature_of(m, c) for m, c in zip(best, counts, strict=True)])
    log = -0.5 * ((left - best) / temperature).sum(axis=1)
    return np.asarray(np.maximum(log - log.max(), -MOST_PAIRED))


def paired_score(fitted: FittedModel, pair: int) -> float:
    """Error of a pair's difference in units of its floor; 1.0 is the floor."""
    square, count = fitted.paired[pair]
    return float(np.sqrt(1.0 + max(square, 0.0) / max(count, 1.0)))

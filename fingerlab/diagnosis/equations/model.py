"""A model: which unknowns are free, and the features' coefficients with their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fingerlab.diagnosis.equations.features import (
    FORCE,
    NO_SHIFT,
    SLOPE,
    BoolArray,
    Feature,
    IntArray,
    Layout,
    Pick,
    shift_weights,
    slope_weights,
)
from fingerlab.diagnosis.equations.parameters import SET_DOWN, TIP_LAWS, Tie, tie
from fingerlab.diagnosis.gram.sums import Group
from fingerlab.effects.base import Effect, Row
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

CABLE_NAMES = {1: "flexion", -1: "extension", 0: "none"}
OPEN = ("arm_", "offset", "bench_inertia", "bench_gain", "bench_offset")
"""Unknowns of the bench of which nothing is known before a run tells."""


@dataclass(frozen=True)
class Choice:
    """An effect at one point of its grid."""

    effect: Effect
    shape: int = 0


@dataclass(frozen=True)
class Unknown:
    """A free parameter: ``key`` is its name, with ``@routing`` where each routing has its own."""

    key: str
    gain: Parameter

    @property
    def open(self) -> bool:
        """Whether nothing is known of it before a run tells: an arm, an offset, an effect's gain."""
        return self.key.startswith(OPEN) or "." in self.key


@dataclass
class Model:
    """Nominal model, nuisances and chosen effects over the groups of a recording.

    Attributes:
        unknowns: free parameters in the order of the parameter vector.
        active: indices of the features that take part, shape (k,).
        slack_free: whether the cable may be slack at no cost.
        delayed: whether the motor's channels may be late by more than a millisecond.
        tip_law: which of ``features.TIP_LAWS`` it holds.
        tie: holds the two cables' moment arms together; None: they are free.
    """

    layout: Layout
    choices: tuple[Choice, ...]
    unknowns: tuple[Unknown, ...]
    active: Array
    slack_free: bool
    delayed: bool
    tip_law: str
    index: dict[str, int]
    tie: Tie | None = None
    tables: dict[tuple[int, ...], _Table] = field(default_factory=dict)
    scalings: dict[int, tuple[Array, Array, Array]] = field(default_factory=dict)

    @cached_property
    def low(self) -> Array:
        """Lower bounds, shape (p,)."""
        return np.array([u.gain.low for u in self.unknowns])

    @cached_property
    def high(self) -> Array:
        """Upper bounds, shape (p,)."""
        return np.array([u.gain.high for u in self.unknowns])

    @cached_property
    def spread(self) -> Array:
        """Prior standard deviation of every unknown, shape (p,); weak for arms and effects."""
        return np.array([u.gain.typical for u in self.unknowns])

    @cached_property
    def pick(self) -> Pick:
        """The active features, for sums over samples."""
        return self.layout.every[self.active]

    @property
    def rows(self) -> IntArray:
        """The equation that each active feature stands in, shape (k,)."""
        return self.pick.rows

    @cached_property
    def sticking(self) -> list[BoolArray]:
        """For every gain of a friction that sticks, which of the active features are its own, (k,) each."""
        return self._features_of_gains(lambda gain: gain.holds_at_rest)

    @cached_property
    def wandering(self) -> list[BoolArray]:
        """The same for every gain that differs from run to run."""
        return self._features_of_gains(lambda gain: gain.varies_between_runs)

    @cached_property
    def set_down(self) -> BoolArray:
        """Which of the active features are what a tip that sticks was set down with, (k,)."""
        return np.array([self.layout.features[i].parameter == SET_DOWN for i in self.active])

    @property
    def last_gains(self) -> list[str]:
        """Gains of the last effect that its law at hand uses; others of its laws may have more."""
        effect, shape = self.choices[-1].effect, self.choices[-1].shape
        used = {self.layout.features[i].parameter for i in self.layout.indices(effect.id, shape)}
        return [name for name in effect.gains if name in used or effect.special]

    def _features_of_gains(self, meant: Callable[[Parameter], bool]) -> list[BoolArray]:
        owned = [(self.layout.features[i].owner, self.layout.features[i].parameter) for i in self.active]
        gains = [(c.effect.id, n) for c in self.choices for n, gain in c.effect.gains.items() if meant(gain)]
        return [np.array([mine == gain for mine in owned]) for gain in gains if gain in owned]

    def start(self) -> Array:
        """A vector to start from: no deviation, arms of 10 mm."""
        values = np.array([0.01 if u.key.startswith("arm_") else 0.0 for u in self.unknowns])
        return np.clip(values, self.low, self.high)

    def features(self, values: Array, group: Group) -> Array:
        """Coefficients of the active features for one group, (k,)."""
        return self.features_of(values, (group.cable_sign,))[0]

    def features_of(self, values: Array, cable_signs: tuple[int, ...]) -> Array:
        """The same for several groups, (groups, k), told by their cables."""
        amount, scale, weight, _ = self._parts(self._table(cable_signs), values)
        return -amount * scale * weight

    def coefficients(self, values: Array, group: Group) -> tuple[Array, Array]:
        """Coefficients of the active features for one group, (k,), and their derivatives, (k, p)."""
        h, jacobian = self.coefficients_of(values, (group.cable_sign,))
        return h[0], jacobian[0]

    def coefficients_of(self, values: Array, cable_signs: tuple[int, ...]) -> tuple[Array, Array]:
        """The same for several groups, (groups, k) and (groups, k, p), told by their cables."""
        table = self._table(cable_signs)
        amount, scale, weight, slopes = self._parts(table, values)
        turned = np.where(
            table.inverse, -(scale**2) / np.where(table.sign == 0.0, 1.0, table.sign), table.sign
        )
        jacobian = np.zeros((*amount.shape, len(values) + 2))
        flat = jacobian.reshape(-1, len(values) + 2)
        flat[table.lines, table.parameter.reshape(-1)] = (-scale * weight).reshape(-1)
        flat[table.lines, table.scale_by.reshape(-1)] -= (amount * turned * weight).reshape(-1)
        if table.delay >= 0:
            late = table.shifted
            jacobian[:, late, table.delay] -= (amount * scale)[:, late] * slopes[table.shifts]
        return -amount * scale * weight, jacobian[:, :, : len(values)]

    def unit_coefficients(self, values: Array, group: Group) -> Array:
        """Coefficient of every feature of the layout, active or not, per unit of its own unknown.

        Shape (features,); features of the motor's channels, which are kept at several shifts, are not meant.
        """
        if group.cable_sign not in self.scalings:
            every = [_scaling(f, self.index, group.cable_sign) for f in self.layout.features]
            places = np.array([len(values) if place < 0 else place for place, _, _ in every])
            inverse, sign = np.array([s[1] for s in every]), np.array([s[2] for s in every])
            self.scalings[group.cable_sign] = places, inverse, sign
        places, inverse, sign = self.scalings[group.cable_sign]
        scale = np.append(values, 1.0)[places]
        return np.asarray(-sign * np.where(inverse, 1.0 / np.where(inverse, scale, 1.0), scale))

    def _parts(self, table: _Table, values: Array) -> tuple[Array, Array, Array, Array]:
        """Of the active features amount and scale, (groups, k), the shift's weight, (k,), and its slopes."""
        padded = np.concatenate((values, (0.0, 1.0)))
        amount = table.constant + padded[table.parameter]
        scale = padded[table.scale_by]
        flat = scale.reshape(-1)
        flat[table.divides] = 1.0 / flat[table.divides]
        scale *= table.sign
        delay = float(values[table.delay]) if table.delay >= 0 else 0.0
        weights, slopes = shift_weights(delay) if self.delayed else slope_weights(delay)
        weight = np.ones(len(table.shift))
        weight[table.shifted] = weights[table.shifts]
        return amount, scale, weight, slopes

    def _table(self, cable_signs: tuple[int, ...]) -> _Table:
        if cable_signs not in self.tables:
            self.tables[cable_signs] = _make_table(self, cable_signs)
        return self.tables[cable_signs]

    def parameter_index(self, feature: Feature, routing: str) -> int:
        """Index of the unknown that multiplies a feature; -1 where there is none."""
        if not feature.parameter:
            return -1
        if feature.owner is not None and not feature.borrowed:
            return self.index.get(f"{feature.owner}.{feature.parameter}", -1)
        key = f"{feature.parameter}@{routing}" if feature.routed else feature.parameter
        return self.index.get(key, -1)


@dataclass(frozen=True)
class _Table:
    """The active features as arrays, (groups, k), for the routing of each group.

    Indices of unknowns point into the vector of values with 0 and 1 appended, so that a feature without an
    unknown needs no case of its own.
    """

    constant: Array
    parameter: IntArray
    scale_by: IntArray  # index of the unknown that scales the feature: moment arm or compliance
    inverse: Array  # whether it divides
    sign: Array
    shift: IntArray  # (k,), -1 stands for none
    delay: int  # -1 stands for none

    @cached_property
    def lines(self) -> IntArray:
        return np.arange(self.constant.size)

    @cached_property
    def divides(self) -> IntArray:
        return np.flatnonzero(self.inverse)

    @cached_property
    def shifted(self) -> IntArray:
        return np.flatnonzero(self.shift >= 0)

    @cached_property
    def shifts(self) -> IntArray:
        return self.shift[self.shifted]


def _make_table(model: Model, cable_signs: tuple[int, ...]) -> _Table:
    features = [model.layout.features[i] for i in model.active]

    def padded(indices: list[list[int]], none: int) -> IntArray:
        found = np.array(indices)
        return np.where(found < 0, none, found)

    scales = [[_scaling(f, model.index, sign) for f in features] for sign in cable_signs]
    places = [[model.parameter_index(f, CABLE_NAMES[sign]) for f in features] for sign in cable_signs]
    return _Table(
        constant=np.array([[f.constant for f in features]] * len(cable_signs)),
        parameter=padded(places, len(model.unknowns)),
        scale_by=padded([[s[0] for s in line] for line in scales], len(model.unknowns) + 1),
        inverse=np.array([[s[1] for s in line] for line in scales]),
        sign=np.array([[s[2] for s in line] for line in scales]),
        shift=np.array([-1 if f.shift is None else f.shift for f in features]),
        delay=model.index.get("delay", -1),
    )


def _scaling(feature: Feature, index: Mapping[str, int], cable_sign: int) -> tuple[int, bool, float]:
    """Index of the unknown that scales a feature (-1: none), whether it divides, and sign and factor."""
    routing, sign = CABLE_NAMES[cable_sign], feature.factor * cable_sign
    if feature.scale == "direct":
        return -1, False, feature.factor
    if feature.scale == "compliance":
        return index.get("cable_compliance", -1), False, -feature.factor
    if feature.scale == "joint":
        arm = "arm_mcp" if feature.row == Row.MCP else "arm_pip"
        return index.get(f"{arm}@{routing}", -1), True, sign
    return index.get(f"{feature.scale}@{routing}", -1), False, sign


def build(
    layout: Layout, groups: Sequence[Group], choices: Sequence[Choice], tip_law: str = "slides"
) -> Model:
    """The model with the nominal equations, all nuisances (one law of the tip), and the chosen effects."""
    absent = {name for law, names in TIP_LAWS.items() if law != tip_law for name in names}
    special = {c.effect.special for c in choices}
    relaxed = {name: gain for c in choices for name, gain in c.effect.relaxes.items()}
    delayed = "delay" in special
    unknowns = _bench_unknowns(layout, groups, relaxed, absent, choices)
    active = _bench_features(layout, absent, delayed)
    for choice in choices:
        if choice.effect.special == "delay":
            continue
        unknowns += [
            Unknown(f"{choice.effect.id}.{name}", gain)
            for name, gain in choice.effect.gains_at(choice.shape).items()
        ]
        active += list(layout.indices(choice.effect.id, choice.shape))
    index = {u.key: i for i, u in enumerate(unknowns)}
    tied = None if any(name.startswith("arm_") for name in relaxed) else tie(index, layout.arm_spread)
    return Model(
        layout,
        tuple(choices),
        tuple(unknowns),
        np.array(active),
        "slack" in special,
        delayed,
        tip_law,
        index,
        tied,
    )


def _bench_unknowns(
    layout: Layout,
    groups: Sequence[Group],
    relaxed: Mapping[str, Parameter],
    absent: Collection[str],
    choices: Sequence[Choice],
) -> list[Unknown]:
    """What every model leaves open that can matter in these groups, and the delay.

    Args:
        relaxed: ranges that a chosen effect widens. absent: names of another law of the tip.
    """
    unknowns: list[Unknown] = []
    routings = [CABLE_NAMES[s] for s in sorted({g.cable_sign for g in groups}) if s != 0]
    contact = any(g.in_contact for g in groups)
    named = {f.parameter: f for f in layout.features if f.owner is None and f.parameter is not None}
    if routings:
        named["cable_compliance"] = Feature(Row.CABLE, "cable_compliance")
    for name, feature in named.items():
        if name in absent or (name.startswith(("lateral", "force_gain", "tip_")) and not contact):
            continue
        keys = [f"{name}@{r}" for r in routings] if feature.routed else [name]
        unknowns += [Unknown(key, relaxed.get(name, layout.nuisances[name])) for key in keys]
    if routings:
        unknowns += [
            Unknown(f"{arm}@{r}", relaxed.get(f"{arm}@{r}", layout.nuisances[arm]))
            for r in routings
            for arm in ("arm_mcp", "arm_pip")
        ]
        delays = [c.effect.gains["delay"] for c in choices if c.effect.special == "delay"]
        unknowns += [Unknown("delay", gain) for gain in delays or [layout.nuisances["delay"]]]
    return unknowns


def _bench_features(layout: Layout, absent: Collection[str], delayed: bool) -> list[int]:
    """Indices of the features of every model; a motor channel that is not late needs few of its shifts."""
    kept = (None, NO_SHIFT, SLOPE)
    return [
        i
        for i in layout.base
        if layout.features[i] != FORCE
        and layout.features[i].parameter not in absent
        and (layout.features[i].shift != SLOPE if delayed else layout.features[i].shift in kept)
    ]

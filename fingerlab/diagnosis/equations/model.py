"""A model: which unknowns are free, and the features' coefficients with their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from fingerlab.diagnosis.equations.coefficients import DELAY, NO_SHIFT, SLOPE, Coefficients
from fingerlab.diagnosis.equations.features import Feature, FeatureSet, Layout
from fingerlab.diagnosis.equations.parameters import (
    ARMS,
    KNOCK_GAIN,
    SET_DOWN,
    TIP_LAWS,
    TORQUE_LAG,
    TORQUE_LAG_SQUARE,
    ArmRatioPenalty,
    tie,
)
from fingerlab.effects.base import Effect, Row
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import CABLE_NAMES, Array, BoolArray, IntArray


@dataclass(frozen=True)
class Choice:
    """An effect at one point of its grid."""

    effect: Effect
    shape: int = 0


@dataclass(frozen=True)
class Unknown:
    """A free parameter of a model: a gain of an effect, or a nuisance.

    Attributes:
        name: among the gains of its effect, or among the nuisances.
        effect: id of the effect whose gain it is; empty for a nuisance.
        cable: the routing that it is for; empty: one value for all.
    """

    name: str
    parameter: Parameter
    effect: str = ""
    cable: str = ""

    @cached_property
    def key(self) -> str:
        """By which its value is kept and told."""
        if self.effect:
            return f"{self.effect}.{self.name}"
        return f"{self.name}@{self.cable}" if self.cable else self.name

    @property
    def open(self) -> bool:
        """Whether nothing is known of it before a run tells: an arm, an offset, an effect's gain."""
        return bool(self.effect) or self.parameter.open


class Runs(Protocol):
    """What a model must know of the runs that it is for."""

    @property
    def cable_sign(self) -> int:
        """+1 flexion, -1 extension, 0 the motor alone."""

    @property
    def in_contact(self) -> bool:
        """Whether they press on the load cell."""


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
        fixed: values that somebody holds unknowns at, by key, in the fit's units.
    """

    layout: Layout
    choices: tuple[Choice, ...]
    unknowns: tuple[Unknown, ...]
    active: Array
    slack_free: bool
    delayed: bool
    tip_law: str
    index: dict[str, int]
    tie: ArmRatioPenalty | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)

    def fixing(self, fixed: Mapping[str, float]) -> Model:
        """The model with unknowns fixed at values, by key, in the fit's units; other keys are passed over."""
        fixed = {key: value for key, value in fixed.items() if key in self.index}
        unknowns = list(self.unknowns)
        for key, value in fixed.items():
            one = unknowns[self.index[key]]
            unknowns[self.index[key]] = replace(one, parameter=replace(one.parameter, low=value, high=value))
        return replace(self, unknowns=tuple(unknowns), fixed={**self.fixed, **fixed}) if fixed else self

    @cached_property
    def terms(self) -> Coefficients:
        """Coefficients of the active features."""
        return Coefficients([self.layout.features[i] for i in self.active], self.index, self.delayed)

    @cached_property
    def _every_term(self) -> Coefficients:
        return Coefficients(self.layout.features, self.index, self.delayed)

    @cached_property
    def low(self) -> Array:
        """Lower bounds, shape (p,)."""
        return np.array([u.parameter.low for u in self.unknowns])

    @cached_property
    def high(self) -> Array:
        """Upper bounds, shape (p,)."""
        return np.array([u.parameter.high for u in self.unknowns])

    @cached_property
    def spread(self) -> Array:
        """Prior standard deviation of every unknown, shape (p,); weak for arms and effects."""
        return np.array([u.parameter.typical for u in self.unknowns])

    @cached_property
    def pick(self) -> FeatureSet:
        """The active features, for sums over samples."""
        return self.layout.every[self.active]

    @property
    def rows(self) -> IntArray:
        """The equation that each active feature stands in, shape (k,)."""
        return self.pick.rows

    @cached_property
    def stiction(self) -> list[BoolArray]:
        """For every gain of a friction that sticks, which of the active features are its own, (k,) each."""
        return self._features_of_gains(lambda gain: gain.holds_at_rest)

    @cached_property
    def run_varying(self) -> list[BoolArray]:
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
        return [
            name
            for name in effect.gains
            if effect.special or (name in used and f"{effect.id}.{name}" in self.index)
        ]

    def _features_of_gains(self, meant: Callable[[Parameter], bool]) -> list[BoolArray]:
        owned = [(self.layout.features[i].owner, self.layout.features[i].parameter) for i in self.active]
        gains = [(c.effect.id, n) for c in self.choices for n, gain in c.effect.gains.items() if meant(gain)]
        return [np.array([mine == gain for mine in owned]) for gain in gains if gain in owned]

    def start(self) -> Array:
        """A vector to start from: no deviation, arms of 10 mm."""
        return np.clip(np.array([u.parameter.default for u in self.unknowns]), self.low, self.high)

    def features(self, values: Array, group: Runs) -> Array:
        """Coefficients of the active features for one group, (k,)."""
        return self.terms.of(values, (group.cable_sign,))[0]

    def coefficients(self, values: Array, group: Runs) -> tuple[Array, Array]:
        """Coefficients of the active features for one group, (k,), and their derivatives, (k, p)."""
        h, jacobian = self.terms.with_jacobian(values, (group.cable_sign,))
        return h[0], jacobian[0]

    def unit_coefficients(self, values: Array, group: Runs) -> Array:
        """Coefficient of every feature of the layout, active or not, per unit of its own unknown."""
        return self._every_term.per_unit(values, group.cable_sign)


def build(
    layout: Layout, groups: Sequence[Runs], choices: Sequence[Choice], tip_law: str = "slides"
) -> Model:
    """The model with the nominal equations, all nuisances (one law of the tip), and the chosen effects."""
    absent = {name for law, names in TIP_LAWS.items() if law != tip_law for name in names}
    absent |= set() if layout.late_torque else {TORQUE_LAG, TORQUE_LAG_SQUARE}
    absent |= set() if layout.knocks else {KNOCK_GAIN}
    special = {c.effect.special for c in choices}
    relaxed = {name: gain for c in choices for name, gain in c.effect.relaxes.items()}
    delayed = "delay" in special
    cables = {"", *(CABLE_NAMES[g.cable_sign] for g in groups)}
    unknowns = _nuisance_unknowns(layout, groups, relaxed, absent, choices)
    active = _base_features(layout, absent, delayed)
    for choice in choices:
        if choice.effect.special == "delay":
            continue
        unknowns += [
            Unknown(name, gain, effect=choice.effect.id)
            for name, gain in choice.effect.gains_at(choice.shape).items()
            if gain.cable in cables
        ]
        active += list(layout.indices(choice.effect.id, choice.shape))
    index = {u.key: i for i, u in enumerate(unknowns)}
    free_arms = any(u.name in ARMS and u.key in relaxed for u in unknowns)
    tied = None if free_arms else tie(index, layout.arm_spread)
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


def _nuisance_unknowns(
    layout: Layout,
    groups: Sequence[Runs],
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
    named = dict(layout.nuisance_features)
    if routings:
        named["cable_compliance"] = Feature(Row.CABLE, "cable_compliance")
    for name, feature in named.items():
        nuisance = layout.nuisances[name]
        if name in absent or (nuisance.phase == "contact" and not contact):
            continue
        parameter = _range(nuisance, relaxed, name)
        unknowns += [Unknown(name, parameter, cable=r) for r in (routings if feature.per_cable else [""])]
    if routings:
        unknowns += [
            Unknown(arm, _range(layout.nuisances[arm], relaxed, f"{arm}@{r}"), cable=r)
            for r in routings
            for arm in ARMS
        ]
        delays = [c.effect.gains[DELAY] for c in choices if c.effect.special == "delay"]
        unknowns += [Unknown(DELAY, one) for one in delays or [layout.nuisances[DELAY]]]
    return unknowns


def _range(usual: Parameter, relaxed: Mapping[str, Parameter], key: str) -> Parameter:
    """A nuisance in the range that an effect gives it, or in its usual one."""
    found = relaxed.get(key)
    return usual if found is None else replace(found, open=usual.open, default=usual.default)


def _base_features(layout: Layout, absent: Collection[str], delayed: bool) -> list[int]:
    """Indices of the features of every model; a motor channel that is not late needs few of its shifts."""
    return [
        i
        for i, feature in layout.base_features
        if feature.parameter not in absent
        and (feature.shift != SLOPE if delayed else feature.shift in (None, NO_SHIFT, SLOPE))
    ]

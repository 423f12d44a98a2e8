"""A model: which unknowns are free, and the features' coefficients with their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fingerlab.identify.diagnosis.features import (
    NO_SHIFT,
    SLOPE,
    Feature,
    Layout,
    shift_weights,
    slope_weights,
)
from fingerlab.identify.diagnosis.reduction import Group
from fingerlab.physics.effects.base import Effect, Gain, Row
from fingerlab.sessions.model import Array

CABLE_NAMES = {1: "flexion", -1: "extension", 0: "none"}


@dataclass(frozen=True)
class Choice:
    """An effect at one point of its grid."""

    effect: Effect
    shape: int = 0


@dataclass(frozen=True)
class Unknown:
    """A free parameter: ``key`` is its name, with ``@routing`` where each routing has its own."""

    key: str
    gain: Gain


@dataclass
class Model:
    """Nominal model, nuisances and chosen effects over the groups of a recording.

    Attributes:
        unknowns: free parameters in the order of the parameter vector.
        active: indices of the features that take part, shape (k,).
        slack_free: whether the cable may be slack at no cost.
        delayed: whether the motor's channels may be late by more than a millisecond.
    """

    layout: Layout
    choices: tuple[Choice, ...]
    unknowns: tuple[Unknown, ...]
    active: Array
    slack_free: bool
    delayed: bool
    index: dict[str, int]
    tables: dict[int, _Table] = field(default_factory=dict)

    @property
    def low(self) -> Array:
        """Lower bounds, shape (p,)."""
        return np.array([u.gain.low for u in self.unknowns])

    @property
    def high(self) -> Array:
        """Upper bounds, shape (p,)."""
        return np.array([u.gain.high for u in self.unknowns])

    @property
    def spread(self) -> Array:
        """Prior standard deviation of every unknown, shape (p,); weak for arms and effects."""
        return np.array([u.gain.typical for u in self.unknowns])

    def start(self) -> Array:
        """A vector to start from: no deviation, arms of 10 mm."""
        values = np.zeros(len(self.unknowns))
        for i, unknown in enumerate(self.unknowns):
            if unknown.key.startswith("arm_"):
                values[i] = 0.01
        return np.clip(values, self.low, self.high)

    def coefficients(self, values: Array, group: Group) -> tuple[Array, Array]:
        """Coefficients of the active features for one group, (k,), and their derivatives, (k, p)."""
        table = self._table(group.cable_sign)
        amount = table.constant + np.where(table.parameter >= 0, values[table.parameter], 0.0)
        inner = np.where(table.scale_by >= 0, values[table.scale_by], 1.0)
        divisor = np.where(table.inverse, inner, 1.0)
        scale = table.sign * np.where(table.inverse, 1.0 / divisor, inner)
        change = table.sign * np.where(table.inverse, -1.0 / divisor**2, 1.0)
        delay = float(values[table.delay]) if table.delay >= 0 else 0.0
        weights, slopes = shift_weights(delay) if self.delayed else slope_weights(delay)
        shifted = table.shift >= 0
        weight = np.where(shifted, weights[table.shift], 1.0)
        lines = np.arange(len(amount))
        jacobian = np.zeros((len(amount), len(values)))
        own = table.parameter >= 0
        jacobian[lines[own], table.parameter[own]] -= (scale * weight)[own]
        scaled = table.scale_by >= 0
        jacobian[lines[scaled], table.scale_by[scaled]] -= (amount * change * weight)[scaled]
        if table.delay >= 0:
            jacobian[lines[shifted], table.delay] -= (amount * scale)[shifted] * slopes[table.shift[shifted]]
        return -amount * scale * weight, jacobian

    def _table(self, cable_sign: int) -> _Table:
        if cable_sign not in self.tables:
            self.tables[cable_sign] = _make_table(self, cable_sign)
        return self.tables[cable_sign]

    def parameter_index(self, feature: Feature, routing: str) -> int:
        """Index of the unknown that multiplies a feature; -1 where there is none."""
        if not feature.parameter:
            return -1
        if feature.owner is not None:
            return self.index.get(f"{feature.owner}.{feature.parameter}", -1)
        key = f"{feature.parameter}@{routing}" if feature.routed else feature.parameter
        return self.index.get(key, -1)


@dataclass(frozen=True)
class _Table:
    """The active features as arrays, for one routing; -1 stands for none."""

    constant: Array
    parameter: Array
    scale_by: Array  # index of the unknown that scales the feature: moment arm or compliance
    inverse: Array  # whether it divides
    sign: Array
    shift: Array
    delay: int


def _make_table(model: Model, cable_sign: int) -> _Table:
    routing = CABLE_NAMES[cable_sign]
    arms = {n: model.index.get(f"{n}@{routing}", -1) for n in ("arm_mcp", "arm_pip")}
    compliance = model.index.get("cable_compliance", -1)
    features = [model.layout.features[i] for i in model.active]

    def scale(feature: Feature) -> tuple[int, bool, float]:
        if feature.scale == "direct":
            return -1, False, 1.0
        if feature.scale == "compliance":
            return compliance, False, -1.0
        if feature.scale == "joint":
            return arms["arm_mcp" if feature.row == Row.MCP else "arm_pip"], True, float(cable_sign)
        return arms[feature.scale], False, float(cable_sign)

    scales = [scale(f) for f in features]
    return _Table(
        constant=np.array([f.constant for f in features]),
        parameter=np.array([model.parameter_index(f, routing) for f in features]),
        scale_by=np.array([s[0] for s in scales]),
        inverse=np.array([s[1] for s in scales]),
        sign=np.array([s[2] for s in scales]),
        shift=np.array([-1 if f.shift is None else f.shift for f in features]),
        delay=model.index.get("delay", -1),
    )


def build(layout: Layout, groups: Sequence[Group], choices: Sequence[Choice]) -> Model:
    """The model with the nominal equations, all nuisances, and the chosen effects."""
    unknowns: list[Unknown] = []
    routings = [CABLE_NAMES[s] for s in sorted({g.cable_sign for g in groups}) if s != 0]
    contact = any(g.key[1] == "contact" for g in groups)
    special = {c.effect.special for c in choices}
    relaxed = {name: gain for c in choices for name, gain in c.effect.relaxes.items()}
    named = {f.parameter: f for f in layout.features if f.owner is None and f.parameter is not None}
    if routings:
        named["cable_compliance"] = Feature(Row.CABLE, "cable_compliance")
    for name, feature in named.items():
        if name.startswith(("lateral", "force_gain")) and not contact:
            continue
        keys = [f"{name}@{r}" for r in routings] if feature.routed else [name]
        unknowns += [Unknown(key, relaxed.get(name, layout.nuisances[name])) for key in keys]
    if routings:
        unknowns += [
            Unknown(f"{arm}@{r}", layout.nuisances[arm]) for r in routings for arm in ("arm_mcp", "arm_pip")
        ]
        for choice in choices:
            if choice.effect.special == "delay":
                unknowns.append(Unknown("delay", choice.effect.gains["delay"]))
        if "delay" not in special:
            unknowns.append(Unknown("delay", layout.nuisances["delay"]))
    delayed = "delay" in special
    kept = (None, NO_SHIFT, SLOPE)
    active = [
        i
        for i in layout.base
        if layout.features[i].row != Row.FORCE
        and (layout.features[i].shift != SLOPE if delayed else layout.features[i].shift in kept)
    ]
    for choice in choices:
        if choice.effect.special == "delay":
            continue
        unknowns += [
            Unknown(f"{choice.effect.id}.{name}", gain) for name, gain in choice.effect.gains.items()
        ]
        active += list(layout.indices(choice.effect.id, choice.shape))
    index = {u.key: i for i, u in enumerate(unknowns)}
    return Model(
        layout, tuple(choices), tuple(unknowns), np.array(active), "slack" in special, delayed, index
    )

"""Columns that a run is asked for, and how their coefficients follow from the unknowns.

The order is decided here and nowhere else: a layout is made from the first run of a kind, and every later
reading of any run meets the same columns in the same order. A delay keeps the motor's channels at several
shifts; what lies between them is interpolated.

The coefficient of a feature is

    h = -(constant + parameter) * scale * shift weight

with ``scale`` 1, the signed moment arm, its inverse, or the cable's compliance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from fingerlab.diagnosis.equations.features import (
    NO_SHIFT,
    SLOPE,
    Feature,
    IntArray,
    Layout,
    base_columns,
    beside_a_finger,
    shift_weights,
    shifted_columns,
    slope_weights,
    turned_columns,
)
from fingerlab.diagnosis.equations.parameters import nuisance_ranges, spread_of
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect, Row, Term
from fingerlab.effects.joints import LATE, as_effects_see_it
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, Session

Column = tuple[Array, int | None, bool, Callable[[], Feature]]
"""Values at the wide rate, shift, whether a user's own effect brings them, and what makes their feature."""


def all_columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    """All features in order: those of every model, then those of the effects."""
    yield from _common_columns(motion)
    yield from effect_columns(motion, effects)


def _as_routed(motion: Motion, columns: Iterator[Column]) -> Iterator[Column]:
    """The columns of a run whose cable may have been guided otherwise, at known shares of its moment arms.

    Arms are told as they usually are: what an equation divides by its own arm is divided by the share here,
    and what it multiplies is multiplied. Each such column is a signal of its own.
    """
    change = motion.intervention
    if change is None:
        yield from columns
        return
    shares = {Row.MCP: 1.0 / change.mcp_arm, Row.PIP: 1.0 / change.pip_arm}
    arms = {"arm_mcp": change.mcp_arm, "arm_pip": change.pip_arm}
    for values, shift, own, make in columns:
        feature = make()
        share = shares.get(feature.row) if feature.scale == "joint" else arms.get(feature.scale)
        yield (values if share is None else values * share), shift, own, make


def _common_columns(motion: Motion) -> Iterator[Column]:
    """The features of every model."""
    return _as_routed(motion, _base(motion))


def _base(motion: Motion) -> Iterator[Column]:
    """A motor channel comes once for every shift, with the same values."""
    for feature, values in base_columns(motion):
        yield values, None, False, partial(replace, feature)
    for feature, values in shifted_columns(motion):
        shifts: Sequence[int | None] = [None] if motion.finger is None else range(SLOPE + 1)
        for k in shifts:
            yield values, k, False, partial(replace, feature, shift=k)


def effect_columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    """The features of the effects that act in such a run, in order."""
    return _as_routed(motion, _of_effects(motion, effects))


def _of_effects(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    alone = motion.finger is None
    motion = as_effects_see_it(motion, effects)
    for effect in effects:
        if alone and not effect.bench:
            continue
        own = of_the_user(effect)
        for index, shape in enumerate(effect.shapes):
            for t in effect.columns(motion, shape):
                yield t.values, None, own, partial(_feature, t, effect.id, index)
            for feature, values in turned_columns(motion, effect, index):
                yield values, None, False, partial(replace, feature)


def _feature(term: Term, owner: str, shape: int) -> Feature:
    return Feature(term.row, term.gain, term.constant, term.scale, owner=owner, shape=shape)


def of_the_user(effect: Effect) -> bool:
    """Whether it is none of the built-in effects; those may come with refined shapes."""
    known = CATALOGUE.get(effect.id)
    return known is None or known.columns is not effect.columns


def layout_of(
    motion: Motion, session: Session, effects: Sequence[Effect], beside_finger: bool = False
) -> Layout:
    """The features in the order in which :func:`all_columns` gives them.

    ``beside_finger``: if it is a run of the motor alone, the motor is that of a finger's runs.
    """
    features: list[Feature] = []
    signals: list[int] = []
    known: dict[tuple[int, int | None], int] = {}
    kept: list[Array] = []  # so that no array's identity is given to a later one
    count = base = 0
    for values, shift, own, make in all_columns(motion, effects):
        feature = make()
        if beside_finger and motion.finger is None:
            feature = beside_a_finger(feature, session.rig)
        base += feature.owner is None
        kept.append(values)
        # What is one array in two equations is one signal; a user's own code is not relied on for that.
        key = id(values), None if shift == NO_SHIFT else shift
        place = count if own else known.setdefault(key, count)
        count = max(count, place + 1)
        features.append(feature)
        signals.append(place)
    return Layout(
        tuple(features), nuisance_ranges(session.rig), tuple(effects), np.arange(base), np.array(signals),
        spread_of(session.rig),
    )  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """What is asked of a run: its kind's features as signals, of which the first ``common`` every model has.

    ``signals`` (features,) count from ``start``, the kind's first signal among those of all runs.
    ``cached`` (signals,) says which signal of the first reading each is, -1 for those to be formed;
    ``formed`` are the positions of the effects that bring the latter, and ``features`` the signals of every
    effect's features in order. ``first``: there was no reading before.
    ``seek_cycle``: no run says how often its motion repeats. ``orders``: periods a turn at which a torque may
    repeat with the angle of a motor alone.
    """

    signals: IntArray
    common: int
    start: int
    cached: IntArray
    formed: tuple[int, ...]
    features: tuple[IntArray, ...]
    first: bool
    seek_cycle: bool = False
    orders: tuple[float, ...] = ()


def asked_of(
    layout: Layout, effects: Sequence[Effect], first: Layout | None, start: int, anew: bool, seek_cycle: bool
) -> Asked:
    """What a layout asks of the runs of its kind.

    Args:
        first: layout of the first reading; None: this is it. anew: the columns of all effects are to be
            formed, those that the first reading knew, too.
    """
    cached, formed = np.full(layout.signal_count, -1), []
    common = len(layout.base)
    if first is not None:
        cached[layout.signals[:common]] = first.signals[:common]
    late = any(shape.get(LATE) for e in effects for shape in e.shapes)  # all columns are others then
    known = {} if first is None or anew or late else {e.id: e for e in first.effects}
    for number, effect in enumerate(effects):
        before = known.get(effect.id)
        if first is None or before is None or not _same_columns(effect, before):
            formed.append(number)
            continue
        for shape in range(len(effect.shapes)):
            mine, theirs = layout.indices(effect.id, shape), first.indices(effect.id, shape)
            cached[layout.signals[mine]] = first.signals[theirs]
    features = tuple(
        np.concatenate([layout.signals[layout.indices(e.id, k)] for k in range(len(e.shapes))] or [NONE])
        for e in effects
    )
    return Asked(layout.signals, common, start, cached, tuple(formed), features, first is None, seek_cycle)


NONE = np.zeros(0, dtype=int)


def _same_columns(one: Effect, other: Effect) -> bool:
    return one.columns is other.columns and list(one.shapes) == list(other.shapes)


CABLE_NAMES = {1: "flexion", -1: "extension", 0: "none"}
DELAY = "delay"


def key_of(feature: Feature, cable: str) -> str:
    """The unknown that multiplies a feature, by the key that values are kept under; empty: none does."""
    if not feature.parameter:
        return ""
    if feature.owner is not None and not feature.borrowed:
        return f"{feature.owner}.{feature.parameter}"
    return f"{feature.parameter}@{cable}" if feature.routed else feature.parameter


def scale_key(feature: Feature, cable: str) -> str:
    """The unknown that scales a feature; empty: none does."""
    if feature.scale == "direct":
        return ""
    if feature.scale == "compliance":
        return "cable_compliance"
    if feature.scale == "joint":
        return f"{'arm_mcp' if feature.row == Row.MCP else 'arm_pip'}@{cable}"
    return f"{feature.scale}@{cable}"


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of some features, (k,), with their derivatives.

    Attributes:
        index: place of each unknown among the values, by key.
        delayed: whether the motor's channels may be late by more than a millisecond.
    """

    features: Sequence[Feature]
    index: Mapping[str, int]
    delayed: bool
    _tables: dict[tuple[int, ...], _Table] = field(default_factory=dict, repr=False)
    _routed: dict[int, _Routed] = field(default_factory=dict, repr=False)
    _scalings: dict[int, tuple[Array, Array, Array]] = field(default_factory=dict, repr=False)

    def of(self, values: Array, cable_signs: tuple[int, ...]) -> Array:
        """For several groups of runs, (groups, k), told by their cables."""
        amount, scale, weight, _ = self._parts(self._table(cable_signs), values)
        return -amount * scale * weight

    def with_jacobian(self, values: Array, cable_signs: tuple[int, ...]) -> tuple[Array, Array]:
        """The same with their derivatives, (groups, k) and (groups, k, p)."""
        table = self._table(cable_signs)
        amount, scale, weight, slopes = self._parts(table, values)
        turned = np.where(table.inverse, -(scale**2) / table.divisor, table.sign)
        jacobian = np.zeros((*amount.shape, len(values) + 2))
        flat = jacobian.reshape(-1, len(values) + 2)
        flat[table.lines, table.parameter.reshape(-1)] = (-scale * weight).reshape(-1)
        flat[table.lines, table.scale_by.reshape(-1)] -= (amount * turned * weight).reshape(-1)
        if table.delay >= 0:
            late = table.shifted
            jacobian[:, late, table.delay] -= (amount * scale)[:, late] * slopes[table.shifts]
        return -amount * scale * weight, jacobian[:, :, : len(values)]

    def per_unit(self, values: Array, cable_sign: int) -> Array:
        """Coefficient of every feature per unit of its own unknown, (k,).

        Features of the motor's channels, which are kept at several shifts, are not meant.
        """
        if cable_sign not in self._scalings:
            every = [self._scaling(f, cable_sign) for f in self.features]
            places = np.array([len(values) if place < 0 else place for place, _, _ in every])
            inverse, sign = np.array([s[1] for s in every]), np.array([s[2] for s in every])
            self._scalings[cable_sign] = places, inverse, sign
        places, inverse, sign = self._scalings[cable_sign]
        scale = np.append(values, 1.0)[places]
        return np.asarray(-sign * np.where(inverse, 1.0 / np.where(inverse, scale, 1.0), scale))

    def _parts(self, table: _Table, values: Array) -> tuple[Array, Array, Array, Array]:
        """Amount and scale of the features, (groups, k), the shift's weight, (k,), and its slopes."""
        padded = np.empty(len(values) + 2)
        padded[:-2], padded[-2], padded[-1] = values, 0.0, 1.0
        amount = table.constant + padded[table.parameter]
        scale = padded[table.scale_by]
        flat = scale.reshape(-1)
        flat[table.divides] = 1.0 / flat[table.divides]
        scale *= table.sign
        weights, slopes = delay_weights(float(values[table.delay]) if table.delay >= 0 else 0.0, self.delayed)
        weight = np.ones(len(table.shift))
        weight[table.shifted] = weights[table.shifts]
        return amount, scale, weight, slopes

    def _table(self, cable_signs: tuple[int, ...]) -> _Table:
        if cable_signs not in self._tables:
            self._tables[cable_signs] = self._made(cable_signs)
        return self._tables[cable_signs]

    def _made(self, cable_signs: tuple[int, ...]) -> _Table:
        lines = [self._of_cable(sign) for sign in cable_signs]
        return _Table(
            constant=np.array([[f.constant for f in self.features]] * len(cable_signs)),
            parameter=np.array([line.parameter for line in lines]),
            scale_by=np.array([line.scale_by for line in lines]),
            inverse=np.array([line.inverse for line in lines]),
            sign=np.array([line.sign for line in lines]),
            shift=np.array([-1 if f.shift is None else f.shift for f in self.features]),
            delay=self.index.get(DELAY, -1),
        )

    def _of_cable(self, cable_sign: int) -> _Routed:
        """What a table says of one group; groups on the same cable have it in common."""
        if cable_sign not in self._routed:
            none, cable = max(self.index.values(), default=-1) + 1, CABLE_NAMES[cable_sign]
            scales = [self._scaling(f, cable_sign) for f in self.features]
            self._routed[cable_sign] = _Routed(
                np.array([self.index.get(key_of(f, cable), none) for f in self.features]),
                np.array([none + 1 if place < 0 else place for place, _, _ in scales]),
                np.array([inverse for _, inverse, _ in scales]),
                np.array([sign for _, _, sign in scales]),
            )
        return self._routed[cable_sign]

    def _scaling(self, feature: Feature, cable_sign: int) -> tuple[int, bool, float]:
        """Index of the unknown that scales a feature (-1: none), whether it divides, and sign and factor."""
        place = self.index.get(scale_key(feature, CABLE_NAMES[cable_sign]), -1)
        if feature.scale == "direct":
            return -1, False, feature.factor
        if feature.scale == "compliance":
            return place, False, -feature.factor
        return place, feature.scale == "joint", feature.factor * cable_sign


def delay_weights(delay: float, delayed: bool) -> tuple[Array, Array]:
    """Weights of the kept shifts and of the slope of a channel that is late by ``delay`` (s); their slopes.

    ``delayed``: it may be late by more than a millisecond.
    """
    return shift_weights(delay) if delayed else slope_weights(delay)


@dataclass(frozen=True)
class _Routed:
    """A line of a :class:`_Table`, (k,) each."""

    parameter: IntArray
    scale_by: IntArray
    inverse: Array
    sign: Array


@dataclass(frozen=True)
class _Table:
    """The features as arrays, (groups, k), for the routing of each group.

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
    def divisor(self) -> Array:
        """The sign where there is one."""
        return np.where(self.sign == 0.0, 1.0, self.sign)

    @cached_property
    def divides(self) -> IntArray:
        return np.flatnonzero(self.inverse)

    @cached_property
    def shifted(self) -> IntArray:
        return np.flatnonzero(self.shift >= 0)

    @cached_property
    def shifts(self) -> IntArray:
        return self.shift[self.shifted]

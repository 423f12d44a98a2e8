"""How the coefficients of the features follow from the unknowns.

The coefficient of a feature is

    h = -(constant + parameter) * scale * shift weight / torque's share

with ``scale`` 1, the signed moment arm, its inverse, or the cable's compliance. A delay keeps the motor's
channels at several shifts; what lies between them is interpolated. The torque's share, 1 - gain, is what the
torque is worth of what it reads: the equations of the joints and of a motor beside them are told in units of
the torque as it was measured. Otherwise a fit could shrink all that a model leaves by taking the torque, the
springs and the masses for smaller together. Of the other equations it is one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fingerlab.diagnosis.equations.features import Feature
from fingerlab.diagnosis.settings import WIDE_RATE_HZ
from fingerlab.effects.base import Row
from fingerlab.sessions.model import CABLE_NAMES, Array, BoolArray, IntArray

DELAY = "delay"
TORQUE_GAIN = "torque_gain"
"""Share that the motor's torque reads too high."""


def key_of(feature: Feature, cable: str) -> str:
    """The unknown that multiplies a feature, by the key that values are kept under; empty: none does."""
    if not feature.parameter:
        return ""
    if feature.owner is not None and not feature.shares_nuisance:
        return f"{feature.owner}.{feature.parameter}"
    return f"{feature.parameter}@{cable}" if feature.per_cable else feature.parameter


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
        table = self._table(cable_signs)
        amount, scale, weight, _ = self._parts(table, values)
        return -amount * scale * weight * table.per_torque(values)

    def with_jacobian(self, values: Array, cable_signs: tuple[int, ...]) -> tuple[Array, Array]:
        """The same with their derivatives, (groups, k) and (groups, k, p)."""
        table = self._table(cable_signs)
        amount, scale, weight, slopes = self._parts(table, values)
        turned = np.where(table.inverse, -(scale**2) / table.divisor, table.sign)
        per_torque = table.per_torque(values)
        weight = weight * per_torque
        jacobian = np.zeros((*amount.shape, len(values) + 2))
        flat = jacobian.reshape(-1, len(values) + 2)
        flat[table.lines, table.parameter.reshape(-1)] = (-scale * weight).reshape(-1)
        flat[table.lines, table.scale_by.reshape(-1)] -= (amount * turned * weight).reshape(-1)
        if table.delay >= 0:
            late = table.shifted
            jacobian[:, late, table.delay] -= (amount * scale * per_torque)[:, late] * slopes[table.shifts]
        h = -amount * scale * weight
        if table.gain >= 0:
            jacobian[:, :, table.gain] += h * per_torque * table.of_torque
        return h, jacobian[:, :, : len(values)]

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
        per_torque = self._table((cable_sign,)).per_torque(values)
        return np.asarray(-sign * np.where(inverse, 1.0 / np.where(inverse, scale, 1.0), scale)) * per_torque

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
            gain=self.index.get(TORQUE_GAIN, -1),
            of_torque=np.array([f.row in (Row.MCP, Row.PIP, Row.BENCH) for f in self.features], dtype=bool),
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
    gain: int  # the same: what the torque reads too high
    of_torque: BoolArray  # (k,), of an equation that the torque stands in as it is

    def per_torque(self, values: Array) -> Array:
        """One over the torque's share in each feature's equation, (k,)."""
        gain = values[self.gain] if self.gain >= 0 else 0.0
        return np.asarray(1.0 / (1.0 - gain * self.of_torque))

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


SHIFTS_S = tuple(0.024 * k for k in range(-2, 10))
"""Delays (s) at which the motor's channels are kept; values between them are interpolated."""
SHIFT_SAMPLES = tuple(round(s * WIDE_RATE_HZ) for s in SHIFTS_S)
"""The same in samples of the wide rate."""
INTERPOLATION_POINTS = 6
SLOPE = len(SHIFTS_S)
"""Index of a motor channel's time derivative, which replaces the shifts below a delay of 1 ms."""
NO_SHIFT = SHIFTS_S.index(0.0)


def shift_weights(delay: float) -> tuple[Array, Array]:
    """Weights of the kept shifts that interpolate at ``delay`` (s), and their derivative (1/s).

    Lagrange interpolation on the six nearest shifts: at 24 ms spacing a 3 Hz tone is off by less than
    0.01 %, an 8 Hz tone by 1.4 %, and a delay that is itself a kept shift by nothing.
    """
    spacing = SHIFTS_S[1] - SHIFTS_S[0]
    count = INTERPOLATION_POINTS
    place = (delay - SHIFTS_S[0]) / spacing
    first = min(max(int(np.floor(place)) - count // 2 + 1, 0), len(SHIFTS_S) - count)
    powers = (place - first) ** np.arange(count)
    weights, slopes = np.zeros(SLOPE + 1), np.zeros(SLOPE + 1)
    weights[first : first + count] = _LAGRANGE @ powers
    slopes[first : first + count] = _LAGRANGE[:, 1:] @ (np.arange(1, count) * powers[:-1]) / spacing
    return weights, slopes


def slope_weights(delay: float) -> tuple[Array, Array]:
    """The same for a delay so small that the channel's value and time derivative are enough."""
    weights, slopes = np.zeros(SLOPE + 1), np.zeros(SLOPE + 1)
    weights[NO_SHIFT], weights[SLOPE], slopes[SLOPE] = 1.0, -delay, -1.0
    return weights, slopes


_LAGRANGE = np.linalg.inv(np.vander(np.arange(float(INTERPOLATION_POINTS)), increasing=True)).T
"""Row k: coefficients, by rising power, of the polynomial that is 1 at node k and 0 at the others."""

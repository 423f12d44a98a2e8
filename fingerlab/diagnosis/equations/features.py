"""Which columns stand in which equation, and how their coefficients depend on the unknowns.

The residual of every equation is a linear combination of *features*: measured signals, the nominal
model's parts, nuisances that every model carries, and the terms of the effects. A feature's coefficient is

    h = -(constant + parameter) * scale * shift weight

with ``scale`` 1, the signed moment arm, or its inverse. All that depends on the unknowns sits in h, so that
one Gram matrix of the features serves every model, every grid point and every fold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fingerlab.diagnosis.equations.parameters import (
    CHANGED_OFFSET,
    KNOCK_GAIN,
    TIP_LAWS,
    TORQUE_LAG,
    TORQUE_LAG_SQUARE,
    TORQUE_ZERO,
)
from fingerlab.diagnosis.settings import LIFTED_M, SLIP_STIFFNESSES, TIP_STIFFNESS, USUAL_SPREAD
from fingerlab.diagnosis.signals.scales import SI, Scales
from fingerlab.effects.base import Effect, Gain, Row, Scale
from fingerlab.effects.contact_compliance import SIDEWAYS_STIFFNESSES
from fingerlab.effects.joints import lateral_levers
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion, dragged_tip, pressed, tip_depth, tip_reach, while_pressed
from fingerlab.rig.file import Finger, Rig
from fingerlab.sessions.model import Array, BoolArray, IntArray


@dataclass(frozen=True)
class FeatureSet:
    """Some features in order: the signal that each is, and the equation it stands in; shapes (k,)."""

    signals: IntArray
    rows: IntArray

    @cached_property
    def cable(self) -> BoolArray:
        """Which of them stand in the cable equation, (k,)."""
        return np.asarray(self.rows == Row.CABLE)

    @cached_property
    def square(self) -> tuple[IntArray, IntArray]:
        """Index of their square matrix among the signals."""
        return self.signals[:, None], self.signals[None, :]

    @cached_property
    def in_cable(self) -> Array:
        """1 where one of two features stands in the cable equation, (k, k)."""
        return np.logical_or.outer(self.cable, self.cable).astype(float)

    @cached_property
    def both_cable(self) -> Array:
        """1 where both do, (k, k)."""
        return np.logical_and.outer(self.cable, self.cable).astype(float)

    @cached_property
    def each_once(self) -> tuple[IntArray, IntArray]:
        """Their signals, each once, (n,), and the place of every feature's among them, (k,)."""
        signals, place = np.unique(self.signals, return_inverse=True)
        return signals, place

    @cached_property
    def _places(self) -> dict[int, IntArray]:
        return {}

    def among(self, products: Array) -> Array:
        """Their products, (k, k), of those of all signals, (signals, signals)."""
        size = len(products)
        if size not in self._places:
            self._places[size] = self.signals[:, None] * size + self.signals
        return np.asarray(products.take(self._places[size]))

    def __getitem__(self, chosen: Any) -> FeatureSet:
        return FeatureSet(self.signals[chosen], self.rows[chosen])


@dataclass(frozen=True)
class Feature:
    """A column: the equation it stands in and how its coefficient is made.

    ``parameter`` names the unknown that multiplies it (None: none), ``constant`` what it has without.
    ``shift`` is an index into ``SHIFTS_S``, or ``SLOPE``, for a motor channel. Unknowns ``per_cable`` have
    one value for each cable routing. ``owner`` is the effect that brings it (None: nominal model and
    nuisances) at the grid point ``shape``. ``shares_nuisance``: its unknown is one of the nuisances, no own
    gain. ``factor`` multiplies the coefficient, too.
    """

    row: Row
    parameter: str | None = None
    constant: float = 0.0
    scale: Scale = "direct"
    shift: int | None = None
    per_cable: bool = False
    owner: str | None = None
    shape: int = 0
    shares_nuisance: bool = False
    factor: float = 1.0


FORCE = Feature(Row.TIP)
"""The load cell's reading, N: kept for scale, without a coefficient."""


@dataclass(frozen=True)
class Layout:
    """The features in order, and the plausible range of every unknown of nominal model and nuisances."""

    features: tuple[Feature, ...]
    nuisances: dict[str, Gain]
    effects: tuple[Effect, ...]
    base: IntArray = field(repr=False)  # indices of the features without an owner
    signals: IntArray = field(repr=False)  # (features,): which signal a feature is; some are the same one
    arm_spread: float = USUAL_SPREAD  # of the ratio of flexion to extension arms
    scales: Scales = SI  # the reduced units in which all of it is told
    knocks: bool = False  # whether a tip that lands knocks on the load cell in any run
    late_torque: bool = False  # whether the torque of a motor alone may be logged later than its position

    @cached_property
    def _rows(self) -> IntArray:
        return np.array([int(f.row) for f in self.features])

    @cached_property
    def _owned(self) -> dict[tuple[str | None, int], IntArray]:
        places: dict[tuple[str | None, int], list[int]] = {}
        for i, feature in enumerate(self.features):
            places.setdefault((feature.owner, feature.shape), []).append(i)
        return {key: np.array(found, dtype=int) for key, found in places.items()}

    @cached_property
    def base_features(self) -> list[tuple[int, Feature]]:
        """The features of every model that have a coefficient, with their indices."""
        every = [(int(i), self.features[i]) for i in self.base]
        return [(i, feature) for i, feature in every if feature != FORCE]

    @cached_property
    def nuisance_features(self) -> dict[str, Feature]:
        """A feature of each nuisance, by the nuisance's name."""
        every = (self.features[i] for i in self.base)
        return {f.parameter: f for f in every if f.parameter is not None}

    def rows(self) -> IntArray:
        """Equation of each feature, shape (features,)."""
        return self._rows

    @cached_property
    def every(self) -> FeatureSet:
        """All features, for sums over samples."""
        return FeatureSet(self.signals, self._rows)

    @property
    def signal_count(self) -> int:
        """How many different signals there are."""
        return int(self.signals.max()) + 1

    def indices(self, owner: str, shape: int) -> IntArray:
        """Features that the effect ``owner`` brings at its grid point ``shape``."""
        return self._owned.get((owner, shape), np.zeros(0, dtype=int))


def _part(finger: Finger, **changes: float) -> Finger:
    values = {**vars(finger), **changes}
    return Finger(**values)


def _joint_parts(finger: Finger, motion: Motion) -> list[tuple[Row, str, Array]]:
    """LHS of each joint split by the constant that it is proportional to; torques in N m."""
    _, q = motion.finger_and_joints
    names = ("mcp_stiffness", "pip_stiffness", "proximal_inertia", "distal_inertia")
    still = dict.fromkeys(names, 0.0)
    proximal = _part(finger, distal_mass=0.0, **{**still, "proximal_inertia": finger.proximal_inertia})
    distal = _part(finger, proximal_mass=0.0, **{**still, "distal_inertia": finger.distal_inertia})
    return [
        (Row.MCP, "proximal_mass", nominal.mcp_torque(proximal, q).total),
        (Row.MCP, "distal_mass", nominal.mcp_torque(distal, q).total),
        (Row.MCP, "mcp_stiffness", finger.mcp_stiffness * q.mcp),
        (Row.PIP, "distal_mass", nominal.pip_torque(distal, q).total),
        (Row.PIP, "pip_stiffness", finger.pip_stiffness * q.pip),
    ]


def _length_parts(finger: Finger, motion: Motion) -> list[tuple[Row, str, Array]]:
    """By how much weight and inertia change with a share of each phalanx' length, in each joint; N m.

    All is quadratic in a length, so that the central difference is exact. The levers of the contact force
    stay as they are told: what another length does to them, the force along the face does as well, and an
    effect that leans the force could not be told from it.
    """
    _, q = motion.finger_and_joints
    still = dict.fromkeys(("mcp_stiffness", "pip_stiffness"), 0.0)
    joints = ((Row.MCP, nominal.mcp_torque), (Row.PIP, nominal.pip_torque))
    parts: list[tuple[Row, str, Array]] = []
    for name in ("proximal_half_length", "distal_half_length"):
        length = vars(finger)[name]
        longer, shorter = (_part(finger, **{**still, name: length * k}) for k in (1.5, 0.5))
        parts += [(row, name, torque(longer, q).total - torque(shorter, q).total) for row, torque in joints]
    return parts


def base_columns(motion: Motion) -> list[tuple[Feature, Array]]:
    """Features of nominal model and nuisances, shifted motor channels excepted."""
    if motion.finger is None:
        load = motion.load if motion.load is not None else np.zeros_like(motion.time)
        slope = np.gradient(motion.torque, 1.0 / motion.sample_rate_hz)
        return [
            (Feature(Row.BENCH, "bench_inertia"), motion.acceleration),
            (Feature(Row.BENCH, "bench_gain"), load),
            (Feature(Row.BENCH, "bench_offset"), np.ones_like(motion.time)),
            (Feature(Row.BENCH, "bench_trace"), motion.velocity),
            (Feature(Row.BENCH, TORQUE_LAG), -slope),
            (Feature(Row.BENCH, TORQUE_LAG_SQUARE), -np.gradient(slope, 1.0 / motion.sample_rate_hz)),
        ]
    finger, q = motion.finger_and_joints
    one = np.ones_like(motion.time)
    minus = -one
    force = np.zeros_like(one) if motion.force is None else motion.force
    columns = [
        (Feature(row, name, constant=1.0, scale="joint"), values)
        for row, name, values in _joint_parts(finger, motion)
    ]
    columns += [
        (Feature(row, name, scale="joint"), values) for row, name, values in _length_parts(finger, motion)
    ]
    contact_mcp, contact_pip = motion.contact_torques
    knock_mcp, knock_pip = motion.knock_torques
    columns += [
        (Feature(Row.MCP, "force_gain", constant=1.0, scale="joint"), contact_mcp),
        (Feature(Row.PIP, "force_gain", constant=1.0, scale="joint"), contact_pip),
        (Feature(Row.MCP, KNOCK_GAIN, scale="joint"), knock_mcp),
        (Feature(Row.PIP, KNOCK_GAIN, scale="joint"), knock_pip),
        (Feature(Row.MCP, "loss_mcp", scale="joint", per_cable=True), minus),
        (Feature(Row.PIP, "loss_pip", scale="joint", per_cable=True), minus),
        (Feature(Row.MCP, "trace_mcp", scale="joint"), q.mcp_velocity),
        (Feature(Row.PIP, "trace_pip", scale="joint"), q.pip_velocity),
        (Feature(Row.CABLE, constant=1.0, scale="arm_mcp"), q.mcp),
        (Feature(Row.CABLE, constant=1.0, scale="arm_pip"), q.pip),
        (Feature(Row.CABLE, "offset", per_cable=True), one),
        *_tip_columns(motion, force),
    ]
    columns += [(Feature(row, name, scale="joint"), values) for row, name, values in _along_the_face(motion)]
    if motion.intervention is not None:
        known = zip((Row.MCP, Row.PIP), motion.known_torques, strict=True)
        columns += [(Feature(row, constant=1.0, scale="joint"), values) for row, values in known]
        mine, count = motion.change
        # The finger hangs at rest in another posture where its motor's zero is set anew.
        columns += [
            (Feature(Row.CABLE, f"{CHANGED_OFFSET}{k}"), one * (k == mine)) for k in range(1, count + 1)
        ]
    return columns


def turned_columns(motion: Motion, effect: Effect, shape: int) -> list[tuple[Feature, Array]]:
    """What changes of the tip's forces along the load cell's face where the effect has turned the face.

    The levers turn with the face; how strong the forces are, the nuisances say. A share of the normal force
    is left out: turned, it is a change of that force.
    """
    if effect.turns is None or motion.finger is None:
        return []
    angle = effect.turns(effect.shapes[shape])
    if angle == 0.0:
        return []
    parts = (
        (math.cos(angle) - 1.0, _along_the_face(motion)),
        (-math.sin(angle), _along_the_face(motion, turned=True)),
    )
    return [
        (
            Feature(
                row, name, scale="joint", owner=effect.id, shape=shape, shares_nuisance=True, factor=factor
            ),
            values,
        )
        for factor, columns in parts
        for row, name, values in columns
        if name != "lateral"
    ]


def grown_columns(motion: Motion, effect: Effect, shape: int) -> list[tuple[Feature, Array]]:
    """What changes of all that the joints of every model call for where the effect changes their arms.

    Springs, weights, the force at the tip along the load cell's axis and along its face, losses: the tension
    that they ask for goes with one over the arm of the moment. How strong they are, their own unknowns say.
    """
    if effect.arms is None or motion.finger is None:
        return []
    arms = effect.arms(motion, effect.shapes[shape])
    if not arms:
        return []
    return [
        (replace(feature, owner=effect.id, shape=shape, shares_nuisance=True), values * share)
        for row, share in {row: 1.0 / arm - 1.0 for row, arm in arms.items()}.items()
        for feature, values in base_columns(motion)
        if feature.row is row and feature.scale == "joint"
    ]


def shares_of_arms(motion: Motion, effects: Sequence[Effect]) -> dict[Row, Array]:
    """By how many times the other effects' torques ask for more tension as one of them has made the arms."""
    known = [e for e in effects if e.arms is not None and len(e.shapes) == 1]
    if motion.finger is None or not known or known[0].arms is None:
        return {}
    return {row: 1.0 / arm for row, arm in known[0].arms(motion, known[0].shapes[0]).items()}


def _along_the_face(motion: Motion, turned: bool = False) -> list[tuple[Row, str, Array]]:
    """Row, name and torque (N m) of the unknown forces along the face, or of those at right angles to it."""
    places = [(row, name) for name in _LATERAL for row in (Row.MCP, Row.PIP)]
    keys = [("along the face", *place, turned) for place in places]

    def torques() -> list[Array]:
        forces = _tangential_forces(motion)
        along = [term.values for term in lateral_levers(motion, "")]
        levers = dict(zip((Row.MCP, Row.PIP), motion.contact_levers if turned else along, strict=True))
        return [forces[name] * levers[row] for row, name in places]

    return [
        (*place, motion.remember_each(key, keys, torques)) for place, key in zip(places, keys, strict=True)
    ]


def _tip_columns(motion: Motion, force: Array) -> list[tuple[Feature, Array]]:
    """The equation of the pressing tip's depth (m): where the face is, its slope and its give; else zero.

    The load cell's reading (N) stands beside them without a coefficient, for scale.
    """
    return [
        (Feature(Row.TIP, constant=-1.0), while_pressed(motion, tip_depth(motion))),
        (Feature(Row.TIP, "tip_tilt"), while_pressed(motion, tip_reach(motion))),
        (Feature(Row.TIP, "tip_compliance"), while_pressed(motion, force)),
        (FORCE, force),
    ]


def _tangential_forces(motion: Motion) -> dict[str, Array]:
    """Shapes of the unknown force along the load cell's face in contact, where the tip sticks and drags.

    A share of the normal force (N), a constant that the tip was set down with (times 1 N), a spring on the
    travel of a tip that sticks (m, times a stiffness), and the friction of one that slides (N):
    by the tip's own travel, which the angle sensors hardly resolve where it turns round, and by the normal
    force, with which the sideways one changes in proportion until the tip gives way.
    """
    if motion.force is None:
        return dict.fromkeys(_LATERAL, np.zeros_like(motion.time))
    tip, touching = tip_reach(motion), _touching(motion)
    touched = max(float(touching.sum()), 1.0)
    set_down = float(tip @ touching) / touched
    columns = (
        motion.force,
        touching * (tip - set_down),
        -dragged_tip(motion, TIP_STIFFNESS, (TIP_STIFFNESS, *SIDEWAYS_STIFFNESSES)),
        *(motion.tip_slip_force(stiffness, SLIP_STIFFNESSES) for stiffness in SLIP_STIFFNESSES),
        touching,
    )
    return dict(zip(_LATERAL, columns, strict=True))


_LATERAL = ("lateral", "lateral_spring", "lateral_rub", *(name for law in TIP_LAWS.values() for name in law))


def _touching(motion: Motion) -> Array:
    """1 where the tip is on the load cell, 0 where it is off, shape (n,).

    A force of zero is not enough to let go: a tip that stays at the same height still sticks sideways.
    """
    share = pressed(motion)
    on = share >= 1.0
    if not on.any() or on.all():
        return share
    depth = tip_depth(motion)
    away = np.abs(depth - np.median(depth[on])) / LIFTED_M
    return np.asarray(np.maximum(share, np.clip(2.0 - away, 0.0, 1.0)))


def shifted_columns(motion: Motion) -> list[tuple[Feature, Array]]:
    """Motor channels that a delay moves against the joints' channels; the shift is applied by the caller."""
    if motion.finger is None:
        return [(Feature(Row.BENCH, constant=-1.0), motion.torque)]
    tension, pull = motion.tension, motion.inertial_pull
    rate = np.gradient(tension, 1.0 / motion.sample_rate_hz)
    inertia = motion.motor.inertia or 0.0
    columns: list[tuple[Feature, Array]] = []
    for row in (Row.MCP, Row.PIP):
        columns.append((Feature(row, "torque_gain", constant=-1.0), tension))
        columns.append((Feature(row, "rotor_inertia", constant=inertia), pull))
    columns.append((Feature(Row.CABLE, constant=-1.0), motion.radius * motion.position))
    columns.append((Feature(Row.CABLE, "torque_gain", constant=-1.0, scale="compliance"), tension))
    columns.append((Feature(Row.CABLE, "rotor_inertia", constant=inertia, scale="compliance"), pull))
    columns.append((Feature(Row.CABLE, "cable_damping"), rate))
    return columns


def beside_a_finger(feature: Feature, rig: Rig) -> Feature:
    """A feature of the bench's equation where a finger's runs stand beside it.

    Alone, the bench fits all that its equation holds. Beside a finger it is the same motor as the finger's,
    with the rig's constants within their tolerances and one value of each in all runs.
    """
    if feature.owner is not None:
        return feature
    if feature.parameter == "bench_inertia":
        return replace(feature, parameter="rotor_inertia", constant=rig.motor.inertia or 0.0)
    if feature.parameter == "bench_gain":
        return replace(feature, parameter="load_gain", constant=1.0)
    if feature.parameter == "bench_offset":
        return replace(feature, parameter=TORQUE_ZERO)
    return feature if feature.parameter else replace(feature, parameter="torque_gain")

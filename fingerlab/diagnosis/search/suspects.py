"""Errors that a channel's reading may have, each as an effect that stands in a model.

What a wrong reading leaves out of the equations is made of the channel and of all that is computed from it:
a force acts through its levers, a torque through the pulley, an angle through springs, weights and levers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial

import numpy as np

from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import (
    FAR_LEFT,
    MOST_ANGLE_GAIN,
    MOST_ANGLE_ZERO,
    MOST_FORCE_ZERO_N,
    MOST_READING_GAIN,
    MOST_READING_LAG_S,
    NEARLY_RIGHT,
)
from fingerlab.diagnosis.signals.reading_errors import (
    CHANNELS,
    FORCE,
    JOINTS,
    MCP,
    MOTOR,
    PIP,
    TORQUE,
    ReadingError,
)
from fingerlab.effects.base import BESIDE_A_FINGER, Effect, PortableColumns, Row, Shape, Term
from fingerlab.effects.transmission import pull_terms
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

READING = "reading_of_"
"""How the ids of errors begin, as long as they stand in a model."""


def _changes(values: Array, rate_hz: float) -> Mapping[str, Array]:
    """What each number of a :class:`ReadingError` adds to a channel that reads ``values``, (n,)."""
    rate = np.gradient(values, 1.0 / rate_hz)
    each = (-np.ones_like(values), values, rate, np.gradient(rate, 1.0 / rate_hz))
    return dict(zip(ReadingError._fields, each, strict=True))


def _of_force(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What a wrong force leaves out in both joints; nothing in free motion."""
    if motion.force is None:
        nothing = np.zeros_like(motion.time)
        return [Term(row, name, nothing, "joint") for row in (Row.MCP, Row.PIP) for name in names]
    change = _changes(motion.force, motion.sample_rate_hz)
    levers = zip((Row.MCP, Row.PIP), motion.contact_levers, strict=True)
    return [Term(row, name, lever * change[name], "joint") for row, lever in levers for name in names]


def _of_torque(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What a wrong torque leaves out: in both joints as a tension, and in the cable's stretch."""
    change = _changes(motion.torque, motion.sample_rate_hz)
    if motion.finger is None:
        return [Term(Row.BENCH, name, -change[name]) for name in names]
    pulls = [(name, -change[name] / motion.radius) for name in names]
    return [term for name, pull in pulls for term in pull_terms(name, pull)]


def _of_position(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What a wrong position of the motor leaves out: of the cable's way, and of what the rotor takes."""
    change = _changes(motion.position, motion.sample_rate_hz)
    bend = _changes(motion.acceleration, motion.sample_rate_hz)
    rotor, terms = (motion.motor.inertia or 0.0) / motion.radius, list[Term]()
    for name in names:
        terms += [Term(Row.CABLE, name, -motion.radius * change[name]), *pull_terms(name, rotor * bend[name])]
    return terms


def _of_joints(sensors: Sequence[str], names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What angles that go by a little of their rate change in the joints' torques and the cable's way.

    Args:
        sensors: those of the two joints, or of one.
    """
    if motion.joints is None:
        return []
    finger, joints = motion.finger_and_joints
    force = 0.0 if motion.force is None else motion.force
    rate_hz, terms = motion.sample_rate_hz, []
    off = {sensor.removesuffix("_angle") for sensor in sensors}

    def torques(at: nominal.JointMotion) -> tuple[Array, Array]:
        """What both joints take, N m; the levers of the contact force go with the angles."""
        mcp = nominal.mcp_torque(finger, at).total
        pip = nominal.pip_torque(finger, at).total
        mcp = mcp + force * nominal.contact_lever_mcp(finger, at.mcp, at.pip)
        return mcp, pip + force * nominal.contact_lever_pip(finger, at.mcp, at.pip)

    usual = torques(joints)
    for name in names:
        change = {
            key: _changes(values, rate_hz)[name] if _is_off(key, off, name) else np.zeros_like(values)
            for key, values in vars(joints).items()
        }
        most = max(float(np.max(np.abs(change[joint]))) for joint in off)
        step = SMALL_TURN / max(most, 1e-12)
        moved = nominal.JointMotion(**{key: v + step * change[key] for key, v in vars(joints).items()})
        slopes = ((b - a) / step for a, b in zip(usual, torques(moved), strict=True))
        terms += [Term(row, name, s, "joint") for row, s in zip((Row.MCP, Row.PIP), slopes, strict=True)]
        terms += [
            Term(Row.CABLE, name, change["mcp"], "arm_mcp"),
            Term(Row.CABLE, name, change["pip"], "arm_pip"),
        ]
    return terms


def _is_off(key: str, off: Set[str], name: str) -> bool:
    """Whether a number of a joint's reading changes an angle or rate of the motion: a zero has no rate."""
    joint, _, rate = key.partition("_")
    return joint in off and not (rate and name == "zero")


SMALL_TURN = 1e-4
"""By how much an angle is turned, rad, to see what its torques change by."""


def _up_to(most: float, unit: str, least: float | None = None) -> Parameter:
    return Parameter(unit, -most if least is None else least, most, 0.25 * most)


_EITHER_WAY = {
    "zero": _up_to(MOST_FORCE_ZERO_N, "N"),
    "gain": _up_to(MOST_READING_GAIN, "1"),
    "lag": _up_to(MOST_READING_LAG_S, "s"),
    # Half its square of a pure delay, nothing of a filter of first order.
    "lag_square": _up_to(MOST_READING_LAG_S**2, "s^2"),
}
# Angles, or a torque, that came early would be a law of motion instead: viscous friction, or a late cable.
_LATE = {
    "lag": _up_to(MOST_READING_LAG_S, "s", 0.0),
    "lag_square": _up_to(MOST_READING_LAG_S**2, "s^2", 0.0),
}
# Of a joint's angle: a sensor that was clamped askew, or a calibration of another one.
_OF_ANGLE = _EITHER_WAY | {
    "zero": _up_to(MOST_ANGLE_ZERO, "rad"),
    "gain": _up_to(MOST_ANGLE_GAIN, "1"),
}
_COLUMNS: Mapping[str, Callable[[Sequence[str], Motion, Shape], list[Term]]] = {
    FORCE: _of_force,
    TORQUE: _of_torque,
    MOTOR: _of_position,
    **{sensors: partial(_of_joints, CHANNELS[sensors]) for sensors in (JOINTS, MCP, PIP)},
}


@dataclass(frozen=True, eq=False)
class ErrorColumns(PortableColumns):
    """The columns of what some numbers of a channel's error leave out."""

    channel: str
    names: tuple[str, ...]

    def __call__(self, motion: Motion, shape: Shape) -> list[Term]:
        return _COLUMNS[self.channel](self.names, motion, shape)


@dataclass(frozen=True)
class Suspect:
    """A channel, and which numbers of its :class:`ReadingError` may be wrong; ``simpler``: fewer of them."""

    channel: str
    names: tuple[str, ...]
    simpler: tuple[tuple[str, ...], ...] = ()

    @property
    def id(self) -> str:
        """Of the effect that it is."""
        return f"{READING}{self.channel}_{'_'.join(self.names)}"

    @property
    def most_left(self) -> float:
        """Squared score above one up to which it is believed, if it is of the motion."""
        return NEARLY_RIGHT if self.channel == TORQUE and "gain" in self.names else FAR_LEFT

    @property
    def of_an_angle(self) -> bool:
        """Whether a joint's angle is read at another scale or zero: what springs, weights, levers go with."""
        return self.channel in (MCP, PIP) and "lag" not in self.names

    def effect(self, either_way: bool = False) -> Effect:
        """It as an effect of a model; of the bench, and so in no catalogue.

        Args:
            either_way: it may be early as well, as beside a lag that was found.
        """
        late_alone = self.channel not in (FORCE, MOTOR) and "lag" in self.names and not either_way
        ranges = _LATE if late_alone else _OF_ANGLE if self.of_an_angle else _EITHER_WAY
        return Effect(
            id=self.id,
            title="Errors of a channel's reading",
            family="Sensors",
            acts_on=("endpoint_force", "joint_torque", "cable_kinematics"),
            gains={name: ranges[name] for name in self.names},
            columns=ErrorColumns(self.channel, self.names),
            coordinate="force",
            equation=Row.PIP,
            explanation="A channel reads something else than there is.",
            reveal="",
            bench=BESIDE_A_FINGER if self.channel == TORQUE else False,
            phases=("contact",) if self.channel == FORCE else (),
        )

    def found_in(self, fitted: FittedModel) -> ReadingError:
        """The error as a model has it."""
        return ReadingError(**{name: fitted.values.get(f"{self.id}.{name}", 0.0) for name in self.names})


_LATE_NAMES = ("lag", "lag_square")
LATE_FORCE = Suspect(FORCE, _LATE_NAMES)
FORCE_ALONE = Suspect(FORCE, ("zero", *_LATE_NAMES), (("zero",), _LATE_NAMES))
LATE_MOTION = tuple(Suspect(channel, _LATE_NAMES) for channel in (JOINTS, MCP, PIP, MOTOR, TORQUE))
"""Seen in free motion, too, where a law of motion may pass for them: asked for where no law does enough."""
TORQUE_SCALE = Suspect(TORQUE, ("gain",))
"""A spring or a load cell's span may pass for it: asked for when all that is missing was looked for."""

ANGLE_READINGS = tuple(Suspect(channel, ("zero", "gain"), (("zero",), ("gain",))) for channel in (MCP, PIP))
"""Springs, weights and levers go with the angles: for what they do a law may pass, or several."""

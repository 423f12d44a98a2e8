"""The scales of a machine, and its recordings in units in which it looks like a bench of the thesis' size.

Every tuned number and range of the diagnosis is meant for that bench. So that no verdict depends on how large
a machine is, a session is read in *reduced units*: torques are told in multiples of ``Scales.torque``,
lengths and times likewise, and all other units follow (a force is a torque over a length). The scales grow
with the machine as the units do, so that two machines that differ by size alone give the same numbers. What
leaves the diagnosis is multiplied by :meth:`Scales.of` its unit and is SI again. Currents stay, and so do the
angles of a finger and of a motor that moves by degrees: only a motor alone that moves by much less has a unit
of angle, for its friction gives way the sooner, and an axis along a line, of which an angle is a way of
telling alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np

from fingerlab.core.text import FACTORS
from fingerlab.diagnosis.settings import (
    BAND_OVER_HALF,
    LEAST_RATE_HZ,
    LEAST_READINGS,
    LEAST_TURN,
    MOVING_SHARE,
    NARROW_CUTOFF_HZ,
    OVER_NOISE,
    PACE_SAMPLES,
    QUICKER_OCTAVES,
    QUICKEST_OCTAVES,
    READ_SAMPLES,
    SETTLING_SHARE,
    SHORTEST_STRETCH_S,
    USUAL_PACE,
    USUAL_TORQUE_SPREAD,
    USUAL_TRAVEL,
)
from fingerlab.diagnosis.signals.conditions import FINGER_CHANNELS
from fingerlab.diagnosis.signals.filters import usual_wait
from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import CONSTANT_UNITS, UNITS, Finger, Intervention, Motor, Rig, intervention_of
from fingerlab.sessions.model import CHANNEL_UNITS, Array, ChannelReader, Run, Session
from fingerlab.sessions.trajectory import commanded_frequency

UnitPowers = tuple[int, int, int, int]
_POWERS: dict[str, UnitPowers] = {
    "N": (1, -1, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0), "kg": (1, -2, 2, -1), "Hz": (0, 0, -1, 0),
    "rad": (0, 0, 0, 1), "deg": (0, 0, 0, 1), "turn": (0, 0, 0, 1),
}  # fmt: skip
"""Powers of torque, length, time and angle in a unit; all others (A, V) have none. The kilogram is that of a
motor's inertia: whatever else has a mass has the radian for its angles."""

_SI = {spelling: si for si, table in FACTORS.items() for spelling in table}


@cache
def powers_of(unit: str) -> UnitPowers:
    """Powers of torque, length, time and angle in a unit (``N m s/rad``); a word that is none has none."""
    total = [0, 0, 0, 0]
    for k, part in enumerate(unit.split("/")):
        for token in _SI.get(part.strip(), part).replace("·", " ").replace("*", " ").split():
            name, _, power = token.partition("^")
            times = int(power) if power.lstrip("-").isdigit() else 1
            known = _POWERS.get(name) or _POWERS.get(_SI.get(name, ""), (0, 0, 0, 0))
            total = [t + (-times if k else times) * p for t, p in zip(total, known, strict=True)]
    return total[0], total[1], total[2], total[3]


@dataclass(frozen=True)
class Scales:
    """One reduced unit of torque (N m), length (m), time (s) and angle (rad)."""

    torque: float = 1.0
    length: float = 1.0
    time: float = 1.0
    angle: float = 1.0

    def of(self, unit: str) -> float:
        """What a number in reduced units is multiplied by to be in ``unit``, by the unit's dimension."""
        a, b, c, d = powers_of(unit)
        return float(self.torque**a * self.length**b * self.time**c * self.angle**d)


SI = Scales()
"""Reduced units that are SI: those of the thesis' finger."""

REFERENCE = Finger(0.012, 0.013, 0.0225, 0.024, 2.025e-6, 2.496e-6, 0.12, 0.06)
"""The finger of which everything is a multiple: the thesis' one, as the default rig assumes it."""


STILL_RAD = 1e-9
"""A position that changes by no more stands still: less than a step of any encoder, more than rounding."""
LEAST_SECONDS = SHORTEST_STRETCH_S / (1.0 - SETTLING_SHARE)
"""Reduced seconds that a run must last."""


def find_scales(sessions: Sequence[Session]) -> Scales:
    """The scales of a machine, from the first finger's constants and from how its motors move.

    A motor alone is as large as the torque that moves it. Time goes by octaves, so that recordings of one
    machine agree however fast its motor was told to move.
    """
    finger = next((s.rig.finger for s in sessions if s.rig.finger is not None), None)
    every = [run for session in sessions for run in session.runs]
    runs = [run for run in every if run.phase != "motor_bench" and run.cable_sign != 0]
    if finger is not None and runs:
        return Scales(
            _relative(_torque_of(finger), _torque_of(REFERENCE)),
            _relative(_length_of(finger), _length_of(REFERENCE)),
            _time_of(runs),
        )
    bench = [run for run in every if run.phase == "motor_bench"]
    spreads = [float(torque.std()) for run in bench if len(torque := _moving(run, "motor_torque"))]
    if not spreads:
        return SI
    arc = max(session.rig.line_radius for session in sessions)
    size = _relative(float(np.median(spreads)), USUAL_TORQUE_SPREAD)
    return Scales(size, 1.0, _time_of(bench, "line" if arc else "turns"), _angle_of(bench, arc))


Axis = Literal["finger", "turns", "line"]
"""What a motor moves: a finger, itself alone, which may turn on, or something along a line."""


def _angle_of(runs: Sequence[Run], arc: float) -> float:
    """The unit of angle in which the run that goes furthest moves by degrees; 1 where it does so anyway.

    By octaves, so that recordings of one machine agree: of an axis along a line by those of its way, so that
    they agree whichever ``arc`` (radius, m; 0: none) it is told as.
    """
    travels = [float(position.std()) for run in runs if len(position := _moving(run, "motor_position"))]
    travel = max(travels, default=0.0)
    if not travel > STILL_RAD:
        return 1.0
    if arc > 0.0:
        return float(2.0 ** math.floor(math.log2(travel * arc / USUAL_TRAVEL)) / arc)
    return float(2.0 ** min(math.floor(math.log2(travel / LEAST_TURN)), 0))


def is_still(position: Array) -> bool:
    """Whether a position, rad, (n,), is one number but for its rounding."""
    return float(np.ptp(position)) <= STILL_RAD


def _relative(size: float, usual: float) -> float:
    return size / usual if math.isfinite(size) and size > 0 else 1.0


def _torque_of(finger: Finger) -> float:
    """Torque of the springs at a radian and of the weights stretched out, N m."""
    levers = finger.proximal_mass * finger.proximal_half_length
    levers += finger.distal_mass * (2.0 * finger.proximal_half_length + finger.distal_half_length)
    return finger.mcp_stiffness + finger.pip_stiffness + finger.gravity * levers


def _length_of(finger: Finger) -> float:
    return finger.proximal_half_length + finger.distal_half_length


def _time_of(runs: Sequence[Run], axis: Axis = "finger") -> float:
    paces = [pace for run in runs if (pace := _pace(run, axis)) > 0]
    if not paces:
        return 1.0
    # Of a quick run among slow ones a band as narrow as theirs would leave nothing.
    pace = max(float(np.median(paces)), max(paces) / 2.0**QUICKEST_OCTAVES)
    usual = round(math.log2(USUAL_PACE / pace))
    # The hundredth forgives a rate or a length that is no round number.
    shortest = min(run.seconds for run in runs)
    most = math.floor(math.log2(max(shortest, 1e-9) / LEAST_SECONDS) + 0.01)
    # What is sampled slowly is looked at slowly, and as far as its length allows what is read slowly.
    sampled, read = (
        math.ceil(math.log2(LEAST_RATE_HZ / min(rates)) - 0.01)
        for rates in ([run.sample_rate_hz for run in runs], [_read_rate(run) for run in runs])
    )
    return float(2.0 ** max(min(usual, most), usual - QUICKER_OCTAVES, sampled, min(read, most)))


def _read_rate(run: Run) -> float:
    """How often the position or angle of a run is read that is read least often, Hz.

    A torque may be told in steps; what moves does not jump.
    """
    names = {"motor_position"} if run.phase == "motor_bench" else {*FINGER_CHANNELS} - {"motor_torque"}
    waits = (usual_wait(_moving(run, name, READ_SAMPLES), READ_SAMPLES / LEAST_READINGS) for name in names)
    return run.sample_rate_hz / max(waits)


def _moving(run: Run, channel: str, most: int = PACE_SAMPLES) -> Array:
    """A channel behind the ramp from rest, as much of it as tells its size; nothing where it has gaps."""
    if not run.has(channel):
        return np.zeros(0)
    first = run.length // 10
    values = run.channel(channel, first, min(run.length, first + most))
    return values if len(values) >= 16 and np.isfinite(values).all() else np.zeros(0)


def _pace(run: Run, axis: Axis) -> float:
    """Speed over travel of the motor, both root mean square, rad/s per rad; 0 where it does not move.

    Of the strongest lines of its motion, so that neither noise nor the encoder's steps count. What depends on
    the angle comes again the sooner, the further it moves; of a motor that turns on its torque says how soon,
    and of an axis along a line, which has no turn.
    """
    frequency, amplitude = commanded_frequency(run), run.trajectory.get("amplitude_deg")
    if frequency is not None:
        swing = math.radians(float(amplitude)) if isinstance(amplitude, int | float) else 0.0
        further = 1.0 if axis == "line" else max(1.0, abs(swing) / math.sqrt(2.0) / USUAL_TRAVEL)
        return 2.0 * math.pi * frequency * further
    pace, travel, turned = _motion_of(run)
    by_torque = turned or axis == "line"
    if axis == "finger" or not by_torque:
        pace *= max(1.0, travel / USUAL_TRAVEL)
    return max(pace, _torque_pace(run, axis)) if by_torque else pace


def fastest_speed(runs: Sequence[Run]) -> float:
    """Speed of the motor in the run that moves fastest, root mean square, rad/s; 0 where nothing moves."""
    motions = [_motion_of(run) for run in runs]
    return max((pace * travel for pace, travel, _ in motions), default=0.0)


def _motion_of(run: Run) -> tuple[float, float, bool]:
    """Speed over travel (rad/s per rad) and travel (rad) of a motor, both root mean square, by the strongest
    lines of its motion; and whether it has gone round. Zeros where it does not move.
    """
    position = _moving(run, "motor_position")
    if not len(position) or is_still(position):
        return 0.0, 0.0, False
    moved = position - position.mean()
    power = np.abs(np.fft.rfft(moved * np.hanning(len(moved)))) ** 2
    order = np.argsort(power)[::-1]
    together = np.cumsum(power[order])
    if not together[-1] > 0:
        return 0.0, 0.0, False
    lines = order[: int(np.searchsorted(together, MOVING_SHARE * together[-1])) + 1]
    line = 2.0 * math.pi * run.sample_rate_hz / len(position)
    pace = line * float(np.sqrt(np.sum(power[lines] * lines.astype(float) ** 2) / np.sum(power[lines])))
    return pace, float(moved.std()), bool(np.ptp(moved) > 2.0 * math.pi)


def _torque_pace(run: Run, axis: Axis) -> float:
    """The pace at which the torque of a motor that turns on is seen, rad/s per rad.

    Teeth and poles pass more often than it turns: half of the torque's variance lies well within the band. Of
    an axis along a line, which may rest for long, of the lines that are no noise, nor spikes.
    """
    torque = _moving(run, "motor_torque")
    if not len(torque):
        return 0.0
    power = np.abs(np.fft.rfft((torque - torque.mean()) * np.hanning(len(torque)))) ** 2
    least = OVER_NOISE * float(power[len(power) // 2 :].mean()) if axis == "line" else 0.0
    told = np.cumsum(np.where(power >= least, power, 0.0))
    if not len(told) or not told[-1] > 0:
        return 0.0
    half = int(np.searchsorted(told, 0.5 * told[-1])) * run.sample_rate_hz / len(torque)
    return USUAL_PACE * BAND_OVER_HALF * half / NARROW_CUTOFF_HZ


@dataclass(frozen=True)
class ReducedRun(Run):
    """A run in reduced units; its samples are scaled as they are read. ``given`` is the one it stands for."""

    scales: Scales = SI
    given: Run | None = None


@dataclass(frozen=True)
class ScaledReader:
    """Channels in reduced units; ``factors`` by channel, 1 where there is none."""

    reader: ChannelReader
    factors: Mapping[str, float]

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Samples in reduced units."""
        found = self.reader.load(names, start, stop)
        return {name: values * self.factors.get(name, 1.0) for name, values in found.items()}


def as_recorded(run: Run) -> Run:
    """The run as its file holds it, in SI."""
    return run.given if isinstance(run, ReducedRun) and run.given is not None else run


def scales_of(run: Run) -> Scales:
    """The units that a run is told in."""
    return run.scales if isinstance(run, ReducedRun) else SI


def scaled_change(change: Intervention, scales: Scales, way: int = 1) -> Intervention:
    """A known change from reduced units in SI (``way`` 1) or the other way (-1)."""
    return change.scaled({unit: scales.of(unit) for unit in UNITS.values()}, way)


def reduced_change(run: Run) -> Intervention | None:
    """The known change of a run in the units that it is told in; None: it tells of none.

    Raises:
        UserError: it cannot be read.
    """
    change = intervention_of(run.attributes, run.name)
    return None if change is None else scaled_change(change, scales_of(run), -1)


def reduced_sessions(sessions: Sequence[Session], scales: Scales) -> tuple[Session, ...]:
    """The sessions in reduced units; as they are where those are SI."""
    return tuple(sessions if scales == SI else (_reduced(s, scales) for s in sessions))


def _reduced(session: Session, scales: Scales) -> Session:
    runs = tuple(reduced_run(run, scales) for run in session.runs)
    return replace(session, rig=reduced_rig(session.rig, scales), runs=runs)


def reduced_run(run: Run, scales: Scales) -> Run:
    """A run in reduced units; as it is where those are SI."""
    if scales == SI:
        return run
    factors = {name: 1.0 / scales.of(CHANNEL_UNITS.get(name, unit)) for name, unit in run.units.items()}
    return ReducedRun(
        run.name, run.phase, run.cable, run.sample_rate_hz * scales.time,
        scaled_trajectory(run.trajectory, scales, -1), run.length, run.units,
        ScaledReader(run.reader, factors), run.attributes, scales, run,
    )  # fmt: skip


def reduced_rig(rig: Rig, scales: Scales) -> Rig:
    """The rig's constants in reduced units; limits and wiring stay as they are."""
    if scales == SI:
        return rig
    finger = None if rig.finger is None else Finger(**_scaled(vars(rig.finger), scales))
    return replace(rig, finger=finger, motor=Motor(**_scaled(vars(rig.motor), scales)))


def _scaled(constants: Mapping[str, Any], scales: Scales) -> dict[str, Any]:
    return {
        name: None if value is None else value / scales.of(CONSTANT_UNITS[name])
        for name, value in constants.items()
    }


def reduced_motion(motion: Motion, scales: Scales) -> Motion:
    """A motion in reduced units; as it is where those are SI."""
    if scales == SI:
        return motion
    second, radian = scales.time, scales.angle

    def forced(values: Array | None, unit: str) -> Array | None:
        return None if values is None else values / scales.of(unit)

    q = motion.joints
    joints = None if q is None else JointMotion(
        q.mcp, q.pip, q.mcp_velocity * second, q.pip_velocity * second, q.mcp_acceleration * second**2,
        q.pip_acceleration * second**2,
    )  # fmt: skip
    rig = reduced_rig(Rig(motion.finger, motion.motor), scales)
    return replace(
        motion, sample_rate_hz=motion.sample_rate_hz * second, time=motion.time / second,
        position=motion.position / radian, velocity=motion.velocity * second / radian,
        acceleration=motion.acceleration * second**2 / radian,
        torque=motion.torque / scales.torque, motor=rig.motor, finger=rig.finger, joints=joints,
        force=forced(motion.force, "N"), load=forced(motion.load, "N m"),
        inertia_spread=motion.inertia_spread / scales.of("kg m^2"), _memory={},
        intervention=None if motion.intervention is None else scaled_change(motion.intervention, scales, -1),
    )  # fmt: skip


_ENDINGS = {"_deg": "deg", "_hz": "Hz", "_n_m": "N m", "_n": "N", "_s": "s", "load_torque": "N m"}
"""What the end of a number's name in a trajectory says of its unit; the longest counts."""


def scaled_trajectory(trajectory: Mapping[str, Any], scales: Scales, way: int = 1) -> dict[str, Any]:
    """A trajectory from reduced units in SI (``way`` 1) or the other way (-1), where its names say units."""
    if scales == SI:
        return dict(trajectory)
    return {key: _multiplied(value, scales.of(_unit_of(key)) ** way) for key, value in trajectory.items()}


def _unit_of(key: str) -> str:
    endings = [end for end in _ENDINGS if key.endswith(end)]
    return _ENDINGS[max(endings, key=len)] if endings else "1"


def _multiplied(value: Any, factor: float) -> Any:
    if factor == 1.0 or isinstance(value, bool):
        return value
    if isinstance(value, list | tuple):
        return [_multiplied(one, factor) for one in value]
    return float(f"{value * factor:.12g}") if isinstance(value, int | float) else value

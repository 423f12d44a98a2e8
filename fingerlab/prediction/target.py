"""A wanted endpoint force over time, and how finger and motor stand while the fingertip presses.

The force is a sine, ramp and hold, steps, or from a file; its shapes are those of the motor's trajectories
(:mod:`fingerlab.acquisition.control.trajectories`), in newtons. The pose is that of a contact run, or
given by hand.

=================  ==========================================================================
key                meaning (default)
=================  ==========================================================================
``kind``           ``sine``, ``ramp_hold``, ``steps`` or ``file``
``amplitude_n``    half of the range, N
``mean_n``         middle of the range, N
``frequency_hz``   of the sine; ramps or steps a second (0.5)
``rise_s``         time from one step to the next (0.3)
``seed``           which sequence of steps (0)
``duration_s``     length of the profile (20; of a file: its last time)
``file``           text table of time (s) and force (N); or two lists, ``time_s`` and ``force_n``
=================  ==========================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.acquisition.control.trajectories import FORCE, WAVES, with_points
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import is_number, read_object
from fingerlab.diagnosis.settings import SETTLING_S, WIDE_RATE_HZ
from fingerlab.diagnosis.signals.scales import SI, Scales
from fingerlab.physics.motion import TOUCHING_FORCE_N, Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import CABLE_SIGN, Array, Run

KINDS = ("sine", "ramp_hold", "steps", "file")
DEFAULTS = {"frequency_hz": 0.5, "rise_s": 0.3, "duration_s": 20.0}
SHORTEST_S, LONGEST_S = 1.0, 300.0


@dataclass(frozen=True)
class WantedForce:
    """``force``: N at the load cell, (n,), at ``time`` (s from its own start, (n,), 250 a second)."""

    settings: Mapping[str, Any]
    time: Array
    force: Array


def wanted_force(source: str | Mapping[str, Any], where: str = "The wanted force") -> WantedForce:
    """A wanted force from JSON text, the object that it holds, or a path to a text table or JSON file.

    Raises:
        UserError: it is none of them, a number is missing or impossible, or the force would have to pull.
    """
    settings = _object(source, where)
    kind = settings.get("kind")
    if kind not in KINDS:
        raise UserError(f"{where} has the kind {kind!r}; it should be one of {', '.join(KINDS)}.")
    if kind == "file":
        settings = with_points(settings, where, FORCE)
    settings = {**DEFAULTS, **settings}
    seconds = _number(settings, "duration_s", where)
    if not SHORTEST_S <= seconds <= LONGEST_S:
        raise UserError(
            f"{where} lasts {seconds:g} s; it should last from {SHORTEST_S:g} to {LONGEST_S:g} s."
        )
    time = np.arange(round(seconds * WIDE_RATE_HZ)) / WIDE_RATE_HZ
    if kind == "file":
        force = np.interp(time, settings["time_s"], settings[FORCE.key])
    else:
        amplitude, mean = (_number(settings, name, where) for name in ("amplitude_n", "mean_n"))
        force = mean + amplitude * WAVES[kind](settings, seconds, where)(time)
    if force.min() < 0.0:
        raise UserError(
            f"{where} falls to {force.min():.3g} N; a fingertip can only press, so that it should stay at "
            "0 N or more."
        )
    return WantedForce(settings, time, np.asarray(force))


def _object(source: str | Mapping[str, Any], where: str) -> Mapping[str, Any]:
    if isinstance(source, Mapping):
        return source
    if not source.lstrip().startswith("{"):
        path = Path(source)
        if path.suffix.lower() != ".json":
            return {"kind": "file", "file": source}
        source = read_text(path, "the JSON file of a wanted force")
    return read_object(
        source,
        where,
        'it should look like {"kind": "sine", "mean_n": 1, "amplitude_n": 0.5, "frequency_hz": 0.5}',
    )


def _number(settings: Mapping[str, Any], name: str, where: str) -> float:
    value = settings.get(name)
    if value is None:
        raise UserError(f"{where} lacks {name!r}, a number.")
    if not is_number(value):
        raise UserError(f"{where} has {name!r} = {value!r}; it should be a finite number.")
    return float(value)


CHANNELS = ("mcp_angle", "pip_angle", "motor_position")
LEAST_SAMPLES = 50
LEAST_RANGE_N = 0.05
"""A run whose force moves by less tells where the finger stands, not how it gives way, N; assumed."""


@dataclass(frozen=True)
class ContactPose:
    """Joints and motor as straight lines of the force: (value without force, change per newton).

    Attributes:
        mcp, pip: rad, rad/N. position: motor, rad, rad/N; None where nobody knows.
        source: where it comes from, for words. cable: of the contact.
    """

    cable: str
    mcp: tuple[float, float]
    pip: tuple[float, float]
    position: tuple[float, float] | None
    source: str

    @property
    def cable_sign(self) -> int:
        """s of the nominal equations."""
        return CABLE_SIGN[self.cable]

    def motion(self, rig: Rig, time: Array, force: Array, torque: Array) -> Motion:
        """The motion that a force (N, (n,)) at ``time`` and a motor torque (N m, (n,)) make of it.

        Raises:
            UserError: the rig gives no finger.
        """
        if rig.finger is None:
            raise UserError(
                "The session's rig gives no finger; 'finger' (masses, lengths, springs) is needed."
            )
        parts = [_line(line, force) for line in (self.mcp, self.pip, self.position or (0.0, 0.0))]
        (mcp, pip, position) = (_with_derivatives(values) for values in parts)
        return Motion(
            phase="on_air", cable_sign=self.cable_sign, sample_rate_hz=WIDE_RATE_HZ, time=time,
            position=position[0], velocity=position[1], acceleration=position[2], torque=torque,
            motor=rig.motor, finger=rig.finger,
            joints=JointMotion(mcp[0], pip[0], mcp[1], pip[1], mcp[2], pip[2]),
        )  # fmt: skip


def pose_of_run(run: Run, scales: Scales = SI) -> ContactPose:
    """The pose of a contact run while its fingertip pressed; where its force moved, also how it gave way.

    ``scales`` of the machine say what is a small force.

    Raises:
        UserError: it is no contact run with a cable, lacks a channel, or never presses.
    """
    if run.phase != "contact" or run.cable_sign == 0:
        raise UserError(f"Run {run.name} is no contact run with a cable; name one of phase 'contact'.")
    has_cell = run.has("endpoint_force")
    samples = run.load([*CHANNELS, *(["endpoint_force"] if has_cell else [])])
    kept = slice(int(SETTLING_S * run.sample_rate_hz), None, max(round(run.sample_rate_hz / WIDE_RATE_HZ), 1))
    angles = {name: samples[name][kept] for name in CHANNELS}
    force = samples["endpoint_force"][kept] if has_cell else np.full(len(angles["mcp_angle"]), np.nan)
    if np.isfinite(force).any():
        pressing = force > TOUCHING_FORCE_N * scales.of("N")
    else:
        pressing, force = np.ones(len(force), dtype=bool), np.zeros(len(force))
    if pressing.sum() < LEAST_SAMPLES:
        raise UserError(
            f"Run {run.name} presses for {pressing.sum() / WIDE_RATE_HZ:.1f} s after its start; name a "
            "contact run whose fingertip presses the load cell."
        )
    least = LEAST_RANGE_N * scales.of("N")
    lines = {name: _fitted(force[pressing], values[pressing], least) for name, values in angles.items()}
    return ContactPose(
        run.cable, lines["mcp_angle"], lines["pip_angle"], lines["motor_position"], f"run {run.name}"
    )


def pose_by_hand(mcp: float, pip: float, cable: str = "flexion") -> ContactPose:
    """A finger that stands still at two joint angles (rad), pressed by a stiff cable of that kind."""
    if cable not in CABLE_SIGN:
        raise UserError(f"The cable is {cable!r}; it should be 'flexion' or 'extension'.")
    return ContactPose(cable, (mcp, 0.0), (pip, 0.0), None, "by hand")


def _fitted(force: Array, values: Array, least: float) -> tuple[float, float]:
    if np.ptp(force) < least:
        return float(values.mean()), 0.0
    slope, start = np.polyfit(force, values, 1)
    return float(start), float(slope)


def _line(line: tuple[float, float], force: Array) -> Array:
    return np.asarray(line[0] + line[1] * force)


def _with_derivatives(values: Array) -> tuple[Array, Array, Array]:
    speed = np.gradient(values, 1.0 / WIDE_RATE_HZ)
    return values, speed, np.gradient(speed, 1.0 / WIDE_RATE_HZ)


def words_of(pose: ContactPose) -> Mapping[str, float]:
    """The pose in degrees, as it is shown."""
    return {"mcp_deg": float(np.degrees(pose.mcp[0])), "pip_deg": float(np.degrees(pose.pip[0]))}

"""How finger and motor stand while the fingertip presses: read from a contact run, or given by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.bandwidth import WIDE_RATE_HZ
from fingerlab.diagnosis.stretches import SETTLING_S
from fingerlab.effects.motion import Motion
from fingerlab.effects.tip import TOUCHING_FORCE_N
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Array, Run

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
        return {"flexion": 1, "extension": -1}[self.cable]

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


def pose_of_run(run: Run) -> ContactPose:
    """The pose of a contact run while its fingertip pressed; where its force moved, also how it gave way.

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
        pressing = force > TOUCHING_FORCE_N
    else:
        pressing, force = np.ones(len(force), dtype=bool), np.zeros(len(force))
    if pressing.sum() < LEAST_SAMPLES:
        raise UserError(
            f"Run {run.name} presses for {pressing.sum() / WIDE_RATE_HZ:.1f} s after its start; name a "
            "contact run whose fingertip presses the load cell."
        )
    lines = {name: _fitted(force[pressing], values[pressing]) for name, values in angles.items()}
    return ContactPose(
        run.cable, lines["mcp_angle"], lines["pip_angle"], lines["motor_position"], f"run {run.name}"
    )


def pose_by_hand(mcp: float, pip: float, cable: str = "flexion") -> ContactPose:
    """A finger that stands still at two joint angles (rad), pressed by a stiff cable of that kind."""
    if cable not in ("flexion", "extension"):
        raise UserError(f"The cable is {cable!r}; it should be 'flexion' or 'extension'.")
    return ContactPose(cable, (mcp, 0.0), (pip, 0.0), None, "by hand")


def _fitted(force: Array, values: Array) -> tuple[float, float]:
    if np.ptp(force) < LEAST_RANGE_N:
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

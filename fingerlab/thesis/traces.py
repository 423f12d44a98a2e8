"""What the regression sees of one run: tension, joint torques and speeds, cut into periods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.physics.nominal import (
    JointMotion,
    contact_lever_mcp,
    contact_lever_pip,
    mcp_torque,
    pip_torque,
    tension,
)
from fingerlab.rig.constants import Finger, Rig
from fingerlab.sessions.cycle import named_frequency
from fingerlab.sessions.model import Array, Run
from fingerlab.signals.periods import PeriodGrid, period_grid, repeats, settles
from fingerlab.signals.prepare import Signals, prepare
from fingerlab.thesis.specs import JOINTS, Joint


@dataclass(frozen=True)
class Traces:
    """One run on the way into the analysis; arrays of shape (n,), SI.

    Attributes:
        tension: cable tension T at the pulley, N. lhs: left-hand side of each joint's equation, N m.
        speed: joint speeds, rad/s. grid: the whole periods, None for a run that does not repeat.
    """

    signals: Signals
    finger: Finger
    cable: str
    tension: Array
    lhs: Mapping[Joint, Array]
    speed: Mapping[Joint, Array]
    grid: PeriodGrid | None
    frequency_hz: float

    def lever(self, joint: Joint, contact_angle: float = 0.0) -> Array:
        """Lever of the contact force about a joint, m, shape (n,)."""
        angles = self.signals.mcp, self.signals.pip
        assert angles[0] is not None
        assert angles[1] is not None
        lever = contact_lever_pip if joint == "pip" else contact_lever_mcp
        return lever(self.finger, angles[0], angles[1], contact_angle)


def trace(run: Run, rig: Rig) -> Traces:
    """Read, filter and evaluate one finger run.

    Raises:
        UserError: the rig knows no finger or no pulley, or the run lacks a channel that the equations need.
    """
    if rig.finger is None:
        raise UserError("The session's rig gives no finger; 'finger' (masses, lengths, springs) is needed.")
    for channel in ("mcp_angle", "pip_angle"):
        if not run.has(channel):
            raise UserError(f"Run {run.name} has no channel '{channel}'; the joint equations need it in rad.")
    signals = prepare(run, rig)
    motion = joint_motion(signals)
    return Traces(
        signals,
        rig.finger,
        run.cable,
        tension(rig.motor, signals.motor_torque, signals.motor_acceleration),
        {"mcp": mcp_torque(rig.finger, motion).total, "pip": pip_torque(rig.finger, motion).total},
        {"mcp": motion.mcp_velocity, "pip": motion.pip_velocity},
        run_grid(run, signals),
        named_frequency(run),
    )


def joint_motion(signals: Signals) -> JointMotion:
    """The joints' angles, speeds and accelerations of a run that has them."""
    parts = (
        signals.mcp,
        signals.pip,
        signals.mcp_velocity,
        signals.pip_velocity,
        signals.mcp_acceleration,
        signals.pip_acceleration,
    )
    for part in parts:
        if part is None or not np.isfinite(part).all():
            raise UserError(
                f"Run {signals.run_name} has joint angles that are missing or not numbers; "
                "the joint equations need both angles throughout."
            )
    mcp, pip, mcp_v, pip_v, mcp_a, pip_a = (p for p in parts if p is not None)
    return JointMotion(mcp, pip, mcp_v, pip_v, mcp_a, pip_a)


def run_grid(run: Run, signals: Signals) -> PeriodGrid | None:
    """The run's whole periods where its motor truly repeats at the trajectory's frequency, else None."""
    grid = period_grid(len(signals), run.sample_rate_hz, named_frequency(run))
    return grid if grid is not None and repeats(signals.motor_position, grid) else None


def settled(traces: Traces) -> Traces:
    """A run to predict, with its period also where that is known only from when the finger has settled.

    A fit needs a run that repeats throughout; a finger that presses settles for a few seconds, and what a
    model predicts of it can be judged all the same.
    """
    if traces.grid is not None:
        return traces
    signals = traces.signals
    grid = period_grid(len(signals), signals.sample_rate_hz, traces.frequency_hz)
    known = grid is not None and settles(signals.motor_position, grid)
    return replace(traces, grid=grid) if known else traces


__all__ = ["JOINTS", "Traces", "joint_motion", "run_grid", "settled", "trace"]

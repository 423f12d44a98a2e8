"""The one function that turns a run into filtered signals."""

from __future__ import annotations

from dataclasses import dataclass

from fingerlab.rig import Rig
from fingerlab.sessions.model import Array, Run
from fingerlab.signals.filters import derivative, low_pass, low_pass_stretches

THESIS_CUTOFF_HZ = 5.0
"""Thesis section 4.1: physiological finger motion does not exceed 3 to 5 Hz."""


@dataclass(frozen=True)
class Signals:
    """Filtered signals of one run; every array has shape (n,) and SI units, None where not recorded.

    Attributes:
        time: s. motor_position, motor_velocity, motor_acceleration: rad, rad/s, rad/s^2 at the pulley.
        motor_torque: N m at the gearbox output, as measured (no inertia subtracted).
        mcp, pip: joint angles, rad, flexion positive, with ``_velocity`` and ``_acceleration``.
        force: N, compression positive, NaN where the load cell was not read; None where never.
        load_torque: N m (motor bench only), with gaps in the same way.
        cable_sign: +1 flexion, -1 extension, 0 none.
    """

    run_name: str
    phase: str
    cable_sign: int
    sample_rate_hz: float
    time: Array
    motor_position: Array
    motor_velocity: Array
    motor_acceleration: Array
    motor_torque: Array
    mcp: Array | None
    mcp_velocity: Array | None
    mcp_acceleration: Array | None
    pip: Array | None
    pip_velocity: Array | None
    pip_acceleration: Array | None
    force: Array | None
    load_torque: Array | None

    def __len__(self) -> int:
        return len(self.time)


def prepare(run: Run, rig: Rig, cutoff_hz: float = THESIS_CUTOFF_HZ) -> Signals:
    """Read a run's channels, low-pass them at ``cutoff_hz`` (Hz) and differentiate.

    Raises:
        UserError: a channel is missing or unreadable, or the cut-off does not fit the sampling rate.
    """
    rate = run.sample_rate_hz

    def smooth(name: str) -> Array | None:
        if not run.has(name):
            return None
        return low_pass(run.channel(name), rate, cutoff_hz)

    def with_gaps(name: str) -> Array | None:
        return low_pass_stretches(run.channel(name), rate, cutoff_hz) if run.has(name) else None

    def twice(values: Array | None) -> tuple[Array | None, Array | None]:
        if values is None:
            return None, None
        velocity = derivative(values, rate)
        return velocity, derivative(velocity, rate)

    position = low_pass(run.channel("motor_position"), rate, cutoff_hz)
    velocity = derivative(position, rate)
    mcp, pip = smooth("mcp_angle"), smooth("pip_angle")
    mcp_velocity, mcp_acceleration = twice(mcp)
    pip_velocity, pip_acceleration = twice(pip)
    return Signals(
        run_name=run.name,
        phase=run.phase,
        cable_sign=run.cable_sign,
        sample_rate_hz=rate,
        time=run.channel("time"),
        motor_position=position,
        motor_velocity=velocity,
        motor_acceleration=derivative(velocity, rate),
        motor_torque=low_pass(run.channel("motor_torque"), rate, cutoff_hz),
        mcp=mcp,
        mcp_velocity=mcp_velocity,
        mcp_acceleration=mcp_acceleration,
        pip=pip,
        pip_velocity=pip_velocity,
        pip_acceleration=pip_acceleration,
        force=with_gaps("endpoint_force"),
        load_torque=with_gaps("load_torque"),
    )

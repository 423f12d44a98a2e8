"""The one function that turns a run into filtered signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig
from fingerlab.sessions.gaps import longest_piece
from fingerlab.sessions.model import Array, Run
from fingerlab.signals.filters import derivative, low_pass, low_pass_stretches

THESIS_CUTOFF_HZ = 5.0
"""Thesis section 4.1: physiological finger motion does not exceed 3 to 5 Hz."""

NEEDED = ("motor_position", "motor_torque")
FILTERED = (*NEEDED, "mcp_angle", "pip_angle", "endpoint_force", "load_torque")
"""Channels that are low-passed; the first two every run must have."""


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

    Where samples were lost, of the longest piece without a gap.

    Raises:
        UserError: a channel is missing or unreadable, or the cut-off does not fit the sampling rate.
    """
    rate = run.sample_rate_hz
    channels = run.load(["time", *(name for name in FILTERED if name in NEEDED or run.has(name))])
    piece = longest_piece(channels["time"], rate)
    channels = {name: values[piece] for name, values in channels.items()}
    filtered = _low_passed(run, channels, cutoff_hz)

    def twice(values: Array | None) -> tuple[Array | None, Array | None]:
        if values is None:
            return None, None
        velocity = derivative(values, rate)
        return velocity, derivative(velocity, rate)

    position = filtered["motor_position"]
    velocity = derivative(position, rate)
    mcp, pip = filtered.get("mcp_angle"), filtered.get("pip_angle")
    mcp_velocity, mcp_acceleration = twice(mcp)
    pip_velocity, pip_acceleration = twice(pip)
    return Signals(
        run_name=run.name,
        phase=run.phase,
        cable_sign=run.cable_sign,
        sample_rate_hz=rate,
        time=channels["time"],
        motor_position=position,
        motor_velocity=velocity,
        motor_acceleration=derivative(velocity, rate),
        motor_torque=filtered["motor_torque"],
        mcp=mcp,
        mcp_velocity=mcp_velocity,
        mcp_acceleration=mcp_acceleration,
        pip=pip,
        pip_velocity=pip_velocity,
        pip_acceleration=pip_acceleration,
        force=filtered.get("endpoint_force"),
        load_torque=filtered.get("load_torque"),
    )


def _low_passed(run: Run, channels: Mapping[str, Array], cutoff_hz: float) -> dict[str, Array]:
    """Channels of ``FILTERED`` that there are, low-passed; gaps stay gaps, one that is all gaps is left out.

    Raises:
        UserError: the motor's channels have gaps, or the cut-off does not fit the sampling rate.
    """
    rate = run.sample_rate_hz
    there = [name for name in FILTERED if name in channels]
    whole = [name for name in there if np.isfinite(channels[name]).all()]
    for name in NEEDED:
        if name not in whole:
            raise UserError(
                f"Run {run.name} holds values in '{name}' that are not numbers; the motor's channels should "
                "have no gaps."
            )
    # One call for all channels: designing the filter takes as long as filtering one of them.
    filtered = low_pass(np.stack([channels[n] for n in whole]), rate, cutoff_hz)
    result = dict(zip(whole, filtered, strict=True))
    for name in there:
        if name not in whole:
            pieces = low_pass_stretches(channels[name], rate, cutoff_hz)
            result |= {} if pieces is None else {name: pieces}
    return result

"""Driving the motor by torque: the current that makes it, held back where nothing resists.

A torque has no position to come back to. What keeps it safe: every check of the position loop but the
following error (there is no angle to follow), a clamp below the limits of current and torque, and a brake
that acts only above the speed of a finger that presses. Without it a loose cable or a missing load cell would
let the motor run up to the limit of its speed within a tenth of a second. At the end the position loop takes
over with the current that it finds, and brings the motor to rest as after any other run.
"""

from __future__ import annotations

import numpy as np

from fingerlab.acquisition.control import Gains
from fingerlab.acquisition.reference import Reference
from fingerlab.acquisition.trajectories import Trajectory
from fingerlab.acquisition.units import BenchUnits
from fingerlab.core.errors import UserError
from fingerlab.rig.daq import Limits

FREE_SPEED = 2.0
"""rad/s at the pulley (assumed): a pressing finger turns the motor slower, an unloaded one soon faster."""

LIMIT_MARGIN = 0.95
"""The set value stays below the limits, so that only a fault can reach them (assumed, as in the loop)."""

STEP_S = 2e-3
"""Times at which a trajectory is checked, s."""


def braked(current: float, speed: float, gain: float) -> float:
    """Current command (A) less the brake: ``gain`` (A s/rad) times what the speed (rad/s) has too much."""
    if speed > FREE_SPEED:
        return current - gain * (speed - FREE_SPEED)
    if speed < -FREE_SPEED:
        return current - gain * (speed + FREE_SPEED)
    return current


def most_torque(limits: Limits, torque_per_amp: float) -> float:
    """Largest torque at the gearbox output that the loop sends, N m."""
    return LIMIT_MARGIN * min(limits.torque, limits.current * torque_per_amp)


class TorqueDrive:
    """The wanted torque, one value a sample, and the current that makes it.

    Attributes:
        reference: N m at the gearbox output, with the soft start and change of a position.
    """

    def __init__(self, period: float, gains: Gains, units: BenchUnits, limits: Limits) -> None:
        self.reference = Reference(period)
        self._gain = gains.derivative
        self._per_amp = units.torque_per_amp
        most = most_torque(limits, units.torque_per_amp) / units.torque_per_amp
        self._most = min(most, gains.current_limit)

    def current(self, speed: float) -> float:
        """Current command, A, at a motor speed in rad/s at the pulley."""
        wanted = braked(self.reference.value / self._per_amp, speed, self._gain)
        return min(max(wanted, -self._most), self._most)


def check_torque(trajectory: Trajectory, limits: Limits, units: BenchUnits, cable: bool = True) -> None:
    """Refuse a torque that reaches the limits, or pulls the cable (where there is one) tight too fast.

    Raises:
        UserError: it does.
    """
    time = np.arange(0.0, min(trajectory.duration, 600.0), STEP_S)
    torque = trajectory.command(time)
    low, high = float(torque.min()), float(torque.max())
    most = most_torque(limits, units.torque_per_amp)
    if low < -most or high > most:
        raise UserError(
            f"The trajectory asks for {1e3 * low:.4g} to {1e3 * high:.4g} mN m; the rig's limits of torque "
            f"and current allow {1e3 * most:.4g} mN m in either direction."
        )
    if not cable:
        return
    rise = float(np.abs(np.diff(torque)).max(initial=0.0)) / STEP_S / units.pulley_radius
    if rise > limits.tension_rise:
        raise UserError(
            f"The trajectory pulls the cable tight by up to {rise:.4g} N/s; the limit is "
            f"{limits.tension_rise:.4g} N/s."
        )

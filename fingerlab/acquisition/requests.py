"""What the loop is told at its start, and the part of a request that takes time, done outside of a cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.acquisition.board import Board, Slot, Text
from fingerlab.acquisition.checks import Watchdog
from fingerlab.acquisition.commands import Command, Start
from fingerlab.acquisition.control import Gains, slowed
from fingerlab.acquisition.torque import check_torque
from fingerlab.acquisition.trajectories import Trajectory, read_trajectory
from fingerlab.acquisition.units import BenchUnits
from fingerlab.core.errors import UserError
from fingerlab.rig.daq import Limits

CURRENT_MARGIN = 0.95
"""The position loop stays below the current limit, so that only a fault can reach it (assumed)."""


@dataclass(frozen=True)
class LoopSettings:
    """What the loop has to know of the bench; plain values, so that they travel to its process.

    ``watch_...``: whose silence stops the motor. ``watch_guardian``: none is driven before the guardian has
    tried that it can stop it.
    """

    units: BenchUnits
    limits: Limits
    gains: Gains = field(default_factory=Gains)
    watch_window: bool = True
    watch_recorder: bool = True
    watch_guardian: bool = True


@dataclass(frozen=True)
class ReadyStart:
    """A trajectory that has been read and found within the limits."""

    trajectory: Trajectory
    endless: bool


@dataclass(frozen=True)
class Refused:
    """A command that is impossible whatever the state."""

    sentence: str


def prepare(command: Command, settings: LoopSettings, cable: bool = True) -> Command | ReadyStart | Refused:
    """The part of a command that takes time, done outside of the control loop's cycle.

    Args:
        cable: whether a cable is on the pulley, whose tension may not rise too fast.
    """
    if not isinstance(command, Start):
        return command
    try:
        trajectory = read_trajectory(command.trajectory)
        if trajectory.is_torque:
            check_torque(trajectory, settings.limits, settings.units, cable)
        else:
            _check_range(trajectory, settings.limits)
    except UserError as error:
        return Refused(str(error))
    return ReadyStart(trajectory, command.endless)


def _check_range(trajectory: Trajectory, limits: Limits) -> None:
    time = np.arange(0.0, min(trajectory.duration, 600.0), 2e-3)
    command = trajectory.command(time)
    low, high = float(command.min()), float(command.max())
    if low < limits.position_low or high > limits.position_high:
        raise UserError(
            f"The trajectory goes from {math.degrees(low):.4g}° to {math.degrees(high):.4g}°; the limits are "
            f"{math.degrees(limits.position_low):.4g}° to {math.degrees(limits.position_high):.4g}°."
        )
    speed = float(np.abs(np.diff(command)).max(initial=0.0)) / 2e-3
    if speed > limits.speed:
        raise UserError(
            f"The trajectory moves at up to {math.degrees(speed):.4g} °/s; the limit is "
            f"{math.degrees(limits.speed):.4g} °/s."
        )


def gains_within(settings: LoopSettings, hold: int) -> Gains:
    """The position loop's gains for a command every ``hold`` samples, its current below the rig's limit."""
    gains = settings.gains if hold == 1 else slowed(settings.gains, hold)
    most = min(gains.current_limit, CURRENT_MARGIN * settings.limits.current)
    return replace(gains, current_limit=most)


def unguarded(settings: LoopSettings, board: Board) -> str:
    """Why no motor may be enabled: nobody could stop it in the loop's place. Empty where somebody can."""
    if not settings.watch_guardian or board[Slot.GUARDIAN] == 1:
        return ""
    return board.text(Text.GUARDIAN) or (
        "The process that stops the motor when the control loop dies is not ready; open the bench again."
    )


def watchdogs(settings: LoopSettings, period: float) -> list[tuple[Slot, Watchdog]]:
    """Which counters of the board have to move, and the watchdog of each."""
    limits, dogs = settings.limits, []
    if settings.watch_window:
        dogs.append((Slot.WINDOW_BEAT, Watchdog("window", round(limits.window_time / period))))
    if settings.watch_recorder:
        dogs.append((Slot.RECORDER_BEAT, Watchdog("recorder", round(limits.recorder_time / period))))
    return dogs

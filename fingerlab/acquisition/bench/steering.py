"""What the loop is told at its start, and what it tells the motor, cycle by cycle.

Whether the motor may be driven at all is not decided here but by the state machine, which the loop keeps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.acquisition.control.machine import Approach, Command, Jog, SetGains, Start, TakeUp, Winding
from fingerlab.acquisition.control.motion import (
    GAIN_RANGES,
    FeedForward,
    Gains,
    PositionLoop,
    Reference,
    Settling,
    TorqueDrive,
    check_gains,
    check_torque,
    slowed,
)
from fingerlab.acquisition.control.safety import Bounds, Reading, Watchdog
from fingerlab.acquisition.control.trajectories import MOST_FORCE, MOST_POSITION, Trajectory, read_trajectory
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.status import Number, SharedStatus, Slot, Text
from fingerlab.core.errors import UserError
from fingerlab.rig.limits import Limits

CURRENT_MARGIN = 0.95
"""The position loop stays below the current limit, so that only a fault can reach it (assumed)."""


@dataclass(frozen=True)
class LoopSettings:
    """What the loop has to know of the bench; plain values, so that they travel to its process.

    ``proves_drive``: signs and gains of the drive are being found out. ``watch_...``: whose silence stops the
    motor. ``watch_guardian``: none is driven before the guardian has tried that it can stop it.
    ``current_share``: of the limit of the current that is sent at most; a tenth on a bench nobody checked.
    """

    units: BenchUnits
    limits: Limits
    gains: Gains = field(default_factory=Gains)
    proves_drive: bool = False
    watch_window: bool = True
    watch_recorder: bool = True
    watch_guardian: bool = True
    current_share: float = 1.0


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
    if isinstance(command, Approach):
        try:
            check_press(command.force, settings.limits)
        except UserError as error:
            return Refused(str(error))
    if not isinstance(command, Start):
        return command
    try:
        trajectory = read_trajectory(command.trajectory)
        if trajectory.is_torque:
            most = settings.current_share * settings.limits.current
            check_torque(trajectory, replace(settings.limits, current=most), settings.units, cable)
        else:
            _check_range(trajectory, settings.limits)
    except UserError as error:
        return Refused(str(error))
    return ReadyStart(trajectory, command.endless)


def check_press(force: float, limits: Limits) -> None:
    """Raise UserError where the load cell is to be pressed with more (N) than the force's limit."""
    if force > limits.force:
        raise UserError(
            f"The load cell is to be pressed with {force:g} N; the limit of the force is {limits.force:g} N."
        )


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


JOG_MARGIN, JOG_LEAD_S = math.radians(2.0), 0.1
"""A jog ends so far before the position's limits, and its way of so long before (assumed: coming to a stand
within 0.5 s, it overshoots by 0.09 s)."""

DOUBT_S = 5e-3
"""For so long a torque's own bounds have to be left; the load cell's noise is no doubt (assumed)."""

MOVED_SAMPLES = 20
"""Samples of a take-up whose mean says where joints and load cell were, and by how many a change of them has
to be seen."""

SOFT_SHARE = 0.7
"""Of the limit of the tension's rise that a soft stop out of a torque makes at most (assumed: the rest is for
the current monitor's noise). Where play or a bouncing tip has the motor swing, the position loop that takes
over would brake it harder than the cable is to be pulled."""

HELD_S = 0.2
"""For so long all the current of a take-up is asked for before the cable is said to hold the motor (assumed:
at 10 degrees a second it is 2 degrees behind then, and would be further)."""


def gains_within(settings: LoopSettings, hold: int) -> Gains:
    """The position loop's gains for a command every ``hold`` samples, its current below the rig's limit."""
    gains = settings.gains if hold == 1 else slowed(settings.gains, hold)
    most = min(gains.current_limit, CURRENT_MARGIN * settings.current_share * settings.limits.current)
    return replace(gains, current_limit=most)


def unguarded(settings: LoopSettings, board: SharedStatus) -> str:
    """Why no motor may be enabled: nobody could stop it in the loop's place. Empty where somebody can."""
    if not settings.watch_guardian or board[Slot.GUARDIAN_READY] == 1:
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


class Steering:
    """The wanted motion and the current that makes it.

    Args:
        period: of a sample, s. hold: samples for which the device holds a set value.

    Attributes:
        reference: the wanted angle, rad. amps, volts: the present current command and set value.
        in_contact: nothing is fed forward, for a finger that leaves what it presses is another one at once.
    """

    def __init__(self, settings: LoopSettings, period: float, hold: int, board: SharedStatus) -> None:
        gains = gains_within(settings, hold)
        self._settings = settings
        self._tell_gains(settings.gains, board)
        self.reference = Reference(period)
        self.in_contact = self._resting = False
        self.amps = self.volts = 0.0
        self._units, self._hold, self._board = settings.units, hold, board
        board[Slot.HOLD] = hold
        self._controller = PositionLoop(gains, period * hold)
        inertia = settings.units.inertia / settings.units.torque_per_amp
        self._known = FeedForward(period * hold, inertia) if hold > 1 else None
        self._lead = 0.5 * hold + 1.0  # samples from a command's computing to the middle of its effect
        self._pull = TorqueDrive(period, gains, settings.units, settings.limits)
        self._pulling = False  # the trajectory is one of torque
        self._settling = Settling(period)
        self._limits, self._period = settings.limits, period
        self._bounds: Bounds | None = None  # of a trajectory of torque
        self._winding: Winding | None = None
        self._before: list[tuple[float, float, float]] = []  # of a take-up: MCP, PIP and force as it began
        self._moving = self._holding = 0
        self._most = math.inf  # A
        units, rise = settings.units, SOFT_SHARE * settings.limits.tension_rise
        self._softly = rise * units.pulley_radius / units.torque_per_amp * period  # A a sample
        self._soft = False  # a soft stop out of a torque

    @staticmethod
    def _tell_gains(gains: Gains, board: SharedStatus) -> None:
        board.set_number(Number.PROPORTIONAL, gains.proportional)
        board.set_number(Number.INTEGRAL, gains.integral)
        board.set_number(Number.DERIVATIVE, gains.derivative)

    def change_gains(self, command: SetGains, position: float) -> None:
        """Go on with other gains, the motor at ``position`` (rad).

        Raises:
            UserError: they are out of their ranges.
        """
        asked = command.proportional, command.integral, command.derivative
        gains = replace(self._settings.gains, **dict(zip(GAIN_RANGES, asked, strict=True)))
        check_gains(gains)
        self._settings = replace(self._settings, gains=gains)
        self._controller.change(gains_within(self._settings, self._hold), self.reference.value - position)
        self._tell_gains(gains, self._board)

    def off(self) -> None:
        """No current."""
        self.amps = self.volts = 0.0

    def stand(self, position: float) -> None:
        """No current, and no other angle wanted than where the motor is (rad)."""
        self.off()
        self.reference.value = position

    @property
    def taking_up(self) -> bool:
        """Whether slack is being taken up."""
        return isinstance(self._winding, TakeUp)

    def forget(self) -> None:
        """The slow motion that was under way has ended."""
        self._winding = None

    def start(self, command: ReadyStart | Winding, position: float, moving: bool) -> str:
        """Begin at ``position`` (rad), or go over from the motion of this moment; the refusal, or nothing."""
        pulling = isinstance(command, ReadyStart) and command.trajectory.is_torque
        if moving and pulling != self._pulling:
            return "The motor follows a trajectory of another kind (angle or torque); bring it to rest first."
        self._pulling = pulling
        self._bounds = self._bounds_of(command.trajectory) if isinstance(command, ReadyStart) else None
        self._winding = None if isinstance(command, ReadyStart) else command
        self._before, self._moving, self._holding = [], 0, 0
        self._most = command.current if isinstance(command, TakeUp) else math.inf
        self._board[Slot.APPROACHED] = 0
        self._resting = self._soft = False
        if not moving:
            self._controller.reset()
            self._know_nothing()
            self.reference.begin(position)
        if isinstance(command, Approach):
            self.reference.wind(command.speed, command.limit)
        elif isinstance(command, TakeUp):
            self.reference.wind(command.speed, self.reference.value + command.limit)
        elif isinstance(command, Jog):
            self._jog(command.speed)
        elif moving:
            self._followed.change(command.trajectory, command.endless)
        else:
            self._followed.start(command.trajectory, 0.0 if pulling else position, command.endless)
        return ""

    def doubt(self, reading: Reading) -> str | None:
        """Why a trajectory of torque may not go on although all limits are kept, or None."""
        return self._bounds.fault(reading) if self._pulling and self._bounds is not None else None

    def _bounds_of(self, trajectory: Trajectory) -> Bounds | None:
        settings = trajectory.settings
        if not trajectory.is_torque or not {MOST_FORCE, MOST_POSITION} & set(settings):
            return None
        force = float(settings.get(MOST_FORCE, math.inf))
        position = float(settings.get(MOST_POSITION, math.inf))
        return Bounds(force, math.radians(position), max(1, round(DOUBT_S / self._period)))

    def advance(self, reading: Reading) -> bool:
        """One sample further in the wanted motion; whether it is over."""
        followed = self._followed
        for _ in range(1 + reading.lost):  # time is the sample index: lost cycles have passed
            followed.next()
        if self._pulling:
            self.reference.value = reading.position  # no angle is asked for: the command is where it is
        if self._winding is not None:
            self._follow_winding(self._winding, reading)
        return followed.over

    def command(self, reading: Reading, due: bool = True) -> None:
        """Current command and set value for the next cycle.

        Args:
            due: whether the device takes one in the next cycle; else the last one goes on.
        """
        if not due:
            return
        if self._pulling:
            self.amps = self._pull.current(reading.speed)
        else:
            error, before = self.reference.value - reading.position, abs(self.amps)
            self.amps = self._controller.command(error, self._beforehand(reading.position))
            most = min(self._most, before + self._hold * self._softly) if self._soft else self._most
            self.amps = min(max(self.amps, -most), most)
        units = self._units
        self.volts = min(max(self.amps / units.amps_per_volt, units.low_volts), units.high_volts)

    def _beforehand(self, position: float) -> float:
        """By how much more than the last command is known to be needed, A; the motor is at ``position``."""
        known = self._known
        if known is None or self.in_contact or self._resting or self._winding is not None:
            return 0.0
        reference = self.reference
        more = known.more(position, self.amps, reference.ahead(self._lead), reference.acceleration)
        self._board.set_number(Number.FEED_FORWARD, known.slope)
        return more

    def _know_nothing(self) -> None:
        if self._known is not None:
            self._known.reset()
        self._board.set_number(Number.FEED_FORWARD, 0.0)

    def rest(self, position: float) -> None:
        """Begin a soft stop of a motor at ``position`` (rad)."""
        self._winding, self._most, self._resting = None, math.inf, True
        if self._pulling:  # the position loop takes over where the motor is, with the current that it has
            self._pulling, self._soft = False, True
            self._controller.take_over(self.amps)
            self._know_nothing()
            self.reference.begin(position)
        self.reference.rest()
        self._settling.begin()

    def settled(self, position: float) -> bool:
        """Whether a soft stop is over, the motor at ``position`` (rad). Asked once a cycle."""
        return self._settling.over(self.reference.value - position)

    @property
    def _followed(self) -> Reference:
        """What the trajectory commands: rad, or N m where it is one of torque."""
        return self._pull.reference if self._pulling else self.reference

    def _jog(self, speed: float) -> None:
        here = self.reference.value
        margin = JOG_MARGIN + JOG_LEAD_S * abs(speed)
        end = self._limits.position_high - margin if speed > 0 else self._limits.position_low + margin
        if speed * (end - here) > 0:
            self.reference.wind(speed, end)
        else:
            self.reference.hold(here)

    def _follow_winding(self, winding: Winding, reading: Reading) -> None:
        if isinstance(winding, Jog):
            if self.reference.over:
                self.reference.hold(self.reference.value)
        elif self._reached(winding, reading):
            # Where the motor is, not where it was told to be: the loop's integral makes the two agree. Where
            # a bound held the current back, what the loop asked for beyond it is forgotten.
            if self._most < math.inf:
                self._controller.take_over(self.amps)
                self.reference.begin(reading.position)
            self.reference.hold(reading.position)
            self._board.set_number(Number.APPROACH, reading.position)
            self._board[Slot.APPROACHED] = 1
            self._winding = None
        elif self.reference.over:
            self._board[Slot.APPROACHED] = -1

    def _reached(self, winding: Approach | TakeUp, reading: Reading) -> bool:
        if isinstance(winding, Approach):
            return reading.force >= winding.force
        if len(self._before) < MOVED_SAMPLES:
            self._before.append((reading.mcp, reading.pip, reading.force))
            return False
        mcp, pip, force = (sum(values) / MOVED_SAMPLES for values in zip(*self._before, strict=True))
        pulls = abs(reading.mcp - mcp) + abs(reading.pip - pip) >= winding.moved  # whatever their signs
        pulls = pulls or (self.in_contact and reading.force - force >= winding.pressed)
        self._moving = self._moving + 1 if pulls else 0
        self._holding = self._holding + 1 if abs(self.amps) >= winding.current else 0
        held = winding.or_held and self._holding >= round(HELD_S / self._period)
        return held or self._moving >= MOVED_SAMPLES

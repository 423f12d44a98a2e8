"""What the motor is told, cycle by cycle: a trajectory, an approach or a soft stop, by angle or by torque.

Whether the motor may be driven at all is not decided here but by the state machine, which the loop keeps.
"""

from __future__ import annotations

from fingerlab.acquisition.board import Board, Number, Slot
from fingerlab.acquisition.checks import Reading
from fingerlab.acquisition.commands import Approach
from fingerlab.acquisition.control import PositionLoop, Settling
from fingerlab.acquisition.reference import Reference
from fingerlab.acquisition.requests import LoopSettings, ReadyStart, gains_within
from fingerlab.acquisition.torque import TorqueDrive


class Steering:
    """The wanted motion and the current that makes it.

    Args:
        period: of a sample, s. hold: samples for which the device holds a set value.

    Attributes:
        reference: the wanted angle, rad. amps, volts: the present current command and set value.
    """

    def __init__(self, settings: LoopSettings, period: float, hold: int, board: Board) -> None:
        gains = gains_within(settings, hold)
        self.reference = Reference(period)
        self.amps = self.volts = 0.0
        self._units, self._hold, self._board = settings.units, hold, board
        board[Slot.HOLD] = hold
        self._controller = PositionLoop(gains, period * hold)
        self._pull = TorqueDrive(period, gains, settings.units, settings.limits)
        self._pulling = False  # the trajectory is one of torque
        self._settling = Settling(period)
        self._approach: Approach | None = None

    def off(self) -> None:
        """No current."""
        self.amps = self.volts = 0.0

    def stand(self, position: float) -> None:
        """No current, and no other angle wanted than where the motor is (rad)."""
        self.off()
        self.reference.value = position

    def forget(self) -> None:
        """The approach that was under way has ended."""
        self._approach = None

    def start(self, command: ReadyStart | Approach, position: float, moving: bool) -> str:
        """Begin at ``position`` (rad), or go over from the motion of this moment; the refusal, or nothing."""
        pulling = isinstance(command, ReadyStart) and command.trajectory.is_torque
        if moving and pulling != self._pulling:
            return "The motor follows a trajectory of another kind (angle or torque); bring it to rest first."
        self._pulling = pulling
        self._approach = command if isinstance(command, Approach) else None
        self._board[Slot.APPROACHED] = 0
        if not moving:
            self._controller.reset()
            self.reference.begin(position)
        if isinstance(command, Approach):
            self.reference.wind(command.speed, command.limit)
        elif moving:
            self._followed.change(command.trajectory, command.endless)
        else:
            self._followed.start(command.trajectory, 0.0 if pulling else position, command.endless)
        return ""

    def advance(self, reading: Reading) -> bool:
        """One sample further in the wanted motion; whether it is over."""
        followed = self._followed
        for _ in range(1 + reading.lost):  # time is the sample index: lost cycles have passed
            followed.next()
        if self._pulling:
            self.reference.value = reading.position  # no angle is asked for: the command is where it is
        if self._approach is not None:
            self._follow_approach(self._approach, reading)
        return followed.over

    def command(self, reading: Reading) -> None:
        """Current command and set value for the next cycle."""
        if self._hold != 1 and reading.index % self._hold != 0:
            return
        if self._pulling:
            self.amps = self._pull.current(reading.speed)
        else:
            self.amps = self._controller.command(self.reference.value - reading.position)
        units = self._units
        self.volts = min(max(self.amps / units.amps_per_volt, units.low_volts), units.high_volts)

    def rest(self, position: float) -> None:
        """Begin a soft stop of a motor at ``position`` (rad)."""
        self._approach = None
        if self._pulling:  # the position loop takes over where the motor is, with the current that it has
            self._pulling = False
            self._controller.take_over(self.amps)
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

    def _follow_approach(self, approach: Approach, reading: Reading) -> None:
        if reading.force >= approach.force:
            # Where the motor is, not where it was told to be: the loop's integral makes the two agree.
            self.reference.hold(reading.position)
            self._board.set_number(Number.APPROACH, reading.position)
            self._board[Slot.APPROACHED] = 1
            self._approach = None
        elif self.reference.over:
            self._board[Slot.APPROACHED] = -1

"""What the check of a rig lets the control loop do with the device, the amplifier being off."""

from __future__ import annotations

import math
from collections.abc import Callable

from fingerlab.acquisition.board import Board, Number, Slot
from fingerlab.acquisition.commands import MoveByHand, TryOutput
from fingerlab.devices.protocol import Device, MovedByHand, OutputReadBack, cycles_per_command

STAND_COMMANDS = 20
"""Set values written before the clock is stopped: the last has then long reached the output (assumed)."""

STOPPED_MEANWHILE = "The bench was stopped meanwhile; try again."


def move_by_hand(device: Device, command: MoveByHand) -> str:
    """Let a simulated rig do what its operator was asked to do; nothing where the bench is real."""
    if isinstance(device, MovedByHand):
        device.move_by_hand(command.channel, command.amount)
    return ""


def try_output(device: Device, command: TryOutput, board: Board, stopped: Callable[[], bool]) -> str:
    """Leave volts standing, stop the clock, write too late, look; then stop as ever, and look again.

    What was seen is in the board's ``LEFT``, ``CLEARED`` and ``SAFE``. The device's clock stands afterwards.

    Args:
        stopped: whether the operator or a process that died wants the bench at rest, asked once a cycle.

    Returns:
        Why not, as one sentence; empty where it was done.

    Raises:
        DeviceLost, DeviceFault: by the device.
    """
    if not isinstance(device, OutputReadBack):
        return f"The {device.name} cannot stop its clock with a set value standing; only a card can."
    block = cycles_per_command(device)
    for _ in range(STAND_COMMANDS * block):
        device.exchange(command.volts)
        if stopped():
            device.make_safe()
            return STOPPED_MEANWHILE
    device.abandon(late_write=0.0 if block == 1 else None)
    left = device.read_back_output()
    board[Slot.SAFE] = int(device.make_safe())
    cleared = device.read_back_output()
    board.set_number(Number.LEFT, math.nan if left is None else left)
    board.set_number(Number.CLEARED, math.nan if cleared is None else cleared)
    return ""

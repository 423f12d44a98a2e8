"""The guardian: a thread of the recorder's process that stops the motor in a dead loop's place.

It has a device of its own. Before the loop opens the bench, the guardian's device is built, its driver
imported and its stop tried, so that nothing is done for the first time when it counts; until that stands in
the board as done, the loop does not enable the amplifier.
"""

from __future__ import annotations

import time
from contextlib import suppress
from multiprocessing.connection import Connection

from fingerlab.acquisition.board import Board, Slot, Text
from fingerlab.acquisition.lives import Pulse, Standstill
from fingerlab.acquisition.loop import SAFE_TRIES
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost, StopRehearsal

LOOK_S = 0.005
"""How often the guardian looks whether the loop lives, where it is not told at once."""

TRIAL_S = 30.0
"""So long the loop waits for the trial; without it, the bench can be looked at and not driven (assumed)."""


def try_stop(device: Device | None, board: Board) -> None:
    """Let the guardian's device stop a bench that stands still, and put into the board whether it could.

    Args:
        device: not open; None where the device lives and dies with the loop's process.
    """
    why = _trial(device) if device is not None else ""
    if why:
        board.set_text(Text.GUARDIAN, why)
    board[Slot.GUARDIAN] = -1 if why else 1


def await_trial(board: Board, recorder_lives: Connection) -> None:
    """Until the guardian has tried its stop, which must not fall into what the loop does; or is gone."""
    end = time.monotonic() + TRIAL_S
    while not board[Slot.GUARDIAN] and time.monotonic() < end:
        if recorder_lives.poll(LOOK_S):  # nothing is ever sent: it has ended
            return


def guard(device: Device | None, board: Board, loop_lives: Connection, standstill: Standstill | None) -> None:
    """Wait for the loop's end; where it was no proper one, make the bench safe in its place.

    Args:
        device: as of :func:`try_stop`. standstill: tells whether the loop hangs, where that can be seen.
    """
    _wait_until_lost(board, loop_lives, standstill)
    if board[Slot.LOOP_ENDED]:
        return
    confirmed = device is None or _make_safe(device)
    board[Slot.SAFE] = int(confirmed)
    board[Slot.ENABLE_LINE] = 0
    board[Slot.KEEPER] = 1
    if device is None:
        return
    with suppress(EOFError, OSError):
        loop_lives.recv()
    # What the loop had handed to the driver may have come after the zero: write it once more.
    confirmed = any(_make_safe(device) for _ in range(SAFE_TRIES))
    board[Slot.SAFE] = int(confirmed)


def _trial(device: Device) -> str:
    """Why the device could not stop the motor; empty where it can."""
    try:
        if isinstance(device, StopRehearsal):
            device.try_stop()
            return ""
        confirmed = device.make_safe()
        device.close()  # the loop's own is to have the hardware
    except (DeviceLost, DeviceFault) as error:
        return f"{UNGUARDED} {error}"
    except Exception as error:
        return f"{UNGUARDED} {' '.join(f'{type(error).__name__}: {error}'.split())}"
    return (
        "" if confirmed else f"{UNGUARDED} {device.name} does not confirm zero output and a low enable line."
    )


UNGUARDED = "The motor cannot be enabled, for the process that stops it when the control loop dies could not:"


def _make_safe(device: Device) -> bool:
    """Whether zero output and a low enable line were confirmed. A user's own device may break its word."""
    try:
        return device.make_safe()
    except Exception:
        return False


def _wait_until_lost(board: Board, loop_lives: Connection, standstill: Standstill | None) -> None:
    """Until the loop's process is gone, or the system says that it is going, or it stands still."""
    pulse: Pulse | None = None
    with suppress(EOFError, OSError):
        while not loop_lives.poll(LOOK_S):
            if pulse is None and board[Slot.LOOP_PID]:
                pulse = Pulse(board[Slot.LOOP_PID])
            if pulse is not None and pulse.dying():
                return
            if standstill is not None and standstill.seen():
                return

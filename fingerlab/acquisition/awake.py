"""Holding off the machine's sleep while the amplifier is enabled.

It is done in the recorder's process, in a thread that may wait for the system as long as it likes: the loop
must not, and a process that dies lets go of the request by itself (on Windows with its thread, on Linux with
its connection to the desktop's bus, on macOS with the pipe to ``caffeinate``). Nobody can hold off a lid that
is closed or a battery that runs out: for these the bench has its dead-man.
"""

from __future__ import annotations

import threading
import time

from fingerlab.acquisition.board import Board, Slot, Text

LOOK_S = 0.1
"""How often the enable line is looked at; a machine takes minutes to fall asleep."""

REFUSED = (
    "The system does not let its sleep be held off; switch sleep off in its settings before the motor is "
    "driven."
)


def stay_awake(board: Board) -> None:
    """Follow the enable line of ``board`` from now on, in a thread of its own."""
    threading.Thread(target=_follow, args=(board,), name="awake", daemon=True).start()


def _follow(board: Board) -> None:
    while True:
        if board[Slot.ENABLE_LINE]:
            _hold_off(board)
        time.sleep(LOOK_S)


def _hold_off(board: Board) -> None:
    """Ask the system not to sleep until the line is low again; that it refuses goes to the board, once."""
    from wakepy import keep

    with keep.running(on_fail="pass") as mode:
        board[Slot.AWAKE] = int(mode.active)
        if not mode.active:
            board.set_text(Text.SLEEP, REFUSED)
        while board[Slot.ENABLE_LINE]:
            time.sleep(LOOK_S)
    board[Slot.AWAKE] = 0

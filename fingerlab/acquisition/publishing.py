"""What a cycle leaves behind for others: its row in the ring and the counters of the board."""

from __future__ import annotations

from fingerlab.acquisition.board import Board, Slot
from fingerlab.acquisition.checks import Reading
from fingerlab.acquisition.columns import RowFlag
from fingerlab.acquisition.machine import Machine
from fingerlab.acquisition.ring import Ring

LATE_SHARE = 0.5
"""A cycle is counted as late from this share of a period on (assumed)."""


class Publisher:
    """Writes rows and counts late and lost cycles."""

    def __init__(self, ring: Ring, board: Board, period: float) -> None:
        self._write, self._board, self._counters = ring.write, board, board.counters
        self._late_from = LATE_SHARE * period
        self._late = self._lost = self._cycles = 0

    def publish(self, r: Reading, machine: Machine, reference: float, amps: float, run: int) -> None:
        """Publish a cycle: ``reference`` in rad, ``amps`` the current command, ``run`` 0 without motion."""
        flags = 0
        if machine.enable_allowed:
            flags |= _ENABLED
        if machine.latched:
            flags |= _LATCHED
        if r.lateness > self._late_from:
            flags |= _LATE
            self._late += 1
            self._board[Slot.LATE] = self._late
        if r.lost:
            flags |= _LOST
            self._lost += r.lost
            self._board[Slot.LOST] = self._lost
        self._write(
            (
                r.index,
                reference,
                r.position,
                r.speed,
                amps,
                r.current,
                r.torque,
                r.mcp,
                r.pip,
                r.force,
                r.lateness,
                r.cycle_time,
                machine.mode,
                flags,
                run,
                *r.raw,
                *r.lines,
            )
        )
        self._cycles += 1
        self._counters[_INDEX] = r.index
        self._counters[_CYCLES] = self._cycles


# Plain numbers: arithmetic on an enum costs more than the rest of the cycle.
_ENABLED, _LATCHED = int(RowFlag.ENABLED), int(RowFlag.LATCHED)
_INDEX, _CYCLES = int(Slot.INDEX), int(Slot.CYCLES)
_LATE, _LOST = int(RowFlag.LATE), int(RowFlag.LOST_BEFORE)

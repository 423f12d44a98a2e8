"""A recording as a device: one run of a session, played back behind the device protocol."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.devices.protocol import (
    LINES,
    RAW_CHANNELS,
    Clock,
    DeviceFault,
    DeviceLost,
    Sample,
    VirtualClock,
)
from fingerlab.rig.daq import Daq, DeadManLine, SafetyLines
from fingerlab.sessions.model import Run

BLOCK = 8192
"""Samples read at once; a run may be longer than memory."""
_QUANTITIES = ("endpoint_force", "mcp_angle", "pip_angle", "motor_current", "motor_position")
"""Channels of a session from which the raw values follow, in the order of ``RAW_CHANNELS``."""


class Replay:
    """One run of a session behind the device protocol; commands and enable are taken and ignored.

    Raw values are the stored ones, else those at which the rig's scaling gives the stored quantities. The
    digital inputs are played back where they were recorded.

    Args:
        path: session file. run: its name, such as ``001``; the first run where it is None.
        clock: paced in real time by this clock; as fast as possible on a virtual one, or where it is None.

    Raises:
        UserError: no session, no such run, or a rig with an impossible wiring.
    """

    def __init__(self, path: Path, run: str | None = None, clock: Clock | None = None) -> None:
        from fingerlab.sessions.reading import open_session  # no other device needs HDF5

        session = open_session(path)
        self._run = _find(session.runs, run, path)
        self.rig = session.rig
        self.name = f"replay of {path.name}, run {self._run.name}"
        self.rate_hz = self._run.sample_rate_hz
        self._daq = session.rig.daq
        self._clock: Clock = clock or VirtualClock()
        self._open = self._running = False
        self._at = self._block_start = 0
        self._index = np.zeros(0, dtype=np.int64)
        self._raw = np.zeros((0, len(RAW_CHANNELS)))
        self._lines = np.zeros((0, len(LINES)))
        self._first_time = self._origin = 0.0

    @property
    def length(self) -> int:
        """Samples of the run."""
        return self._run.length

    @property
    def safety_lines(self) -> SafetyLines:
        """The digital inputs of the rig that was recorded; a recording needs no dead-man."""
        return replace(self._daq.safety_lines, dead_man=DeadManLine())

    def open(self) -> None:
        self._open = True

    def start(self) -> None:
        if not self._open:
            raise DeviceFault(f"The {self.name} is not open; open it before it is started.")
        if self._running:
            raise DeviceFault(f"The {self.name} is running already; stop it before it is started again.")
        self._running = True
        self._at = 0
        self._load(0)
        self._origin = self._clock.now() + 1.0 / self.rate_hz

    def set_enable(self, on: bool) -> None:
        if on and not self._running:
            raise DeviceFault(f"The {self.name} is not running; start it first.")

    def exchange(self, command_volts: float) -> Sample:
        if not self._running:
            raise DeviceFault(f"The {self.name} is not running; start it first.")
        if self._at >= self.length:
            self._running = False
            raise DeviceLost(
                f"The {self.name} has come to its end; start it again to see it from the beginning."
            )
        if self._at - self._block_start >= len(self._index):
            self._load(self._at)
        k = self._at - self._block_start
        index = int(self._index[k])
        due = self._origin + index / self.rate_hz
        wait = due - self._clock.now()
        if wait > 0.0:
            self._clock.sleep(wait)
        self._at += 1
        stop, ready = self._lines[k].tolist()
        return Sample(index, tuple(self._raw[k].tolist()), max(-wait, 0.0), (stop, ready))

    def make_safe(self) -> bool:
        self._running = False
        return True

    def close(self) -> None:
        self._running = self._open = False

    def _load(self, start: int) -> None:
        """Raw values of the next block, and their place on the time axis, in which gaps stay gaps."""
        try:
            self._load_block(start)
        except UserError as error:
            raise DeviceLost(str(error)) from error

    def _load_block(self, start: int) -> None:
        stop = min(start + BLOCK, self.length)
        known = (*_QUANTITIES, *(f"raw/{name}" for name in (*RAW_CHANNELS, *LINES)))
        names = [name for name in known if self._run.has(name)]
        values = self._run.load(["time", *names], start, stop)
        if start == 0:
            self._first_time = float(values["time"][0])
        self._block_start = start
        self._index = np.round((values["time"] - self._first_time) * self.rate_hz).astype(np.int64)
        columns = [_raw_values(k, values, self._daq, stop - start) for k in range(len(RAW_CHANNELS))]
        self._raw = np.column_stack(columns)
        absent = np.full(stop - start, math.nan)
        self._lines = np.column_stack([values.get(f"raw/{name}", absent) for name in LINES])


def _raw_values(k: int, values: dict[str, Any], daq: Daq, count: int) -> Any:
    stored = values.get(f"raw/{RAW_CHANNELS[k]}")
    if stored is not None:
        return stored
    quantity = values.get(_QUANTITIES[k])
    if quantity is None:
        return np.full(count, math.nan)
    if k == len(RAW_CHANNELS) - 1:
        return np.round(daq.encoder.counts(quantity))
    return daq.inputs[k].volts(quantity)


def _find(runs: tuple[Run, ...], name: str | None, path: Path) -> Run:
    if not runs:
        raise UserError(f"{path} holds no run; give a session with one.")
    if name is None:
        return runs[0]
    for run in runs:
        if run.name == name:
            return run
    raise UserError(f"{path} has no run {name!r}; it holds {', '.join(run.name for run in runs)}.")

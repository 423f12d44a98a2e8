"""What a device is: one exchange a cycle, raw values out, a current in, a clock; and a recording as one.

A device knows terminals, volts and counts. Units, limits, trajectories and safety belong to the control loop,
so that a simulated bench, a card and a replayed recording are driven by the same code. Time is the sample
index over the rate, never the wall clock.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.rig.daq import Daq, DeadManLine, SafetyLines
from fingerlab.sessions.model import Run


class Clock(Protocol):
    """Seconds from any origin, and a way to wait."""

    def now(self) -> float: ...

    def sleep(self, seconds: float) -> None: ...


class RealClock:
    """The machine's monotonic clock, which nobody can set."""

    def now(self) -> float:
        return time.perf_counter()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class VirtualClock:
    """Time that passes only when somebody waits, or says so."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += max(seconds, 0.0)

    def step(self, seconds: float) -> None:
        """Set the clock forward or back, as a person or a time server does."""
        self._now += seconds


DRIFT = 200e-6
"""How much two quartz clocks may differ: 50 ppm for each data sheet, doubled (assumed)."""

STEP = 1.0
"""s; a jump this large is the clock being set or the machine having slept, not lateness (assumed)."""


class LatenessMeter:
    """Lateness against the most punctual cycle so far.

    Neither clock knows when the card took its first sample, so that the origin is learnt: no cycle can
    be early, hence the earliest one seen sets it. It gives way by ``DRIFT``, so that a slow clock is not
    taken for a late program.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._origin: float | None = None
        self._index = 0

    def late_by(self, index: int, now: float) -> float:
        """Seconds by which sample ``index`` was read later than the most punctual ones, at ``now``."""
        origin = now - index * self._period
        if self._origin is None:
            self._origin, self._index = origin, index
            return 0.0
        self._origin += DRIFT * self._period * (index - self._index)
        self._index = index
        late = origin - self._origin
        if late < 0.0:
            self._origin = origin
            return 0.0
        if late > STEP:  # from here on lateness counts from the clock as it now is
            self._origin = origin
        return late


RAW_CHANNELS = ("force_volts", "mcp_volts", "pip_volts", "current_volts", "encoder_counts")
"""Order of the raw values: load cell, MCP and PIP sensor, current monitor (V), encoder (counts)."""

LINES = ("emergency_stop", "amplifier_ready")
"""Order of the digital inputs: 1 for pressed and for ready, 0 for not, NaN where there is no such line."""

NO_LINES = (float("nan"), float("nan"))


@dataclass(frozen=True, slots=True)
class Sample:
    """One cycle as the device saw it.

    Attributes:
        index: cycles of the sample clock since ``start``; a jump by more than one means lost cycles.
        raw: one value for each of ``RAW_CHANNELS``; NaN where the device has no such channel.
        lateness: seconds by which the program was late for this cycle; NaN where it cannot be told.
        lines: one value for each of ``LINES``.
    """

    index: int
    raw: tuple[float, ...]
    lateness: float = float("nan")
    lines: tuple[float, float] = NO_LINES


class DeviceLost(Exception):
    """The device no longer answers. The text is one sentence for the operator: what, where, what to do."""


class DeviceFault(Exception):
    """The device answered with an error but may be tried again; one sentence for the operator."""


@runtime_checkable
class Device(Protocol):
    """A bench that can be driven. All calls come from one process and one thread.

    Order: ``open``, ``start``, many ``exchange``, ``make_safe``, ``close``; ``start`` may follow
    ``make_safe``. ``make_safe`` may come at any time, even before ``open`` (a guardian stops what a lost
    process left), any number of times, and never raises: it writes 0 V, drops the enable line, and says
    whether both were confirmed. The guardian tries that once before the bench is opened, and then closes its
    device; a :class:`StopRehearsal` is asked for its ``try_stop`` instead.
    """

    @property
    def name(self) -> str: ...

    @property
    def rate_hz(self) -> float: ...

    def open(self) -> None:
        """Reserve the hardware with output at zero and enable low. Raises DeviceLost, DeviceFault."""

    def start(self) -> None:
        """Start the sample clock; output stays zero and enable low. Raises DeviceLost, DeviceFault."""

    def set_enable(self, on: bool) -> None:
        """Set the amplifier's enable line. Raises DeviceLost, DeviceFault."""

    def exchange(self, command_volts: float) -> Sample:
        """Write the amplifier's set value (V) for the next cycle, wait for that cycle, and read it.

        The set value reaches the motor at the edge of the clock at which the returned sample is taken: a
        command computed from one sample acts from the next one on. Raises DeviceLost, DeviceFault.
        """

    def make_safe(self) -> bool:
        """Zero output and enable low, whatever state the device is in; True where both were confirmed."""

    def close(self) -> None:
        """Give the hardware back, safe first. Never raises."""


# What a device may have beside that. A class need not name these protocols: it has the members, or not.


@runtime_checkable
class ReadInBlocks(Protocol):
    """A command stays for ``cycles_per_command`` cycles; the position loop runs at the rate over this."""

    @property
    def cycles_per_command(self) -> int: ...

    @property
    def command_is_due(self) -> bool:
        """Whether the next ``exchange`` takes its command; the sample just given is then the newest."""


@runtime_checkable
class SafetyWired(Protocol):
    """There are digital lines beside enable."""

    @property
    def safety_lines(self) -> SafetyLines: ...


@runtime_checkable
class DeadMan(Protocol):
    """The dead-man's line can be inverted."""

    def beat(self) -> None:
        """Invert it: called before each ``exchange`` while the amplifier is enabled and the loop well.

        Once for each command, whatever the cycles of a block. Raises as ``exchange`` does.
        """


@runtime_checkable
class CountsOn(Protocol):
    """The encoder may be counted on while nothing is sampled."""

    @property
    def counted_on(self) -> bool:
        """Whether the counts since the last ``start`` go on from those before it."""


@runtime_checkable
class SetUpBySoftware(Protocol):
    """A simulated bench, on which nobody changes cable and load cell by hand."""

    def set_up(self, phase: str, cable: str, load_torque: float, intervention: str = "") -> None:
        """Change them, and the machine by a known change (JSON text); raises DeviceFault."""


@runtime_checkable
class MovedByHand(Protocol):
    """A simulated bench does what its operator is asked to do with a hand."""

    def move_by_hand(self, channel: str, amount: float) -> None:
        """Move ``load_cell`` (N), ``mcp``, ``pip``, ``encoder`` (rad), or set one of ``LINES`` (1 or 0)."""


@runtime_checkable
class SelfDescribing(Protocol):
    """What a session recorded from the device is to carry as attributes."""

    @property
    def session_attributes(self) -> dict[str, str]: ...


@runtime_checkable
class StopRehearsal(Protocol):
    """The stop can be tried without taking the hardware."""

    def try_stop(self) -> None:
        """Try it; raises as ``open`` does."""


@runtime_checkable
class OutputReadBack(Protocol):
    """A card, whose clock can be stopped with a set value standing; for ``check-rig``, the amplifier off."""

    def abandon(self, late_write: float | None = None) -> None:
        """Stop the clock and give the tasks back without writing anything safe; then write so many V."""

    def read_back_output(self) -> float | None:
        """V at the output; None where the card cannot tell."""


def cycles_per_command(device: Device) -> int:
    """How many cycles a command stays: 1, or the block of a device that is read in blocks."""
    return device.cycles_per_command if isinstance(device, ReadInBlocks) else 1


def counted_on(device: Device) -> bool:
    """Whether the encoder went on being counted over the device's last new start."""
    return isinstance(device, CountsOn) and device.counted_on


def safety_lines(device: Device) -> SafetyLines:
    """The digital lines that a device has beside enable."""
    return device.safety_lines if isinstance(device, SafetyWired) else SafetyLines()


@dataclass(frozen=True)
class FoundDevice:
    """One device that was found, or why it was not: ``sentence`` is shown as it is."""

    name: str
    available: bool
    sentence: str


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

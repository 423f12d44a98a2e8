"""What a device is: one exchange a cycle, raw values out, a current in, a clock.

A device knows terminals, volts and counts. Units, limits, trajectories and safety belong to the control loop,
so that a simulated bench, a card and a replayed recording are driven by the same code. Time is the sample
index over the rate, never the wall clock.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from fingerlab.rig.daq import SafetyLines


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
    """One device that was found, or why it was not: ``sentence`` is shown as it is.

    ``listed``: names of all cards that its driver has, none of them without a driver; None: it does not say.
    """

    name: str
    available: bool
    sentence: str
    listed: tuple[str, ...] | None = None

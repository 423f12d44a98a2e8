"""What the simulated rig has around the finger: a charge pump at the dead-man's line, and faults by cycle.

Each rising edge of the line moves charge from the coupling to the storage capacitor, which a resistor
empties; a comparator lets the amplifier's enable through while there is enough. A line that stands still,
high or low, moves nothing.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.devices.protocol import LINES, RAW_CHANNELS

COUPLING = 470e-9
STORAGE = 47e-9
"""F; capacitors of the circuit in ``docs/rig.md`` (assumed: a choice of this design)."""

THRESHOLD = 0.3
"""Voltage at which the comparator lets go, as a share of the highest (assumed: a choice of this design)."""

SHARE = COUPLING / (COUPLING + STORAGE)
"""How much of what is missing one rising edge brings: 0.91."""


class ChargePump:
    """Its voltage as a share of the highest, from the line's edges and the time between them.

    Args:
        hold_time: s from the last rising edge of a full pump until it lets go.
    """

    def __init__(self, hold_time: float) -> None:
        self.time_constant = hold_time / math.log(1.0 / THRESHOLD)
        self._level = 0.0
        self._line = False

    @property
    def on(self) -> bool:
        """Whether the amplifier's enable is let through."""
        return self._level > THRESHOLD

    def invert(self) -> None:
        """One edge of the line."""
        self._line = not self._line
        if self._line:
            self._level += SHARE * (1.0 - self._level)

    def wait(self, seconds: float) -> None:
        """Let time pass without an edge."""
        self._level *= math.exp(-seconds / self.time_constant)


@dataclass(frozen=True)
class SensorFault:
    """A sensor that goes dead (NaN), or does one of the following instead.

    Attributes:
        channel: one of ``RAW_CHANNELS``. start: first cycle, counted like ``Sample.index``.
        cycles: how long, infinite by default. stuck: sticks at its last reading.
        level: reads this (V), as a wire that is off or shorted does. noise: V rms beside it, or beside where
            it sticks. drift: V a cycle by which it wanders off. turned: its sense is the other way. share: of
            its changes that it shows.
    """

    channel: str
    start: int
    cycles: float = math.inf
    stuck: bool = False
    level: float | None = None
    noise: float = 0.0
    drift: float = 0.0
    turned: bool = False
    share: float = 1.0

    def __post_init__(self) -> None:
        if self.channel not in RAW_CHANNELS:
            raise ValueError(f"There is no channel {self.channel!r}; known are {', '.join(RAW_CHANNELS)}.")


@dataclass(frozen=True)
class LineFault:
    """A digital input that tells something else than it should, once; a new start of the device ends it not.

    Attributes:
        line: one of ``LINES``. start: first cycle, counted like ``Sample.index``. on: what it tells.
        cycles: of the bench, how long; infinite by default.
    """

    line: str
    start: int
    on: bool
    cycles: float = math.inf

    def __post_init__(self) -> None:
        if self.line not in LINES:
            raise ValueError(f"There is no line {self.line!r}; known are {', '.join(LINES)}.")


@dataclass(frozen=True)
class Faults:
    """Faults of a simulated rig; cycles are counted like ``Sample.index``.

    Attributes:
        unplug_at: from this cycle on the device no longer answers, and its outputs fall to zero.
        sensors: dead or sticking sensors.
        swapped: pairs of channels whose cables are exchanged.
        encoder_jumps: cycle -> counts by which the encoder jumps there.
        late: cycle -> s by which the program learns of that cycle too late.
        lost: cycle -> how many cycles before it nobody saw.
        clock_steps: cycle -> s by which the clock is set there.
        unsafe: how often ``make_safe`` fails before it works.
        lines: an emergency stop that is pressed, an amplifier that is not ready.
        pump_sticks: the comparator behind the dead-man's charge pump lets enable through all the time.
    """

    unplug_at: int | None = None
    sensors: tuple[SensorFault, ...] = ()
    swapped: tuple[tuple[str, str], ...] = ()
    encoder_jumps: Mapping[int, float] = field(default_factory=dict)
    late: Mapping[int, float] = field(default_factory=dict)
    lost: Mapping[int, int] = field(default_factory=dict)
    clock_steps: Mapping[int, float] = field(default_factory=dict)
    unsafe: int = 0
    lines: tuple[LineFault, ...] = ()
    pump_sticks: bool = False


SLOW_S, SKIPPED, CLOCK_S = 0.05, 5, -3600.0
HELD = 5000
"""Cycles for which the emergency stop is held and the amplifier is not ready: 5 s, then it can be reset."""
NOISE, DRIFT = 3e-3, 2e-4
"""V rms of an input with nothing on it; V a cycle, 8 degrees a second."""
JUMP_COUNTS = 480.0
"""Counts; 20 degrees of the bench's encoder."""


@dataclass(frozen=True)
class FaultKind:
    """A fault that can be asked for by name: ``title`` in an operator's words, ``make`` from its cycle."""

    title: str
    make: Callable[[int], Faults]


def _sensor(channel: str, **how: Any) -> Callable[[int], Faults]:
    return lambda cycle: Faults(sensors=(SensorFault(channel, cycle, **how),))


def _line(line: str, on: bool) -> Callable[[int], Faults]:
    return lambda cycle: Faults(lines=(LineFault(line, cycle, on, HELD),))


FAULT_KINDS: dict[str, FaultKind] = {
    "unplugged": FaultKind("the device is unplugged", lambda cycle: Faults(unplug_at=cycle)),
    "dead-load-cell": FaultKind("the load cell goes dead", _sensor("force_volts")),
    "stuck-load-cell": FaultKind("the load cell sticks", _sensor("force_volts", stuck=True)),
    "dead-mcp": FaultKind("the MCP sensor goes dead", _sensor("mcp_volts")),
    "stuck-mcp": FaultKind("the MCP sensor sticks", _sensor("mcp_volts", stuck=True)),
    "dead-pip": FaultKind("the PIP sensor goes dead", _sensor("pip_volts")),
    "stuck-pip": FaultKind("the PIP sensor sticks", _sensor("pip_volts", stuck=True)),
    "dead-current": FaultKind("the current monitor goes dead", _sensor("current_volts")),
    "load-cell-off": FaultKind(
        "the load cell's wire comes off", _sensor("force_volts", level=0.0, noise=NOISE)
    ),
    "mcp-short": FaultKind(
        "the MCP sensor is shorted to its supply", _sensor("mcp_volts", level=5.0, noise=NOISE)
    ),
    "pip-noise": FaultKind("the PIP sensor gives noise only", _sensor("pip_volts", stuck=True, noise=NOISE)),
    "mcp-drift": FaultKind("the MCP sensor drifts", _sensor("mcp_volts", drift=DRIFT)),
    "current-off": FaultKind(
        "the current monitor's wire comes off", _sensor("current_volts", level=0.0, noise=NOISE)
    ),
    "mcp-turned": FaultKind(
        "the MCP sensor is mounted the wrong way round", _sensor("mcp_volts", turned=True)
    ),
    "load-cell-weak": FaultKind("the load cell shows half of its force", _sensor("force_volts", share=0.5)),
    "encoder-turned": FaultKind(
        "two of the encoder's wires are swapped", _sensor("encoder_counts", turned=True)
    ),
    "swapped-sensors": FaultKind(
        "the cables of load cell and MCP sensor are swapped",
        lambda cycle: Faults(swapped=(("force_volts", "mcp_volts"),)),
    ),
    "stuck-encoder": FaultKind("the encoder sticks", _sensor("encoder_counts", stuck=True)),
    "encoder-jump": FaultKind(
        "the encoder jumps by 20°", lambda cycle: Faults(encoder_jumps={cycle: JUMP_COUNTS})
    ),
    "late": FaultKind("a cycle comes 50 ms late", lambda cycle: Faults(late={cycle: SLOW_S})),
    "lost": FaultKind("five cycles are lost", lambda cycle: Faults(lost={cycle: SKIPPED})),
    "emergency-stop": FaultKind("the emergency stop is pressed", _line("emergency_stop", True)),
    "not-ready": FaultKind("the amplifier is no longer ready", _line("amplifier_ready", False)),
    "clock": FaultKind("the clock is set back an hour", lambda cycle: Faults(clock_steps={cycle: CLOCK_S})),
}
"""Faults for practice, by id."""


def fault_after(kind: str, seconds: float, rate_hz: float) -> Faults:
    """One of :data:`FAULT_KINDS`, so many seconds after the device starts (and after each new start).

    Args:
        kind: its id; empty for no fault.

    Raises:
        UserError: there is no such fault.
    """
    if not kind:
        return Faults()
    if kind not in FAULT_KINDS:
        raise UserError(f"There is no fault {kind!r}; known are {', '.join(FAULT_KINDS)}.")
    return FAULT_KINDS[kind].make(round(seconds * rate_hz))


class FaultySensors:
    """Lets raw values through, spoilt as ``faults`` say."""

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self._jumped = 0.0
        self._jumps = dict(faults.encoder_jumps)
        self._held: dict[SensorFault, float] = {}
        self._noise = random.Random(1)

    def spoil(self, index: int, raw: tuple[float, ...]) -> tuple[float, ...]:
        """The raw values of cycle ``index`` as they arrive."""
        if not self._faults.sensors and not self._faults.encoder_jumps and not self._faults.swapped:
            return raw
        values = list(raw)
        for one, other in self._faults.swapped:
            i, k = RAW_CHANNELS.index(one), RAW_CHANNELS.index(other)
            values[i], values[k] = values[k], values[i]
        for cycle in [c for c in self._jumps if c <= index]:
            self._jumped += self._jumps.pop(cycle)
        values[-1] += self._jumped
        for fault in self._faults.sensors:
            if not fault.start <= index < fault.start + fault.cycles:
                continue
            k = RAW_CHANNELS.index(fault.channel)
            values[k] = self._spoilt(fault, index, values[k])
        return tuple(values)

    def _spoilt(self, fault: SensorFault, index: int, value: float) -> float:
        held = self._held.setdefault(fault, value)
        if fault.drift:
            return value + fault.drift * (index - fault.start)
        if fault.turned:
            return 2.0 * held - value
        if fault.share != 1.0:
            return held + fault.share * (value - held)
        level = held if fault.stuck else math.nan if fault.level is None else fault.level
        noise = self._noise.gauss(0.0, fault.noise) if fault.noise else 0.0
        return level + (round(noise) if fault.channel == RAW_CHANNELS[-1] else noise)

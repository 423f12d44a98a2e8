"""How the bench is wired: terminals, scaling and signs of its channels.

A rig carries it as plain JSON under the key ``daq``, so that a session tells under which wiring it was taken;
what a rig leaves out has the defaults of the bench. SI units throughout.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Literal

from fingerlab.core.errors import UserError
from fingerlab.rig.limits import BENCH_LIMITS, LIMIT_UNITS, Limits, section_of

SOURCES = "sources"
"""Key under which a section keeps the origin of its values, by dotted name."""
OPTIONAL_LINES = frozenset({"dead_man", "emergency_stop", "amplifier_ready"})
"""Digital lines without which a bench can be driven."""
Timing = Literal["auto", "single-point", "buffered"]
Wiring = Literal["default", "rse", "nrse", "diff", "pseudodiff"]
BLOCK_RANGE = (5, 10)
"""Samples a block of the buffered fallback: the position loop then runs at 100 to 200 Hz."""
_KMA210_GAIN = math.pi / 4.5  # 180 degrees over 5 to 95 % of 5 V


@dataclass(frozen=True)
class AnalogInput:
    """A sensor on a straight line: quantity = sign * (gain * volts + offset).

    Attributes:
        terminal: of the card, such as ``ai0``; empty where the bench has no such sensor.
        gain: SI unit of the quantity a volt. offset: SI unit. sign: +1 or -1.
        low, high: range asked of the card, V.
        wiring: ``default`` (the card's own), ``rse``, ``nrse``, ``diff`` or ``pseudodiff``.
        valid_low, valid_high: V between which the reading lies while sensor, supply and cable are well.
    """

    terminal: str
    gain: float
    offset: float = 0.0
    sign: int = 1
    low: float = -10.0
    high: float = 10.0
    wiring: Wiring = "default"
    valid_low: float = -10.0
    valid_high: float = 10.0

    def quantity(self, volts: Any) -> Any:
        """Volts (number or array) as the quantity in SI."""
        return self.sign * (self.gain * volts + self.offset)

    def volts(self, quantity: Any) -> Any:
        """The volts at which the sensor shows ``quantity`` (SI, number or array)."""
        return (self.sign * quantity - self.offset) / self.gain


@dataclass(frozen=True)
class Encoder:
    """The motor's encoder on a counter, four edges a line.

    Attributes:
        terminal: the counter, such as ``ctr0``.
        counts_per_turn: counts a turn of the gearbox output. sign: +1 where counts grow while winding.
        index: whether the index pulse sets the counter to zero.
        a, b, z: terminals of its three wires, such as ``PFI8``; empty for those of its counter.
        filter_time: s; shorter pulses of the three are not seen. 0: no filter.
    """

    terminal: str = "ctr0"
    counts_per_turn: float = 8600.0
    sign: int = 1
    index: bool = False
    a: str = ""
    b: str = ""
    z: str = ""
    filter_time: float = 0.0

    def quantity(self, counts: Any) -> Any:
        """Counts (number or array) as an angle at the gearbox output, rad."""
        return self.sign * counts * (2.0 * math.pi / self.counts_per_turn)

    def counts(self, angle: Any) -> Any:
        """Counts, not yet whole ones, of an angle at the gearbox output (rad, number or array)."""
        return self.sign * angle * (self.counts_per_turn / (2.0 * math.pi))


PAIRED = 8
"""On a card of NI's X Series each analog input of the first eight, and of every second eight after them, is
one half of a differential channel whose other half is the input eight further (User Manual, table 4-2)."""
COUNTER_WIRES = {
    "ctr0": ("PFI8", "PFI10", "PFI9"),
    "ctr1": ("PFI3", "PFI11", "PFI4"),
    "ctr2": ("PFI0", "PFI2", "PFI1"),
    "ctr3": ("PFI5", "PFI7", "PFI6"),
}
"""A, B, Z of an encoder where nothing else is told (X Series User Manual, "Default Counter/Timer Pins")."""
MOST_FILTER_S = 2.56e-3
"""The longest of the card's own filters (X Series User Manual, table 8-1)."""


def second_terminal(channel: AnalogInput) -> str:
    """What an analog input is measured against on a card of NI's X Series; empty where that cannot be told.

    ``default`` is differential for the inputs that can be, and against ``AI GND`` for the others (NI-DAQmx
    User Manual, "Default Input/Output Terminal Configurations").
    """
    number = channel.terminal.removeprefix("ai")
    if channel.terminal == number or not number.isdecimal():
        return ""
    first = int(number) % (2 * PAIRED) < PAIRED
    if channel.wiring in ("diff", "pseudodiff") or (channel.wiring == "default" and first):
        return f"ai{int(number) + PAIRED}" if first else ""
    if channel.wiring == "nrse":
        return "AI SENSE" if int(number) < 2 * PAIRED else "AI SENSE 2"
    return "AI GND"


def encoder_wires(encoder: Encoder) -> str:
    """Where A, B and, if it is used, Z of the encoder belong, such as ``A PFI8, B PFI10``."""
    usual = COUNTER_WIRES.get(encoder.terminal, ("the card's own",) * 3)
    terminals = (encoder.a or usual[0], encoder.b or usual[1], encoder.z or usual[2])
    wires = zip("ABZ", terminals, strict=True) if encoder.index else zip("AB", terminals[:2], strict=True)
    return ", ".join(f"{name} {terminal}" for name, terminal in wires)


@dataclass(frozen=True)
class CommandOutput:
    """The amplifier's set value: current = sign * gain * volts.

    Attributes:
        terminal: such as ``ao0``. gain: A/V. sign: +1 where positive volts wind the cable.
        low, high: range that may be written, V.
    """

    terminal: str = "ao0"
    gain: float = 1.0
    sign: int = 1
    low: float = -10.0
    high: float = 10.0

    def volts(self, current: float) -> float:
        """Volts for a current in A, within the range that may be written."""
        return min(max(self.sign * current / self.gain, self.low), self.high)

    def current(self, volts: Any) -> Any:
        """Current (A) that the amplifier makes of ``volts``, number or array."""
        return self.sign * self.gain * volts


@dataclass(frozen=True)
class EnableLine:
    """The digital line that enables the amplifier: ``port0/line0``, active at 5 V or at 0 V."""

    terminal: str = "port0/line0"
    active_high: bool = True


@dataclass(frozen=True)
class DeadManLine:
    """A digital output that the control loop inverts once a command; see "A dead-man" in ``docs/rig.md``.

    Attributes:
        terminal: such as ``port0/line1``; empty where the bench has none.
        hold_time: s for which the charge pump behind it holds the amplifier's enable after the last edge;
            up to 50 ms.
    """

    terminal: str = ""
    hold_time: float = 0.05


@dataclass(frozen=True)
class EmergencyStopLine:
    """A digital input that tells whether the emergency stop is pressed; it acts by its own contacts.

    Attributes:
        terminal: such as ``port0/line2``; empty where the bench has none.
        active_high: whether 5 V mean "pressed"; otherwise 0 V or a broken wire do.
    """

    terminal: str = ""
    active_high: bool = False


@dataclass(frozen=True)
class AmplifierReadyLine:
    """A digital input that tells whether the amplifier is ready.

    Attributes:
        terminal: such as ``port0/line3``; empty where the bench has none.
        active_high: whether 5 V mean "ready".
        settling_time: s after enable within which it may still become ready.
        needs_enable: only an enabled amplifier tells, or clears its fault; it is not asked before.
    """

    terminal: str = ""
    active_high: bool = True
    settling_time: float = 0.1
    needs_enable: bool = False


@dataclass(frozen=True)
class SafetyLines:
    """The digital lines beside enable that a bench may have; each has an empty terminal where it has not."""

    dead_man: DeadManLine = DeadManLine()
    emergency_stop: EmergencyStopLine = EmergencyStopLine()
    amplifier_ready: AmplifierReadyLine = AmplifierReadyLine()


@dataclass(frozen=True)
class Daq:
    """The card, how it is timed, and the channels of the bench.

    Attributes:
        device: name of the card in the driver. server: ``host:port`` of a gRPC device server, or empty
            for the driver of this machine.
        timing: ``single-point`` (one sample a cycle, blocking), ``buffered`` (blocks of ``block``
            samples), or ``auto``: single-point where card and driver allow it.
        rate_hz: sample clock, Hz.
    """

    device: str = "Dev1"
    server: str = ""
    timing: Timing = "auto"
    rate_hz: float = 1000.0
    block: int = 10
    load_cell: AnalogInput = AnalogInput("ai0", 11.194, -5.317, valid_low=0.4, valid_high=4.6)
    mcp: AnalogInput = AnalogInput("ai1", _KMA210_GAIN, -2.5 * _KMA210_GAIN, valid_low=0.2, valid_high=4.8)
    pip: AnalogInput = AnalogInput("ai2", _KMA210_GAIN, -2.5 * _KMA210_GAIN, valid_low=0.2, valid_high=4.8)
    current_monitor: AnalogInput = AnalogInput("ai3", 1.25, sign=-1)
    encoder: Encoder = Encoder()
    command: CommandOutput = CommandOutput()
    enable: EnableLine = EnableLine()
    dead_man: DeadManLine = DeadManLine()
    emergency_stop: EmergencyStopLine = EmergencyStopLine()
    amplifier_ready: AmplifierReadyLine = AmplifierReadyLine()
    sources: Mapping[str, str] = field(default_factory=dict)

    @property
    def safety_lines(self) -> SafetyLines:
        """The digital lines beside enable."""
        return SafetyLines(self.dead_man, self.emergency_stop, self.amplifier_ready)

    @property
    def inputs(self) -> tuple[AnalogInput, AnalogInput, AnalogInput, AnalogInput]:
        """Load cell, MCP, PIP and current monitor: the order of a device's raw values."""
        return self.load_cell, self.mcp, self.pip, self.current_monitor


CHANNEL_UNITS = {
    "load_cell": {"gain": "N/V", "offset": "N"},
    "mcp": {"gain": "rad/V", "offset": "rad"},
    "pip": {"gain": "rad/V", "offset": "rad"},
    "current_monitor": {"gain": "A/V", "offset": "A"},
    "encoder": {"filter_time": "s"},
    "command": {"gain": "A/V"},
    "dead_man": {"hold_time": "s"},
    "amplifier_ready": {"settling_time": "s"},
}
"""SI unit of the scaling and times of each channel; every other number of ``[daq]`` is in volts or plain."""


def read_daq(data: Any, where: str) -> Daq:
    """The wiring from plain JSON; what is missing has the bench's default.

    Raises:
        UserError: an entry is unknown, of the wrong kind, or impossible.
    """
    daq = section_of(Daq, data, where)
    low, high = BLOCK_RANGE
    if not low <= daq.block <= high:
        raise UserError(f"{where} block is {daq.block}; it should be {low} to {high} samples.")
    if not daq.rate_hz > 0:
        raise UserError(f"{where} rate_hz is {daq.rate_hz:g}; it should be above zero, such as 1000.")
    for name in ("load_cell", "mcp", "pip", "current_monitor", "encoder", "command"):
        _check_channel(getattr(daq, name), f"{where} {name}")
    for name in ("encoder", "command", "enable"):
        if not getattr(daq, name).terminal:
            raise UserError(f"{where} {name} has no terminal; the motor cannot be driven without it.")
    _check_lines(daq, where)
    _check_wires(daq, where)
    return daq


LEAST_JUMPS = 4
"""Commands of the position loop that a dead-man has to hold at least: a charge pump is fed by every second
edge, and one such edge may come a period late (assumed)."""

MOST_HELD_S = 0.05
"""A dead-man that holds for longer stops the motor later than loop and guardian do (``docs/faults.md``): a
person's finger is at its end."""


def _check_lines(daq: Daq, where: str) -> None:
    """No two digital lines on one terminal, and times that a bench can keep."""
    taken: dict[str, str] = {}
    for name in OPTIONAL_LINES | {"enable"}:
        terminal = getattr(daq, name).terminal
        if terminal and terminal in taken:
            one, other = sorted((name, taken[terminal]))
            raise UserError(
                f"{where} {one} and {other} are both on {terminal}; each needs a line of its own."
            )
        taken[terminal] = name
    command = daq.block if daq.timing != "single-point" else 1
    least = LEAST_JUMPS * command / daq.rate_hz
    if daq.dead_man.terminal and least > MOST_HELD_S:
        raise UserError(
            f"{where} dead_man would have to hold for {least:g} s ({LEAST_JUMPS} commands of the position "
            f"loop), and one that holds for more than {MOST_HELD_S:g} s stops nothing in time; make block "
            "smaller, or rate_hz higher."
        )
    if daq.dead_man.terminal and not least <= daq.dead_man.hold_time <= MOST_HELD_S:
        raise UserError(
            f"{where} dead_man hold_time is {daq.dead_man.hold_time:g} s; it should be {least:g} s "
            f"({LEAST_JUMPS} commands of the position loop) to {MOST_HELD_S:g} s, in which everything else "
            "stops the motor."
        )
    if not 0.0 <= daq.amplifier_ready.settling_time <= 2.0:
        raise UserError(
            f"{where} amplifier_ready settling_time is {daq.amplifier_ready.settling_time:g} s; it should be "
            "0 to 2 s."
        )


def _check_wires(daq: Daq, where: str) -> None:
    """No input on the other half of a differential one, and a filter that the card has."""
    if not 0.0 <= daq.encoder.filter_time <= MOST_FILTER_S:
        raise UserError(
            f"{where} encoder filter_time is {daq.encoder.filter_time:g} s; it should be 0 (none) to "
            f"{1e3 * MOST_FILTER_S:g} ms, such as 5.12 us."
        )
    named = {name: getattr(daq, name) for name in ("load_cell", "mcp", "pip", "current_monitor")}
    for name, channel in named.items():
        if channel.terminal and channel.wiring == "diff" and not second_terminal(channel):
            raise UserError(
                f"{where} {name} is differential at {channel.terminal}, which is no first half of a pair; "
                "ai0 to ai7 and ai16 to ai23 are."
            )
        for other, taken in named.items():
            if taken.terminal and channel.wiring == "diff" and taken.terminal == second_terminal(channel):
                raise UserError(
                    f"{where} {other} is on {taken.terminal}, the second terminal of {name}; give it another."
                )


def _check_channel(channel: Any, where: str) -> None:
    if channel.sign not in (-1, 1):
        raise UserError(f"{where} sign is {channel.sign}; it should be 1 or -1.")
    gain = channel.counts_per_turn if isinstance(channel, Encoder) else channel.gain
    if gain == 0 or (isinstance(channel, Encoder) and gain < 0):
        raise UserError(f"{where} has a scaling of {gain:g}; nothing could be read from it.")
    if not isinstance(channel, Encoder) and not channel.low < channel.high:
        raise UserError(f"{where} low is not below high; give the range in volts.")
    if isinstance(channel, AnalogInput) and not channel.valid_low < channel.valid_high:
        raise UserError(f"{where} valid_low is not below valid_high; give them in volts.")
    if isinstance(channel, CommandOutput) and not channel.low <= 0 <= channel.high:
        raise UserError(f"{where} leaves out 0 V; without it the motor cannot be stopped.")


def plain_section(section: Daq | Limits) -> dict[str, Any]:
    """A section as plain JSON, every value stated.

    Left out are lines that the bench does not have, and of the loop's own limits those that nobody changed.
    """

    def plain(value: Any) -> Any:
        if is_dataclass(value) and not isinstance(value, type):
            return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
        return dict(value) if isinstance(value, Mapping) else value

    result: dict[str, Any] = plain(section)
    for name in OPTIONAL_LINES & result.keys():  # a session of a bench without them reads as it always did
        if not result[name]["terminal"]:
            del result[name]
    if isinstance(section, Daq):  # and what nobody told of the encoder's wires
        optional = ("a", "b", "z", "filter_time")
        encoder = result["encoder"].items()
        result["encoder"] = {name: value for name, value in encoder if value or name not in optional}
    if isinstance(section, Limits):
        usual = {name: getattr(Limits(), name) for name in LIMIT_UNITS if name not in BENCH_LIMITS}
        result = {key: value for key, value in result.items() if usual.get(key) != value}
    if not result[SOURCES]:
        del result[SOURCES]
    return result

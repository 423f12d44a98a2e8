"""Units of what the card reads: how raw values become SI, and the reading of each sample."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fingerlab.acquisition.control.safety import Reading
from fingerlab.rig.daq import AnalogInput
from fingerlab.rig.file import Rig

if TYPE_CHECKING:
    from fingerlab.devices.protocol import Sample

ROTOR_INERTIA = 2.6e-4
"""kg m^2 at the output of a bench that names none: the RE40's rotor behind its gearbox (``default.toml``)."""


@dataclass(frozen=True)
class Line:
    """quantity = gain * volts + offset, in SI units.

    Attributes:
        low, high: V between which the reading lies while sensor, supply and cable are well.
    """

    gain: float
    offset: float = 0.0
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class BenchUnits:
    """How raw values become units. A line that is None stands for a channel that the bench lacks.

    Attributes:
        force: N. mcp, pip: rad, flexion positive. current: A.
        counts_per_turn: encoder counts a turn of the gearbox output; negative where it counts backwards.
        amps_per_volt: current set value, A/V; negative where the motor turns backwards.
        low_volts, high_volts: range of the set value, V.
        torque_per_amp: N m/A at the gearbox output. pulley_radius: m. inertia: kg m^2 there.
    """

    force: Line | None
    mcp: Line | None
    pip: Line | None
    current: Line | None
    counts_per_turn: float
    amps_per_volt: float
    low_volts: float
    high_volts: float
    torque_per_amp: float
    pulley_radius: float
    inertia: float = ROTOR_INERTIA

    @classmethod
    def from_rig(cls, rig: Rig) -> BenchUnits:
        """The wiring and scaling of a rig; a pulley that it does not know has 15 mm (assumed).

        Raises:
            UserError: the rig holds an impossible wiring.
        """
        daq = rig.daq
        return cls(
            _line(daq.load_cell),
            _line(daq.mcp),
            _line(daq.pip),
            _line(daq.current_monitor),
            daq.encoder.sign * daq.encoder.counts_per_turn,
            daq.command.sign * daq.command.gain,
            daq.command.low,
            daq.command.high,
            rig.motor.torque_constant * rig.motor.gear_ratio,
            rig.motor.pulley_radius or 0.015,
            ROTOR_INERTIA if rig.motor.inertia is None else rig.motor.inertia,
        )

    @property
    def inputs(self) -> tuple[Line | None, Line | None, Line | None, Line | None]:
        """Load cell, MCP, PIP and current monitor: the order of a device's raw values."""
        return self.force, self.mcp, self.pip, self.current

    @property
    def radians_per_count(self) -> float:
        """Pulley angle of one encoder count, rad."""
        return 2.0 * math.pi / self.counts_per_turn


class Zeros:
    """What initialising and taring have set: offsets that are added to the calibrated values, SI."""

    def __init__(self) -> None:
        self.position = self.mcp = self.pip = self.force = 0.0


def _line(channel: AnalogInput) -> Line | None:
    """The sensor's line; None where the bench has no such sensor."""
    if not channel.terminal:
        return None
    # At the very end of the card's range nothing is measured any more.
    low = max(channel.valid_low, 0.999 * channel.low if channel.low < 0 else channel.low)
    high = min(channel.valid_high, 0.999 * channel.high)
    return Line(channel.sign * channel.gain, channel.sign * channel.offset, low, high)


SPEED_CUTOFF_HZ = 60.0
"""Corner of the speed's low-pass (assumed): an encoder count is then a quarter of a rad/s."""


class Reader:
    """Converts samples; keeps the references, the speed filter and the count of samples.

    Attributes:
        index: of the last sample, counted on over restarts of the device.
        zeros: references set by initialising and taring.
    """

    def __init__(self, units: BenchUnits, period: float, clock: Callable[[], float] | None) -> None:
        self.zeros = Zeros()
        self.index = -1
        self._units, self._period, self._clock = units, period, clock
        self._share = 1.0 - math.exp(-2.0 * math.pi * SPEED_CUTOFF_HZ * period)
        self._radians = units.radians_per_count
        self._base = 0
        self._position = math.nan
        self._speed = 0.0
        self._fresh, self._counted_on = True, False
        self._then = clock() if clock else 0.0
        self.reading = Reading()

    def restarted(self, counted_on: bool) -> None:
        """The device counts samples anew; the time that this took is a gap in the samples.

        Args:
            counted_on: the encoder was counted meanwhile; else it is taken to stand where it was.
        """
        gap = round((self._clock() - self._then) / self._period) if self._clock else 0
        self._base = self.index + 1 + max(gap - 1, 0)
        self._fresh, self._counted_on = True, counted_on

    def forget_speed(self) -> None:
        """The position has a new reference, which is no motion."""
        self._position = math.nan

    def read(self, sample: Sample, reference: float, commanded: float = math.nan) -> Reading:
        """The reading of a sample; the same object each time."""
        reading, units, zeros = self.reading, self._units, self.zeros
        index = self._base + sample.index
        lost = index - self.index - 1
        if self._fresh:  # before the first sample, or in a restart's gap, no cycle was lost
            self._fresh = False
            lost = 0
            if self._position == self._position and not self._counted_on:
                zeros.position = self._position - sample.raw[4] * self._radians
        reading.lost, reading.index, self.index = max(lost, 0), index, index
        reading.raw, reading.lines = sample.raw, sample.lines
        force, mcp, pip, current, counts = sample.raw
        reading.force = _quantity(units.force, force) + zeros.force
        reading.mcp = _quantity(units.mcp, mcp) + zeros.mcp
        reading.pip = _quantity(units.pip, pip) + zeros.pip
        reading.current = _quantity(units.current, current)
        reading.torque = units.torque_per_amp * reading.current
        reading.tension = reading.torque / units.pulley_radius
        reading.position = counts * self._radians + zeros.position
        self._derive(reading)
        self._time(reading, sample)
        reading.reference, reading.commanded = reference, commanded
        return reading

    def _derive(self, reading: Reading) -> None:
        step = (reading.position - self._position) / (self._period * (1 + reading.lost))
        if step == step:
            self._speed += self._share * (step - self._speed)
        else:  # no position before, or none now
            self._speed = 0.0
        self._position = reading.position
        reading.speed = self._speed

    def _time(self, reading: Reading, sample: Sample) -> None:
        if self._clock is None:
            reading.cycle_time = self._period * (1 + reading.lost)
        else:
            now = self._clock()
            reading.cycle_time, self._then = now - self._then, now
        late = sample.lateness
        if late != late:  # the device cannot tell: judge by the measured cycle
            late = max(reading.cycle_time - self._period, 0.0)
        reading.lateness = late


def _quantity(line: Line | None, volts: float) -> float:
    return math.nan if line is None else line.gain * volts + line.offset

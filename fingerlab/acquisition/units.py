"""Volts and counts to SI units and back, with the references that the operator sets."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import AnalogInput


@dataclass(frozen=True)
class Line:
    """quantity = gain * volts + offset, in SI units."""

    gain: float
    offset: float = 0.0


@dataclass(frozen=True)
class BenchUnits:
    """How raw values become units. A line that is None stands for a channel that the bench lacks.

    Attributes:
        force: N. mcp, pip: rad, flexion positive. current: A.
        counts_per_turn: encoder counts a turn of the gearbox output; negative where it counts backwards.
        amps_per_volt: current set value, A/V; negative where the motor turns backwards.
        low_volts, high_volts: range of the set value, V.
        torque_per_amp: N m/A at the gearbox output. pulley_radius: m.
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
        )

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
    return Line(channel.sign * channel.gain, channel.sign * channel.offset) if channel.terminal else None

"""What an operator does in a calibration, step by step: which weight or mark, in which pass, in words."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from fingerlab.calibration.sensors import Sensor
from fingerlab.core.errors import UserError

LOADING, UNLOADING = "loading", "unloading"
FIRST, SECOND = "first pass", "second pass"
ANGLE_MARK_DEG = 15.0
"""Distance of the marks on the sheet; the thesis says "notable angles" and no more: assumed."""


@dataclass(frozen=True)
class Move:
    """One step that an operator makes.

    Attributes:
        sweep: which pass it belongs to. mark: known value in the sensor's ``mark_unit``.
        words: what to do now.
    """

    sweep: str
    mark: float
    words: str


@dataclass(frozen=True)
class Plan:
    """All steps of one sensor in their order."""

    sensor: Sensor
    moves: tuple[Move, ...]

    def __post_init__(self) -> None:
        if len({move.mark for move in self.moves}) < 3:
            raise UserError("A calibration needs steps at three different known values or more.")

    @property
    def marks(self) -> tuple[float, ...]:
        """Known value of each step, ``mark_unit``."""
        return tuple(move.mark for move in self.moves)

    @property
    def spacing(self) -> float:
        """Smallest distance between neighbouring marks, ``mark_unit``."""
        marks = sorted(set(self.marks))
        return min(b - a for a, b in pairwise(marks))

    @property
    def spacing_volts(self) -> float:
        """What the data sheet lets the reading change by from one mark to the next, V, at the least."""
        return self.spacing * self.sensor.mark_factor / self.sensor.gain.high


def standard_plan(sensor: Sensor) -> Plan:
    """The procedure of thesis section 2.2.

    Load cell: 0 to 1 kg in steps of 100 g; and back, so that hysteresis shows (the thesis only loads).
    Angle sensors: marks from 0 to 90 degrees, twice.
    """
    return _load_cell_plan(sensor) if sensor.mark_unit == "kg" else _angle_plan(sensor)


def mark_text(sensor: Sensor, mark: float) -> str:
    """A known value as a person says it: ``300 g``, ``45°``."""
    return f"{1000 * mark:.0f} g" if sensor.mark_unit == "kg" else f"{mark:g}°"


def _load_cell_plan(sensor: Sensor) -> Plan:
    moves = [Move(LOADING, 0.0, "Take every weight off the load cell and let go of the plate.")]
    for step in range(1, 11):
        moves.append(Move(LOADING, step / 10, f"Add a 100 g weight, so that {100 * step} g lie on the cell."))
    for step in range(9, 0, -1):
        words = f"Take a 100 g weight off, so that {100 * step} g are left."
        moves.append(Move(UNLOADING, step / 10, words))
    moves.append(Move(UNLOADING, 0.0, "Take the last weight off, so that nothing is left on the cell."))
    return Plan(sensor, tuple(moves))


def _angle_plan(sensor: Sensor) -> Plan:
    joint = sensor.name.upper()
    moves = []
    for sweep in (FIRST, SECOND):
        for number in range(7):
            mark = ANGLE_MARK_DEG * number
            words = f"Flex the {joint} joint to the {mark:g}° mark on the sheet and hold it there."
            if number == 0:
                again = "back " if sweep == SECOND else ""
                words = f"Put the {joint} joint {again}on the centre of the circle, straight at the 0° mark."
            moves.append(Move(sweep, mark, words))
    return Plan(sensor, tuple(moves))

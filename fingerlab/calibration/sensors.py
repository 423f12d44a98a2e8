"""The three analogue sensors: what data sheets and thesis say of them, what an operator does with each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from fingerlab.core.errors import UserError
from fingerlab.core.text import DEGREES, RAD_IN_DEGREE, ScreenUnit

GRAVITY = 9.81
"""m/s^2; the thesis' value, which turns the known masses into forces."""

_FC2231_RANGE = 44.5
_FC2231_SPAN = (3.8, 4.0, 4.2)
_KMA210_ANGLE = math.pi
_KMA210_SPAN = (0.95 - 0.05) * 5.0


@dataclass(frozen=True)
class Limit:
    """A range that the data sheet allows; NaN where there is no bound."""

    quantity: str
    unit: str
    low: float
    high: float
    source: str


@dataclass(frozen=True)
class Sensor:
    """A sensor whose output is a straight line: quantity = gain * volts + offset.

    Attributes:
        name: word of the command line.
        title: type of sensor.
        unit: SI unit of the quantity.
        mark_unit: unit in which a person states the known values.
        mark_factor: known value in SI = mark_factor * mark.
        gain: what the data sheet allows of the magnitude of the gain, ``unit``/V.
        zero: what it allows of the volts at zero, or None where the zero is free.
        volts: readings that it can give, V.
        accuracy: largest error that it allows, ``unit``.
        published: the thesis' line (gain in ``unit``/V, offset in ``unit``), or None.
        column_words: names under which its volts are looked for.
    """

    name: str
    title: str
    unit: str
    mark_unit: str
    mark_factor: float
    gain: Limit
    zero: Limit | None
    volts: Limit
    accuracy: Limit
    published: tuple[float, float] | None
    column_words: tuple[str, ...]

    @property
    def screen(self) -> ScreenUnit:
        """The unit in which a person reads the quantity."""
        return ScreenUnit("°", DEGREES) if self.unit == "rad" else ScreenUnit(self.unit, 1.0)

    def default_marks(self, steps: int) -> tuple[float, ...]:
        """The known values where none are given, in ``mark_unit``, for a recording of ``steps`` steps.

        Load cell: 0 to 1 kg in 100 g, as in the thesis. Angle sensors: 0 to 90 degrees, evenly; the
        thesis says "notable angles" and no more, so that this is assumed.
        """
        if self.mark_unit == "kg":
            return tuple(step / 10 for step in range(11))
        return tuple(90.0 * step / (steps - 1) for step in range(steps)) if steps > 1 else (0.0,)


def _load_cell() -> Sensor:
    sheet = "TE Connectivity FC2231 data sheet, thesis table 2.1"
    return Sensor(
        name="load-cell",
        title="load cell FC2231",
        unit="N",
        mark_unit="kg",
        mark_factor=GRAVITY,
        gain=Limit("gain", "N/V", _FC2231_RANGE / _FC2231_SPAN[2], _FC2231_RANGE / _FC2231_SPAN[0], sheet),
        zero=Limit("reading at no load", "V", 0.45, 0.55, sheet),
        volts=Limit("reading", "V", 0.0, 5.0, "5 V supply"),
        accuracy=Limit("residual", "N", -0.01 * _FC2231_RANGE, 0.01 * _FC2231_RANGE, f"{sheet}: 1 % of span"),
        published=(11.194, -5.317),
        column_words=("load_cell", "load cell", "loadcell", "force"),
    )


def _angle(name: str) -> Sensor:
    sheet = "NXP KMA210 data sheet, thesis table 2.2"
    nominal = _KMA210_ANGLE / _KMA210_SPAN
    error = math.radians(1.1)
    return Sensor(
        name=name,
        title=f"angle sensor KMA210, {name.upper()} joint",
        unit="rad",
        mark_unit="deg",
        mark_factor=RAD_IN_DEGREE,
        # 180 degrees over 5 to 95 % of a supply of 4.5 to 5.5 V, to which the output is proportional.
        gain=Limit("gain", "rad/V", nominal * 5.0 / 5.5, nominal * 5.0 / 4.5, sheet),
        zero=None,
        volts=Limit("reading", "V", 0.05 * 5.0, 0.95 * 5.0, f"{sheet}: 5 to 95 % of 5 V"),
        accuracy=Limit("residual", "rad", -error, error, f"{sheet}: angular error"),
        published=None,
        column_words=(name,),
    )


SENSORS: Mapping[str, Sensor] = {
    sensor.name: sensor for sensor in (_load_cell(), _angle("mcp"), _angle("pip"))
}
"""The bench's sensors by their word on the command line."""


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
        at_rest: the sensor stands so before anybody touches it, as a load cell with nothing on it.
    """

    sweep: str
    mark: float
    words: str
    at_rest: bool = False


@dataclass(frozen=True)
class CalibrationPlan:
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


def standard_plan(sensor: Sensor) -> CalibrationPlan:
    """The procedure of thesis section 2.2.

    Load cell: 0 to 1 kg in steps of 100 g; and back, so that hysteresis shows (the thesis only loads).
    Angle sensors: marks from 0 to 90 degrees, twice.
    """
    return _load_cell_plan(sensor) if sensor.mark_unit == "kg" else _angle_plan(sensor)


def own_plan(sensor: Sensor, marks: Sequence[float]) -> CalibrationPlan:
    """The procedure with an operator's own weights (kg) or angle marks (deg), in both passes.

    Raises:
        UserError: too few, one twice or beyond what the sensor can be given.
    """
    most = 20.0 if sensor.mark_unit == "kg" else 180.0
    least = (
        4 if sensor.mark_unit == "kg" else 3
    )  # each pass is a line of its own, and the way back has one less
    if len(set(marks)) < max(len(marks), least):
        raise UserError(f"The {sensor.title} needs {least} different known values or more, each once.")
    if not all(math.isfinite(mark) and abs(mark) <= most for mark in marks) or (
        sensor.mark_unit == "kg" and min(marks) < 0
    ):
        lowest = 0.0 if sensor.mark_unit == "kg" else -most
        raise UserError(
            "A known value is beyond what can be set; give some from "
            f"{mark_text(sensor, lowest)} to {mark_text(sensor, most)}."
        )
    if sensor.mark_unit == "kg":
        up = sorted(marks)
        moves = [Move(LOADING, mark, _lay(mark), at_rest=mark == 0) for mark in up]
        moves += [Move(UNLOADING, mark, _lay(mark)) for mark in reversed(up[:-1])]
    else:
        words = f"Flex the {sensor.name.upper()} joint to {{}}° and hold it there."
        moves = [Move(sweep, mark, words.format(f"{mark:g}")) for sweep in (FIRST, SECOND) for mark in marks]
    return CalibrationPlan(sensor, tuple(moves))


def _lay(mark: float) -> str:
    if mark == 0:
        return "Take every weight off the load cell and let go of the plate."
    return f"Lay weights of {1000 * mark:g} g in all on the load cell."


def read_marks(sensor: Sensor, text: str) -> tuple[float, ...]:
    """Known values from what an operator has typed, in g or degrees; ``mark_unit``.

    A comma stands between values, or before the decimals where semicolons or spaces part them.

    Raises:
        UserError: one is no number.
    """
    parts = [part.rstrip(",") for part in text.replace(";", " ").split()]
    if len(parts) == 1:
        parts = parts[0].split(",")
    try:
        values = [float(part.replace(",", ".")) for part in parts if part]
    except ValueError:
        raise UserError(f"{text!r} is no list of known values; give numbers such as 0 15 30 45.") from None
    return tuple(value / 1000.0 if sensor.mark_unit == "kg" else value for value in values)


def mark_text(sensor: Sensor, mark: float) -> str:
    """A known value as a person says it: ``300 g``, ``45°``."""
    return f"{1000 * mark:g} g" if sensor.mark_unit == "kg" else f"{mark:g}°"


def _load_cell_plan(sensor: Sensor) -> CalibrationPlan:
    moves = [Move(LOADING, 0.0, _lay(0.0), at_rest=True)]
    for step in range(1, 11):
        moves.append(Move(LOADING, step / 10, f"Add a 100 g weight, so that {100 * step} g lie on the cell."))
    for step in range(9, 0, -1):
        words = f"Take a 100 g weight off, so that {100 * step} g are left."
        moves.append(Move(UNLOADING, step / 10, words))
    moves.append(Move(UNLOADING, 0.0, "Take the last weight off, so that nothing is left on the cell."))
    return CalibrationPlan(sensor, tuple(moves))


def _angle_plan(sensor: Sensor) -> CalibrationPlan:
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
    return CalibrationPlan(sensor, tuple(moves))

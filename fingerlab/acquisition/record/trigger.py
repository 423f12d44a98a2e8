"""A level that a quantity crosses: there a picture or a recording begins."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.acquisition.ring import COLUMN, UNITS, Array, RingReader
from fingerlab.core.errors import UserError

TRIGGER_HELP = "such as 'endpoint_force>0.5', 'motor_position<-10deg' or 'motor_speed>90deg/s'"

_WRITTEN = re.compile(r"\s*([a-z_/]+)\s*([<>])\s*([-+0-9.eE]+)\s*(deg|deg/s)?\s*")


@dataclass(frozen=True)
class Level:
    """``level`` of a column of the ring, in its unit (SI), crossed upwards (``rising``) or downwards."""

    column: str
    level: float
    rising: bool = True

    @property
    def words(self) -> str:
        """As an operator reads it."""
        unit, level = UNITS[self.column], self.level
        if unit.startswith("rad"):
            unit, level = unit.replace("rad", "°"), math.degrees(level)
        way = "above" if self.rising else "below"
        return f"{self.column.replace('_', ' ')} {way} {level:g} {unit}"


def read_level(text: str) -> Level:
    """A level as it is written on the command line.

    Raises:
        UserError: it names no quantity, no number, or the wrong unit.
    """
    told = _WRITTEN.fullmatch(text)
    known = [name for name, unit in UNITS.items() if unit]
    if told is None or told[1] not in known:
        raise UserError(
            f"The trigger is {text!r}; it should be {TRIGGER_HELP}, of one of {', '.join(known)}."
        )
    column, way, number, unit = told.groups()
    try:
        level = float(number)
    except ValueError:
        raise UserError(f"The trigger {text!r} has no number; it should be {TRIGGER_HELP}.") from None
    if unit:
        if unit != UNITS[column].replace("rad", "deg"):
            raise UserError(f"The trigger {text!r} is in {unit}; {column} is in {UNITS[column]}.")
        level = math.radians(level)
    return Level(column, level, way == ">")


def crossings(values: Array, level: float, rising: bool) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Positions in ``values``, shape (n,), of the first samples beyond the level after one before it."""
    beyond = values >= level if rising else values <= level
    known = np.isfinite(values)
    return np.flatnonzero(beyond[1:] & ~beyond[:-1] & known[:-1]) + 1


class Lookout:
    """Looks through the ring for the first crossing at or after a sample."""

    def __init__(self, reader: RingReader, level: Level, start: int) -> None:
        self._reader, self._level, self._start = reader, level, start
        self._before = math.nan

    def look(self) -> int | None:
        """Index of the sample that crossed, as soon as it is there."""
        while True:
            rows = self._reader.read().rows
            rows = rows[rows[:, COLUMN["index"]] >= self._start]
            if not len(rows):
                return None
            values = np.concatenate(([self._before], rows[:, COLUMN[self._level.column]]))
            self._before = float(values[-1])
            found = crossings(values, self._level.level, self._level.rising)
            if len(found):
                return int(rows[found[0] - 1, COLUMN["index"]])

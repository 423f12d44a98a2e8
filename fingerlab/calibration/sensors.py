"""What the data sheets and the thesis say of the bench's three analogue sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

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
        mark_factor=math.pi / 180.0,
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

"""Units: one table of what they are in SI, and a value that carries its unit and its interval."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

DEGREE = math.pi / 180.0
"""rad."""

FACTORS: Mapping[str, Mapping[str, float]] = {
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "°": DEGREE, "degrees": DEGREE,
            "rev": 2 * math.pi, "turn": 2 * math.pi, "turns": 2 * math.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": DEGREE},
    "rad/V": {"rad/V": 1.0, "deg/V": DEGREE},
    "A": {"A": 1.0, "mA": 1e-3},
    "A/V": {"A/V": 1.0, "mA/V": 1e-3},
    "V": {"V": 1.0, "v": 1.0, "volt": 1.0, "volts": 1.0, "mV": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "N m": {"N m": 1.0, "Nm": 1.0, "N·m": 1.0, "N*m": 1.0, "mNm": 1e-3, "mN m": 1e-3, "N mm": 1e-3,
            "Nmm": 1e-3, "N cm": 1e-2, "Ncm": 1e-2, "kN m": 1e3, "kNm": 1e3},
    "N m/A": {"N m/A": 1.0, "mN m/A": 1e-3},
    "N m/rad": {"N m/rad": 1.0, "mN m/rad": 1e-3, "N mm/rad": 1e-3, "N m/deg": 180.0 / math.pi},
    "kg": {"kg": 1.0, "g": 1e-3},
    "kg m^2": {"kg m^2": 1.0, "g cm^2": 1e-7, "g mm^2": 1e-9},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}  # fmt: skip
"""SI unit -> unit that a file of a person may hold -> factor to SI."""

_SPELLINGS = {"N m": {"Nm", "N.m", "N*m", "N·m"}, "rad": {"radian", "radians"}}


def factor(unit: str, si: str) -> float | None:
    """What values in ``unit`` are multiplied by to be in the SI unit ``si``; None where they cannot be."""
    return 1.0 if unit == si else FACTORS.get(si, {}).get(unit)


def same_unit(found: str, wanted: str) -> bool:
    """Whether two spellings mean the same unit (``Nm`` and ``N m``), without any conversion."""
    return found.strip() == wanted or found.strip() in _SPELLINGS.get(wanted, ())


@dataclass(frozen=True)
class ParameterEstimate:
    """A value with its 90 % interval ``low`` to ``high``, all in ``unit``."""

    value: float
    unit: str
    low: float
    high: float

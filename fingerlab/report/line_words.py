"""A linear axis in its own units: what the diagnosis tells of the arc, as masses, forces and lengths.

A session of such an axis holds angles and torques about a radius (``docs/file-format.md``). Sentences
that the diagnosis itself makes of single effects keep these; :func:`arc_sentence` says what they mean.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

from fingerlab.core.text import RAD_IN_DEGREE, ParameterEstimate
from fingerlab.diagnosis.answer.results import EquationError

_UNITS = {
    "kg m^2": ("kg", -2), "N m": ("N", -1), "N m s/rad": ("N s/m", -2), "N m/rad": ("N/m", -2),
    "rad": ("m", 1), "rad/s": ("m/s", 1),
}  # fmt: skip
"""Of an arc: the unit along the line, and the power of the radius (m) that a number is multiplied by."""

_WORDS = (
    ("inertia J", "mass"),
    ("Inertia J", "Mass"),
    ("torque at the gearbox output", "force"),
    ("torque", "force"),
)
"""In titles of parameters: what stands for an angular quantity."""


def arc_sentence(radius: float) -> str:
    """What angles and torques mean where the axis is a linear one; empty where it is not.

    Args:
        radius: ``Rig.line_radius``, m; so in all functions here.
    """
    if not radius:
        return ""
    return (
        f"The axis is linear, told as an arc of {1e3 * radius:g} mm: 1 N m is {1.0 / radius:g} N, "
        f"1 deg is {1e3 * math.radians(radius):.3g} mm and 1 N m s/rad is {1.0 / radius**2:g} N s/m. "
        "What is said of single effects and of the bench is told so."
    )


def along_the_line(estimate: ParameterEstimate, radius: float) -> ParameterEstimate:
    """An estimate in the unit that it has along the line; as it is where the axis turns."""
    value, low, high, unit = estimate.value, estimate.low, estimate.high, estimate.unit
    if unit == "deg" or unit.startswith("deg/"):
        unit = f"rad{unit.removeprefix('deg')}"
        value, low, high = (RAD_IN_DEGREE * v for v in (value, low, high))
    if not radius or unit not in _UNITS:
        return estimate
    linear, power = _UNITS[unit]
    times = radius**power
    return ParameterEstimate(value * times, linear, low * times, high * times)


def error_along_the_line(error: EquationError, radius: float) -> EquationError:
    """An error of the torque as one of the force; as it is where the axis turns."""
    if not radius or error.unit != "N m":
        return error
    numbers = {name: getattr(error, name) / radius for name in ("rmse", "floor", "rubbing", "seen")}
    return replace(error, unit="N", **numbers)


def title_along_the_line(title: str, radius: float) -> str:
    """A parameter's title with mass and force in place of inertia and torque."""
    for angular, linear in _WORDS if radius else ():
        title = re.sub(rf"\b{angular}\b", linear, title)
    return title

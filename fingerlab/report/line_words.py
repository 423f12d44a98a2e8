"""A linear axis in its own units: what the diagnosis tells of the arc, as masses, forces and lengths.

The units themselves are in ``line_units.py``; here they are for a single number, with the words of the arc.
"""

from __future__ import annotations

import math

from fingerlab.core.text import ParameterEstimate
from fingerlab.report.line_units import LineUnits


def arc_sentence(radius: float) -> str:
    """What angles and torques mean where the axis is a linear one; empty where it is not.

    Args:
        radius: ``Rig.line_radius``, m; so in all functions here.
    """
    if not radius:
        return ""
    return (
        f"The axis is linear, kept as an arc of {1e3 * radius:g} mm: 1 N m is {1.0 / radius:g} N, "
        f"1 deg is {1e3 * math.radians(radius):.3g} mm and 1 N m s/rad is {1.0 / radius**2:g} N s/m. "
        "Equations, drafted laws and JSON are told so."
    )


def along_the_line(estimate: ParameterEstimate, radius: float) -> ParameterEstimate:
    """An estimate in the unit that it has along the line; as it is where the axis turns."""
    return LineUnits(radius).estimate(estimate)


def title_along_the_line(title: str, radius: float) -> str:
    """A parameter's title with mass and force in place of inertia and torque."""
    return LineUnits(radius).title(title)

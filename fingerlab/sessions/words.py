"""A session in words, as a person reads it on the screen: degrees and seconds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

POINTS = ("time_s", "angle_deg", "torque_n_m")
"""Lists of points say nothing in a line; what they span is told."""


def trajectory_words(trajectory: Mapping[str, Any]) -> str:
    """What the motor was told to do, such as ``sine, 15°, 1 Hz, about 22°``."""
    rest = dict(trajectory)
    kind = str(rest.pop("kind", "unknown"))
    for points in POINTS:
        rest.pop(points, None)
    words = kind.replace("_", " ")
    amplitude = rest.pop("amplitude_deg", None)
    if amplitude is not None:
        words += f", {_number(amplitude)}°"
    frequency = rest.pop("frequency_hz", None)
    if frequency is not None:
        words += f", {_number(frequency)} Hz"
    offset = rest.pop("offset_deg", None)
    if offset is not None:
        words += f", about {_number(offset)}°"
    middle, half = rest.pop("offset_n_m", None), rest.pop("amplitude_n_m", None)
    if isinstance(middle, int | float) and isinstance(half, int | float):
        words += f", {_number(1e3 * (middle - half))} to {_number(1e3 * (middle + half))} mN m"
    wanted = rest.pop("wanted_force", None)
    if isinstance(wanted, Mapping):
        words += f", for a wanted force ({', '.join(f'{k} {_number(v)}' for k, v in wanted.items())})"
    for key, value in rest.items():
        words += f", {_named(key, value)}"
    return words


UNITS = {"_s": " s", "_hz": " Hz", "_deg": "°", "_n": " N"}
"""What the end of a number's name says of its unit."""
MOST_NUMBERS = 6
"""So many numbers of a list are told one by one."""


def _named(key: str, value: Any) -> str:
    """``duration 20 s`` for ``duration_s`` and 20; ``frequencies 1, 2 Hz`` for a few."""
    values = value if isinstance(value, list | tuple) else [value]
    numbers = bool(values) and all(isinstance(one, int | float) for one in values)
    end = next((e for e in UNITS if numbers and key.endswith(e)), "")
    shown = ", ".join(map(_number, values)) if numbers and len(values) <= MOST_NUMBERS else _number(value)
    return f"{key.removesuffix(end).replace('_', ' ')} {shown}{UNITS.get(end, '')}"


def _number(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        text = str(value)
        return text if len(text) <= 40 else text[:37] + "..."
    return f"{value:.4g}"

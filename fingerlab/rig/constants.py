"""What the bench knows of itself: constants, their tolerances, and where they come from.

A session file carries the rig as JSON text (``session-format.md``); all values are SI.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import Mismatch, read_object, structured
from fingerlab.rig.daq import Daq, Limits, read_daq, read_limits

T = TypeVar("T")

LARGEST, SMALLEST = 1e9, 1e-9
"""SI; what lies beyond is no constant of a bench, and its products no numbers."""
DIVISORS = ("torque_constant", "gear_ratio", "pulley_radius")
"""Constants that are divided by."""

DEFAULT_TOLERANCE = 0.02
"""Relative tolerance of a rig constant that the file says nothing about (session format, version 1)."""


@dataclass(frozen=True)
class Finger:
    """The printed finger. Lengths are half lengths; inertias are about the centres of mass."""

    proximal_mass: float  # m1, kg
    distal_mass: float  # m2, kg
    proximal_half_length: float  # l1, m
    distal_half_length: float  # l2, m
    proximal_inertia: float  # I1, kg m^2
    distal_inertia: float  # I2, kg m^2
    mcp_stiffness: float  # K_MCP, N m/rad
    pip_stiffness: float  # K_PIP, N m/rad
    wrist_angle: float = math.radians(15.0)  # alpha, rad; thesis section 3.1
    gravity: float = 9.81  # m/s^2


@dataclass(frozen=True)
class Motor:
    """Motor, gearbox and pulley; every number at the gearbox output except the torque constant."""

    torque_constant: float = 0.0302  # kt, N m/A; Maxon RE40 148867
    gear_ratio: float = 4.3  # N; Maxon GP 42C 203144
    pulley_radius: float | None = None  # r, m
    inertia: float | None = None  # J of rotor, gearbox and pulley at the output, kg m^2


@dataclass(frozen=True)
class Rig:
    """Bench constants. ``finger`` is None where a session was taken without one."""

    finger: Finger | None
    motor: Motor
    tolerance: dict[str, float] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)  # keys of later versions, kept as they are

    def tolerance_of(self, name: str) -> float:
        """Relative tolerance (one standard deviation, unitless) of the constant ``name``."""
        return float(self.tolerance.get(name, DEFAULT_TOLERANCE))

    @property
    def daq(self) -> Daq:
        """Terminals, scaling and signs of the bench's channels.

        Raises:
            UserError: the rig holds an impossible one.
        """
        return read_daq(self.extra.get("daq", {}), "The rig, [daq]")

    @property
    def limits(self) -> Limits:
        """What the control loop keeps within, SI.

        Raises:
            UserError: the rig holds an impossible one.
        """
        return read_limits(self.extra.get("limits", {}), "The rig, [limits]")

    def to_json(self) -> str:
        """The JSON text of ``session-format.md``, unknown keys included."""
        data: dict[str, Any] = dict(self.extra)
        if self.finger is not None:
            data["finger"] = asdict(self.finger)
        data["motor"] = {name: value for name, value in asdict(self.motor).items() if value is not None}
        if self.tolerance:
            data["tolerance"] = dict(self.tolerance)
        return json.dumps(data)

    @classmethod
    def from_json(cls, text: str, where: str = "the rig text") -> Rig:
        """Read the rig from JSON text.

        Raises:
            UserError: the text is not JSON, a number is missing or is not a finite number.
        """
        data = read_object(text, where, "it should hold 'finger', 'motor' and 'tolerance'")
        finger_data = data.get("finger")
        finger = _constants(Finger, finger_data, f"{where}, 'finger'") if finger_data else None
        motor = _constants(Motor, data.get("motor") or {}, f"{where}, 'motor'")
        tolerance = data.get("tolerance") or {}
        if not isinstance(tolerance, dict):
            raise UserError(
                f"{where}, 'tolerance' is not an object of relative tolerances by parameter name."
            )
        for name, value in tolerance.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or value < 0:
                raise UserError(
                    f"{where}, 'tolerance' holds '{name}' = {value!r}; it should be a share such as 0.02."
                )
        extra = {k: v for k, v in data.items() if k not in ("finger", "motor", "tolerance")}
        return cls(finger, motor, {k: float(v) for k, v in tolerance.items()}, extra)


def _constants(kind: type[T], data: Any, where: str) -> T:
    """Finger or motor from its numbers; null is as good as absent."""
    if not isinstance(data, Mapping):
        raise UserError(f"{where} is not an object of named numbers.")
    for name, value in data.items():
        size = abs(value) if isinstance(value, (int, float)) else 1.0
        if size > LARGEST or (size < SMALLEST and name in DIVISORS):
            raise UserError(
                f"{where} holds '{name}' = {value!r}; it should be of a size that a bench can have."
            )
    try:
        return structured(kind, {name: value for name, value in data.items() if value is not None})
    except Mismatch as error:
        right = f"holds '{error.place[0]}' = {error.value!r}" if error.wanted else str(error)
        wanted = error.wanted or "a number"
        raise UserError(f"{where} {right}; it should be {wanted} in SI units.") from None

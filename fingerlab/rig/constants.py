"""What the bench knows of itself: constants, tolerances, their sources; and what is changed on purpose.

A session file carries the rig as JSON text (``session-format.md``); all values are SI.

A run tells of its change in the attribute ``intervention``: JSON text of the fields below that are not at
their defaults, SI. The same motion before and after it is a pair: what they have in common cancels.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
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


INTERVENTION = "intervention"
"""The run's attribute."""

UNITS = {
    "added_mass": "kg", "added_mass_at": "m", "load_torque": "N m", "mcp_stiffness": "N m/rad",
    "pip_stiffness": "N m/rad", "mcp_arm": "1", "pip_arm": "1",
}  # fmt: skip
"""Unit of each number of a change."""


@dataclass(frozen=True)
class Intervention:
    """What is known to be otherwise in a run.

    Attributes:
        added_mass: kg, a body without size that is fixed to the distal link, ``added_mass_at`` m beyond the
            PIP axis (at the fingertip: the link's whole length).
        load_torque: N m at the gearbox output that the motor has to hold beside the cable, such as a weight
            on a thread round the pulley; positive where it pulls against winding.
        mcp_stiffness, pip_stiffness: N m/rad, of a spring added beside the joint's own, at rest where the
            joint is straight; negative: as much of it taken away.
        mcp_arm, pip_arm: times the moment arm that the cable has otherwise, of a guide of another size.
    """

    added_mass: float = 0.0
    added_mass_at: float = 0.0
    load_torque: float = 0.0
    mcp_stiffness: float = 0.0
    pip_stiffness: float = 0.0
    mcp_arm: float = 1.0
    pip_arm: float = 1.0

    @property
    def rerouted(self) -> bool:
        """Whether the cable has other moment arms."""
        return (self.mcp_arm, self.pip_arm) != (1.0, 1.0)

    def to_json(self) -> dict[str, float]:
        """The fields that are not at their defaults."""
        return {f.name: v for f in fields(self) if (v := getattr(self, f.name)) != f.default}

    def attributes(self) -> dict[str, str]:
        """The run's attribute, to be stored beside its others; none where nothing is changed."""
        told = self.to_json()
        return {INTERVENTION: json.dumps(told)} if told else {}

    def scaled(self, units: Mapping[str, float], way: int = 1) -> Intervention:
        """Each number times what its unit counts for, or divided by it (``way`` -1)."""
        return replace(
            self, **{name: value * units[UNITS[name]] ** way for name, value in asdict(self).items()}
        )

    def words(self) -> str:
        """What the operator changes, such as ``with 13 g fixed to the finger 48 mm beyond the PIP axis``."""
        told = []
        if self.added_mass:
            place = f"{1e3 * self.added_mass_at:.3g} mm beyond the PIP axis"
            told.append(f"{1e3 * self.added_mass:.3g} g fixed to the finger {place}")
        if self.load_torque:
            told.append(f"a known load of {1e3 * self.load_torque:.3g} mN m on the pulley beside the cable")
        for joint, stiffness in (("MCP", self.mcp_stiffness), ("PIP", self.pip_stiffness)):
            if stiffness:
                what = "a spring added" if stiffness > 0 else "a spring taken away"
                told.append(f"{what} at the {joint} joint, {1e3 * abs(stiffness):.3g} mN m/rad")
        for joint, ratio in (("MCP", self.mcp_arm), ("PIP", self.pip_arm)):
            if ratio != 1.0:
                told.append(f"the cable guided round the {joint} joint at {ratio:.3g} times its moment arm")
        return "with " + " and ".join(told) if told else ""


UNCHANGED = Intervention()


def read_intervention(told: object, where: str) -> Intervention:
    """A change from its JSON text or object.

    Raises:
        UserError: it is no object of known names and finite numbers, or impossible.
    """
    known = ", ".join(UNITS)
    data: Any = told
    if isinstance(told, str):
        data = read_object(told, where, f"it should hold some of {known}")
    if not isinstance(data, Mapping):
        raise UserError(f"{where} is not an object of numbers; it should hold some of {known}.")
    for name, value in data.items():
        if name not in UNITS:
            raise UserError(f"{where} holds '{name}'; it should be one of {known}.")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not -LARGEST <= value <= LARGEST:
            raise UserError(f"{where} holds '{name}' = {value!r}; it should be a number in {UNITS[name]}.")
        if name in ("added_mass", "mcp_arm", "pip_arm") and (
            value < 0 or (name != "added_mass" and not value)
        ):
            raise UserError(f"{where} holds '{name}' = {value!r}; it should be positive.")
    return Intervention(**{name: float(value) for name, value in data.items()})


def changed_words(attributes: Mapping[str, Any]) -> str:
    """The change that the attributes of a run tell, in words; empty where there is none that can be read."""
    try:
        change = intervention_of(attributes, "")
    except UserError:
        return ""
    return "" if change is None else change.words()


def intervention_of(attributes: Mapping[str, Any], run: str) -> Intervention | None:
    """The change that the ``attributes`` of a run tell; None: they tell of none.

    Raises:
        UserError: they tell of one that cannot be read.
    """
    told = attributes.get(INTERVENTION)
    return None if told is None else read_intervention(told, f"Run {run}, attribute '{INTERVENTION}',")

"""What the bench knows of itself: constants, tolerances, their sources, changes; and the TOML file of it.

A session file carries the rig as JSON text (``docs/file-format.md``); all values are SI.

A run tells of its change in the attribute ``intervention``: JSON text of the fields below that are not at
their defaults, SI. The same motion before and after it is a pair: what they have in common cancels.

Sections ``[finger]`` and ``[motor]`` hold the constants of :class:`fingerlab.rig.file.Finger` and
:class:`fingerlab.rig.file.Motor`, each a number in SI or a table ``{ value, unit, source, tolerance }``.
Relative tolerances may also stand in a section ``[tolerance]``, as in a session's rig text. Sections
``[daq]`` and ``[limits]`` hold what :class:`fingerlab.rig.daq.Daq` and :class:`fingerlab.rig.limits.Limits`
hold, each value again alone or as a table with unit and source.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import Mismatch, is_number, read_object, structured
from fingerlab.core.text import amount, factor
from fingerlab.rig.daq import CHANNEL_UNITS, SOURCES, Daq, plain_section, read_daq
from fingerlab.rig.limits import LIMIT_UNITS, Limits, read_limits

T = TypeVar("T")

LARGEST, SMALLEST = 1e9, 1e-9
"""SI; what lies beyond is no constant of a bench, and its products no numbers."""
UNTOLD = "not_told"
"""Key of a rig that was made for the log of a strange machine: constants whose numbers stand for nothing."""
LINEAR_AXIS = "axis"
"""Key of a rig that was made for the log of an axis along a line: how that is told as an arc."""
GIVES_TORQUE = ("torque_constant", "gear_ratio")
"""Constants that say together what an ampere gives at the output."""
DIVISORS = ("torque_constant", "gear_ratio", "pulley_radius")
"""Constants that are divided by."""

SECTIONS = ("finger", "motor", "daq", "limits")
"""What a rig file tells of a bench; a file with none of them is no rig file."""
DEFAULT_TOLERANCE = 0.02
"""Relative tolerance of a rig constant that the file says nothing about (session format, version 1)."""
WITHOUT_TOLERANCE = ("gravity", "gear_ratio")
"""Constants that are what they are said to be."""
FITTED_CONSTANTS = (
    "proximal_mass", "distal_mass", "proximal_half_length", "distal_half_length",
    "mcp_stiffness", "pip_stiffness",
)  # fmt: skip
"""Constants of a finger of which a model tells by what share they are off, within their tolerance."""


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

    def tolerance_words(self, name: str) -> str:
        """``± 2 %``; a dash where a constant of nature or a count of teeth has none that anybody gave."""
        if name in WITHOUT_TOLERANCE and name not in self.tolerance:
            return "–"
        return f"± {100 * self.tolerance_of(name):g} %"

    @property
    def ampere(self) -> float:
        """Torque of an ampere at the output, N m/A; 0 of a machine of which nobody said it."""
        if self.untold & set(GIVES_TORQUE):
            return 0.0
        return self.motor.torque_constant * self.motor.gear_ratio

    @property
    def untold(self) -> set[str]:
        """Constants whose numbers stand for nothing, for nobody said them of this machine."""
        names = self.extra.get(UNTOLD)
        return {str(name) for name in names} if isinstance(names, list) else set()

    @property
    def line_radius(self) -> float:
        """Radius of the arc as which an axis along a line is told, m; 0 of one that turns."""
        axis = self.extra.get(LINEAR_AXIS)
        radius = axis.get("radius_m") if isinstance(axis, Mapping) else None
        return float(radius) if isinstance(radius, int | float) and radius > 0 else 0.0

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
        """The JSON text of ``docs/file-format.md``, unknown keys included."""
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

    def to_json(self) -> dict[str, float]:
        """The fields that are not at their defaults."""
        return {f.name: v for f in fields(self) if (v := getattr(self, f.name)) != f.default}

    def attributes(self) -> dict[str, str]:
        """The run's attribute, to be stored beside its others; none where nothing is changed."""
        changes = self.to_json()
        return {INTERVENTION: json.dumps(changes)} if changes else {}

    def scaled(self, units: Mapping[str, float], way: int = 1) -> Intervention:
        """Each number times what its unit counts for, or divided by it (``way`` -1)."""
        return replace(
            self, **{name: value * units[UNITS[name]] ** way for name, value in asdict(self).items()}
        )

    def words(self) -> str:
        """What the operator changes, such as ``with 13 g fixed to the finger 48 mm beyond the PIP axis``."""
        parts = []
        if self.added_mass:
            place = f"{1e3 * self.added_mass_at:.3g} mm beyond the PIP axis"
            parts.append(f"{1e3 * self.added_mass:.3g} g fixed to the finger {place}")
        if self.load_torque:
            parts.append(f"a known load of {amount(self.load_torque, 'N m')} on the pulley beside the cable")
        for joint, stiffness in (("MCP", self.mcp_stiffness), ("PIP", self.pip_stiffness)):
            if stiffness:
                what = "a spring added" if stiffness > 0 else "a spring taken away"
                parts.append(f"{what} at the {joint} joint, {amount(abs(stiffness), 'N m/rad')}")
        for joint, ratio in (("MCP", self.mcp_arm), ("PIP", self.pip_arm)):
            if ratio != 1.0:
                parts.append(f"the cable guided round the {joint} joint at {ratio:.3g} times its moment arm")
        return "with " + " and ".join(parts) if parts else ""


UNCHANGED = Intervention()


def read_intervention(given: object, where: str) -> Intervention:
    """A change from its JSON text or object.

    Raises:
        UserError: it is no object of known names and finite numbers, or impossible.
    """
    known = ", ".join(UNITS)
    data: Any = given
    if isinstance(given, str):
        data = read_object(given, where, f"it should hold some of {known}")
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
    entry = attributes.get(INTERVENTION)
    return None if entry is None else read_intervention(entry, f"Run {run}, attribute '{INTERVENTION}',")


SOURCES_KEY = "sources"
"""Key of the rig text under which the origin of each constant is kept, by its name."""

CONSTANT_UNITS = {
    "proximal_mass": "kg",
    "distal_mass": "kg",
    "proximal_half_length": "m",
    "distal_half_length": "m",
    "proximal_inertia": "kg m^2",
    "distal_inertia": "kg m^2",
    "mcp_stiffness": "N m/rad",
    "pip_stiffness": "N m/rad",
    "wrist_angle": "rad",
    "gravity": "m/s^2",
    "torque_constant": "N m/A",
    "gear_ratio": "",
    "pulley_radius": "m",
    "inertia": "kg m^2",
}
"""SI unit of each constant of the rig; the empty unit is a plain number."""


def default_rig() -> Rig:
    """The finger rig of the thesis; masses, lengths, springs and the pulley radius are assumed."""
    text = resources.files("fingerlab.resources").joinpath("rigs/default.toml").read_text(encoding="utf-8")
    return parse_rig(text, "the default rig")


def load_rig(path: str | Path) -> Rig:
    """Read a rig file.

    Raises:
        UserError: the file is missing, is not TOML, holds no section of a rig, or a constant is missing,
            unknown, in a wrong unit or not a finite number.
    """
    rig = parse_rig(text := read_text(Path(path), "the TOML file of a rig"), str(path))
    if not set(SECTIONS) & set(read_object(text, str(path), "", toml=True)):
        raise UserError(  # else an empty file would pass for a bench without emergency stop and amplifier
            f"{path} says nothing of a rig; it should hold the section [finger] or [motor] of its constants, "
            "or [daq] or [limits], as a copy of the default rig does."
        )
    return rig


def load_axis_rig(path: str | Path) -> Rig:
    """Read the rig file of a machine of one axis: what an ampere gives there is nothing that one assumes.

    Raises:
        UserError: as :func:`load_rig`.
    """
    rig = load_rig(path)
    told = read_object(read_text(Path(path), "the TOML file of a rig"), str(path), "", toml=True)
    motor = told.get("motor") or {}
    untold = [name for name in GIVES_TORQUE if name not in motor]
    return replace(rig, finger=None, extra={**rig.extra, UNTOLD: untold} if untold else rig.extra)


def parse_rig(text: str, where: str) -> Rig:
    """The rig from the text of a rig file; ``where`` opens the sentence of an error.

    Raises:
        UserError: as :func:`load_rig`.
    """
    data = read_object(text, where, "see the default rig for an example", toml=True)
    numbers: dict[str, Any] = {}
    sources = data.pop(SOURCES_KEY, {})
    if not isinstance(sources, dict):
        raise UserError(f"{where}: [{SOURCES_KEY}] is not a section; it should hold texts.")
    tolerance = _tolerances(data.pop("tolerance", {}), where)
    wiring = _wiring(data, where)
    for section, kind in (("finger", Finger), ("motor", Motor)):
        if section not in data:
            continue
        table = data.pop(section)
        if not isinstance(table, Mapping):
            raise UserError(
                f"{where}: [{section}] is not a section; it should hold the {section}'s constants."
            )
        numbers[section] = {}
        for name, entry in table.items():
            if name not in {spec.name for spec in fields(kind)}:
                known = ", ".join(spec.name for spec in fields(kind))
                raise UserError(f"{where}: [{section}] holds the unknown '{name}'; it knows {known}.")
            value, source, relative = _constant(CONSTANT_UNITS[name], entry, f"{where}: [{section}] {name}")
            numbers[section][name] = value
            if source:
                sources[name] = source
            if relative is not None:
                tolerance[name] = relative
    extra = {**data, **wiring, **({SOURCES_KEY: sources} if sources else {})}
    return Rig.from_json(json.dumps({**extra, **numbers, "tolerance": tolerance}), where)


def sources_of(rig: Rig) -> dict[str, str]:
    """Where each constant comes from, by its name, as far as the rig says."""
    sources = rig.extra.get(SOURCES_KEY)
    return {str(k): str(v) for k, v in sources.items()} if isinstance(sources, Mapping) else {}


def _wiring(data: dict[str, Any], where: str) -> dict[str, Any]:
    """Sections ``[daq]`` and ``[limits]``, taken out of ``data``, checked, as plain JSON in SI."""
    result: dict[str, Any] = {}
    if "daq" in data:
        section = f"{where}: [daq]"
        plain = _plain_values(data.pop("daq"), _flat(CHANNEL_UNITS), section)
        result["daq"] = plain_section(read_daq(plain, section))
    if "limits" in data:
        section = f"{where}: [limits]"
        plain = _plain_values(data.pop("limits"), LIMIT_UNITS, section)
        result["limits"] = plain_section(read_limits(plain, section))
    return result


def _flat(units: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    return {f"{channel}.{name}": unit for channel, entries in units.items() for name, unit in entries.items()}


def _plain_values(section: Any, units: Mapping[str, str], where: str) -> Any:
    """A section with its tables of value, unit and source turned into SI values and one list of sources."""
    sources: dict[str, str] = {}

    def plain(entry: Any, name: str) -> Any:
        if not isinstance(entry, Mapping):
            return entry
        if "value" not in entry:
            return {key: plain(value, f"{name}.{key}" if name else key) for key, value in entry.items()}
        if entry.get("source"):
            sources[name] = str(entry["source"])
        if isinstance(entry["value"], str | bool):
            return entry["value"]
        default = "V" if name.endswith((".low", ".high", "_low", "_high")) else ""
        bare = {key: value for key, value in entry.items() if key != "source"}
        return _constant(units.get(name, default), bare, f"{where} {name}")[0]

    result = plain(section, "")
    if isinstance(result, dict) and sources:
        result[SOURCES] = sources
    return result


def _constant(wanted: str, entry: Any, where: str) -> tuple[float, str, float | None]:
    """Value in SI, source and relative tolerance of one entry of a rig file."""
    if not isinstance(entry, Mapping):
        return _number(entry, where), "", None
    unknown = set(entry) - {"value", "unit", "source", "tolerance"}
    if unknown or "value" not in entry:
        raise UserError(f"{where} should be a number or a table of value, unit, source and tolerance.")
    value = _number(entry["value"], where)
    unit = str(entry.get("unit", wanted))
    if unit != wanted:
        times = factor(unit, wanted)
        if times is None:
            raise UserError(f"{where} is in '{unit}'; it should be in '{wanted or 'a plain number'}'.")
        value = float(f"{value * times:.15g}")  # 13 g is 0.013 kg, not 0.013000000000000001 kg
    relative = entry.get("tolerance")
    return value, str(entry.get("source", "")), None if relative is None else _relative(relative, where)


def _tolerances(table: Any, where: str) -> dict[str, float]:
    if not isinstance(table, Mapping):
        raise UserError(f"{where}: [tolerance] is not a section; it should hold a number for each constant.")
    return {name: _relative(value, f"{where}: [tolerance] {name}") for name, value in table.items()}


def _relative(value: Any, where: str) -> float:
    number = _number(value, where)
    if number < 0:
        raise UserError(f"{where} has the tolerance {value!r}; it should be a share such as 0.02.")
    return number


def _number(value: Any, where: str) -> float:
    if not is_number(value):
        raise UserError(f"{where} is {value!r}; it should be a finite number.")
    return float(value)

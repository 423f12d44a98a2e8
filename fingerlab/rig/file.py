"""The rig file: what a bench knows of itself, as a TOML file that a person keeps.

Sections ``[finger]`` and ``[motor]`` hold the constants of :class:`fingerlab.rig.constants.Finger` and
:class:`fingerlab.rig.constants.Motor`, each a number in SI or a table ``{ value, unit, source, tolerance }``.
Relative tolerances may also stand in a section ``[tolerance]``, as in a session's rig text. Sections
``[daq]`` and ``[limits]`` hold what :class:`fingerlab.rig.daq.Daq` and :class:`fingerlab.rig.daq.Limits`
hold, each value again alone or as a table with unit and source.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from importlib import resources
from pathlib import Path
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.core.text import factor
from fingerlab.rig.constants import Finger, Motor, Rig
from fingerlab.rig.daq import CHANNEL_UNITS, LIMIT_UNITS, SOURCES, plain_section, read_daq, read_limits

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
        UserError: the file is missing, is not TOML, or a constant is missing, unknown, in a wrong unit
            or not a finite number.
    """
    return parse_rig(read_text(Path(path), "the TOML file of a rig"), str(path))


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
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise UserError(f"{where} is {value!r}; it should be a finite number.")
    return float(value)

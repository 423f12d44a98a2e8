"""Presets: what a simulated bench is made of, read from a TOML file in ``resources/rigs``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.rig.constants import Rig
from fingerlab.twin.effects import check_effects

PRACTICE = "practice"
AS_BUILT = "as-built"

SECTIONS: dict[str, dict[str, int]] = {
    "arms": {"extension": 2, "flexion": 2, "spread": 1},
    "cable": {
        "stiffness": 1,
        "damping_time": 1,
        "slack": 1,
        "pretravel": 1,
        "scatter": 1,
        "sheath_stiffness": 1,
        "wrap": 2,
    },
    "joints": {"viscous": 2, "wander": 1},
    "motor": {"inertia": 1, "viscous": 1, "current_lag": 1},
    "contact": {
        "posture": 2,
        "posture_spread": 1,
        "stiffness": 1,
        "damping": 1,
        "friction": 1,
        "tip_stiffness": 1,
        "tip_damping": 1,
    },
    "control": {
        "proportional": 1,
        "integral": 1,
        "derivative": 1,
        "derivative_cutoff_hz": 1,
        "current_limit": 1,
        "counts": 1,
    },
    "sensors": {
        "angle_step_deg": 1,
        "angle_noise_deg": 1,
        "force_step": 1,
        "force_noise": 1,
        "current_step": 1,
        "current_noise": 1,
    },
    "protocol": {"contact_amplitude_deg": 1, "contact_force": 1},
}
"""Sections of a preset, their entries, and how many numbers each entry holds."""


@dataclass(frozen=True)
class Preset:
    """A simulated bench before its tolerances are drawn. Units as in ``practice.toml``.

    Attributes:
        rig: what the bench knows of itself.
        numbers: ``numbers[section][entry]`` is a float, or a tuple of two (MCP, PIP).
        effects: effects built into the bench: id -> parameter -> value, SI.
    """

    name: str
    title: str
    rig: Rig
    numbers: Mapping[str, Mapping[str, Any]]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def load_preset(source: str | Path = PRACTICE) -> Preset:
    """A preset by name (``practice``, ``as-built``) or from a TOML file.

    Raises:
        UserError: no such preset, not TOML, or a section or number missing, unknown or impossible.
    """
    if isinstance(source, str) and source in (PRACTICE, AS_BUILT):
        name = source
        text = (files("fingerlab.resources") / "rigs" / f"{source}.toml").read_text(encoding="utf-8")
    else:
        name = Path(source).stem
        text = read_text(Path(source), "a preset: 'practice', 'as-built' or a TOML file")
    return parse_preset(text, name)


def parse_preset(text: str, name: str) -> Preset:
    """A preset from TOML text.

    Raises:
        UserError: as for ``load_preset``.
    """
    data = read_object(text, f"The preset {name}", "see that of the practice rig for an example", toml=True)
    unknown = set(data) - set(SECTIONS) - {"title", "rig", "effects"}
    if unknown:
        raise UserError(
            f"The preset {name} has the unknown section {sorted(unknown)[0]!r}; "
            f"known are {', '.join(SECTIONS)}."
        )
    numbers = {section: _section(data.get(section, {}), section, name) for section in SECTIONS}
    rig = Rig.from_json(json.dumps(data.get("rig", {})), f"The preset {name}, 'rig'")
    if rig.finger is None or rig.motor.pulley_radius is None:
        raise UserError(f"The preset {name} needs 'rig.finger' and 'rig.motor.pulley_radius'.")
    effects = check_effects(data.get("effects", {}), f"The preset {name}")
    return Preset(name, str(data.get("title", name)), rig, numbers, effects)


def _section(data: Any, section: str, name: str) -> dict[str, Any]:
    expected = SECTIONS[section]
    if not isinstance(data, dict):
        raise UserError(f"The preset {name}, '{section}' is not a table.")
    for key in data:
        if key not in expected:
            raise UserError(f"The preset {name}, '{section}' has the unknown entry {key!r}.")
    result: dict[str, Any] = {}
    for key, count in expected.items():
        value = data.get(key)
        values: list[Any] = value if isinstance(value, list) else [value]
        if len(values) != count or not all(_is_number(v) for v in values):
            raise UserError(
                f"The preset {name}, '{section}.{key}' is {value!r}; it should hold {count} finite number(s)."
            )
        result[key] = tuple(map(float, values)) if count > 1 else float(values[0])
    return result


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)

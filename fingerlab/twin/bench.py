"""A simulated bench: what it is made of, and its true constants, drawn once within their tolerances."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.rig.constants import Rig
from fingerlab.twin.effects import check_effects
from fingerlab.twin.integrate import cable_path, finger_bias, fingertip, joint_elastic, pose
from fingerlab.twin.plant import CONTROL, FRICTION, MCP, MOTOR, PIP, PLANT, Plant, Sensors, Truth

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


TRUNCATION = 2.0
"""No constant lies further off than this many of its tolerances: parts that far off are rejected."""

NEVER_MEASURED = ("wrist_angle", "gravity")
"""Finger constants that carry no tolerance of their own: a tilt is an effect."""


def draw_truth(preset: Preset, rng: np.random.Generator) -> Truth:
    """Draw a bench within the tolerances of its preset."""

    def draw(spread: float) -> float:
        return float(np.clip(rng.standard_normal(), -TRUNCATION, TRUNCATION)) * spread

    rig = preset.rig
    factors = {
        name: 1.0 + draw(rig.tolerance_of(name))
        for name in (*vars(rig.finger), "torque_constant", "pulley_radius", "inertia")
    }
    factors.update(dict.fromkeys(NEVER_MEASURED, 1.0))
    arms = preset.numbers["arms"]
    posture = preset.numbers["contact"]["posture"]
    scatter = preset.numbers["contact"]["posture_spread"]
    return Truth(
        factors=factors,
        arms={
            cable: (
                arms[cable][0] * (1.0 + draw(arms["spread"])),
                arms[cable][1] * (1.0 + draw(arms["spread"])),
            )
            for cable in ("extension", "flexion")
        },
        pretravel={c: abs(draw(preset.numbers["cable"]["pretravel"])) for c in ("extension", "flexion")},
        posture=(posture[0] + draw(scatter), posture[1] + draw(scatter)),
        sign=float(rng.choice([-1.0, 1.0])),
        phase=float(rng.uniform(0.0, 2.0 * math.pi)),
    )


def build_bench(preset: Preset, truth: Truth, cable: str) -> Plant:
    """The bench with one cable on (``extension``, ``flexion``) or none, before effects and placing."""
    plant = np.zeros(1, PLANT)[0]
    _fill_finger(plant, preset, truth)
    _fill_drive(plant, preset, truth, cable)
    contact = preset.numbers["contact"]
    plant["contact_stiffness"] = contact["stiffness"]
    plant["contact_damping"] = contact["damping"]
    plant["tip_friction"] = contact["friction"]
    plant["tip_stiffness"] = contact["tip_stiffness"]
    plant["tip_damping"] = contact["tip_damping"]
    return Plant(plant, _no_friction(), _control(preset), _sensors(preset), truth, cable)


def place_bench(bench: Plant, in_contact: bool) -> tuple[float, float]:
    """Hang the finger at rest and put the load cell in its place; joint angles at rest, rad.

    In contact the load cell's button stands where the tip is in the contact posture; on air it is
    out of reach.
    """
    plant = bench.plant
    plant["tilt_cos"], plant["tilt_sin"] = math.cos(plant["tilt"]), math.sin(plant["tilt"])
    plant["normal_x"], plant["normal_y"] = math.sin(plant["contact_angle"]), math.cos(plant["contact_angle"])

    def balance(q: Any) -> list[float]:
        bias = finger_bias(plant, pose(plant, q[0], q[1]), 0.0, 0.0)
        # A relaxing branch has had time to relax: its spring is at rest wherever the joint hangs.
        spring = joint_elastic(plant, q[0], q[1], 0.0, q[0], q[1])
        return [bias[0] + spring[0], bias[1] + spring[1]]

    rest = fsolve(balance, np.zeros(2), xtol=1e-12)
    q1, q2 = float(rest[0]), float(rest[1])
    plant["path_at_rest"] = cable_path(plant, q1, q2, pose(plant, q1, q2))
    x, y = fingertip(plant, pose(plant, *bench.truth.posture))[:2]
    plant["cell_x"] = x
    plant["cell_y"] = y if in_contact else y - 1.0
    return q1, q2


def _fill_finger(plant: Any, preset: Preset, truth: Truth) -> None:
    true = {name: value * truth.factors[name] for name, value in vars(preset.rig.finger).items()}
    for name in ("mass", "half_length", "inertia"):
        plant[f"proximal_{name}"] = true[f"proximal_{name}"]
        plant[f"distal_{name}"] = true[f"distal_{name}"]
    plant["tilt"] = true["wrist_angle"]
    plant["gravity"] = true["gravity"]
    plant["stiffness_1"], plant["stiffness_2"] = true["mcp_stiffness"], true["pip_stiffness"]
    plant["viscous_1"], plant["viscous_2"] = preset.numbers["joints"]["viscous"]
    plant["relaxation_time"] = 1.0


def _fill_drive(plant: Any, preset: Preset, truth: Truth, cable: str) -> None:
    numbers, motor = preset.numbers["cable"], preset.rig.motor
    assert motor.pulley_radius is not None  # checked by the preset
    plant["cable_sign"] = {"extension": -1.0, "flexion": 1.0, "none": 0.0}[cable]
    if cable != "none":
        plant["arm_1"], plant["arm_2"] = truth.arms[cable]
        plant["slack"] = numbers["slack"] + truth.pretravel[cable]
        # The dorsal cable lies on the knuckles, the palmar one spans them: each bends by its own angle.
        plant["wrap"] = numbers["wrap"][0 if cable == "extension" else 1]
    plant["cable_stiffness"] = numbers["stiffness"]
    plant["cable_damping"] = numbers["stiffness"] * numbers["damping_time"]
    plant["sheath_stiffness"] = numbers["sheath_stiffness"]
    plant["pulley_radius"] = motor.pulley_radius * truth.factors["pulley_radius"]
    plant["torque_constant"] = motor.torque_constant * truth.factors["torque_constant"] * motor.gear_ratio
    plant["inertia"] = preset.numbers["motor"]["inertia"] * truth.factors["inertia"]
    plant["motor_viscous"] = preset.numbers["motor"]["viscous"]
    plant["current_lag"] = preset.numbers["motor"]["current_lag"]
    plant["ripple_order"] = 1.0


def _no_friction() -> Any:
    friction = np.zeros(3, FRICTION)
    friction["travel"] = (1.5e-3, 1.5e-3, 1.5e-3)  # rad; assumed: a twelfth of a degree of hinge wind-up
    friction["damping"][[MCP, PIP, MOTOR]] = (2e-3, 2e-3, 5e-3)  # s; assumed: about half critical when stuck
    friction["stribeck_speed"] = 1.0
    friction["spread_travel"] = 1.0
    return friction


def _control(preset: Preset) -> Any:
    control = np.zeros(1, CONTROL)[0]
    settings = preset.numbers["control"]
    for name in ("proportional", "integral", "derivative", "current_limit"):
        control[name] = settings[name]
    control["derivative_cutoff"] = 2.0 * math.pi * settings["derivative_cutoff_hz"]
    control["count"] = 2.0 * math.pi / settings["counts"]
    return control


def _sensors(preset: Preset) -> Sensors:
    s = preset.numbers["sensors"]
    return Sensors(
        math.radians(s["angle_step_deg"]),
        math.radians(s["angle_noise_deg"]),
        s["force_step"],
        s["force_noise"],
        s["current_step"],
        s["current_noise"],
    )

"""A bench with its true constants: the preset, its tolerances drawn once, and the run's own spread."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.optimize import fsolve

from fingerlab.twin.integrate import cable_path, finger_bias, fingertip, joint_elastic, pose
from fingerlab.twin.plant import CONTROL, FRICTION, MCP, MOTOR, PIP, PLANT, Plant, Sensors, Truth
from fingerlab.twin.protocols import Preset

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
    known = preset.known
    factors.update({name: known[name] for name in factors if name in known})
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
        sign=known.get("sign", float(rng.choice([-1.0, 1.0]))),
        phase=known.get("phase", float(rng.uniform(0.0, 2.0 * math.pi))),
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
        force_gain=preset.known.get("force_gain", 1.0),
    )

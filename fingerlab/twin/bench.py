"""A bench with its true constants: what a preset or a found model says of it, with what is drawn of both.

Of a found model (a twin of a verdict), what it tells takes the place of what the preset assumes: the two
routings' moment arms, masses and springs, torque constant, inertia, the cable's give, the traces of viscous
friction, the load cell's gain, and every effect by its twin. The effects' values are translated by ``found``
in ``twin/effects/ID.py``; no formula of the fit is used. All else is the preset's: controller, sensors and
their noise, the contact, what differs from run to run, the posture at the load cell. A value is drawn from
its uncertainty by the seed, each by itself, for a model's file tells no correlations; or it is the best one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve

from fingerlab.core.errors import UserError
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel, load_model
from fingerlab.rig.file import FITTED_CONSTANTS, Rig
from fingerlab.sessions.model import CABLE_SIGN
from fingerlab.twin.effects import EFFECTS
from fingerlab.twin.integrate import cable_path, finger_bias, fingertip, joint_elastic, pose
from fingerlab.twin.plant import (
    CONTROL,
    FRICTION,
    MCP,
    MOTOR,
    PIP,
    PLANT,
    Nominal,
    NotCarriedError,
    Plant,
    Sensors,
    Truth,
)
from fingerlab.twin.protocols import Preset, load_preset

ENDING = ".json"
"""Of a model's file, where a preset is a name or TOML."""
Z90 = 1.6449
"""Standard deviations that half of a 90 % interval spans (normal distribution)."""
MOST_DRAWN = 2.0
"""Standard deviations beyond which no value is drawn, as for a bench's tolerances."""


@dataclass(frozen=True)
class Learned:
    """A preset that holds what a model found.

    Attributes:
        preset: the bench. effects: those of the model as the plant has them: id -> parameter -> value, SI.
        values: of the model, by key, SI, as they were drawn.
    """

    preset: Preset
    effects: Mapping[str, Mapping[str, float]]
    values: Mapping[str, float]


def preset_of(source: str | Path, seed: int = 0) -> Preset:
    """A preset by name or TOML file; of a model's file (``.json``) the practice bench with what was found.

    Raises:
        UserError: as for ``load_preset``, or as for :func:`learned`.
    """
    if not str(source).endswith(ENDING):
        return load_preset(source)
    found = learned(source, load_preset(), seed)
    return replace(found.preset, effects=found.effects)


def learned(path: str | Path, preset: Preset, seed: int, best: bool = False) -> Learned:
    """The bench of a model's file.

    Args:
        preset: what the model does not tell. seed: of the draw. best: take the best values, draw none.

    Raises:
        UserError: it is no model file, no model of a diagnosis, or one with an effect that the simulated
            bench does not have or cannot be given.
    """
    path, model = Path(path), load_model(path)
    if model.method != DIAGNOSIS_METHOD:
        raise UserError(
            f"{path} is a model of the method '{model.method}', which tells too little for a bench; give one "
            "from 'fingerlab diagnose SESSION --save M.json'."
        )
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(7,)))  # beside what it draws else
    values = {}
    for key, one in model.parameters.items():
        by = float(np.clip(rng.standard_normal(), -MOST_DRAWN, MOST_DRAWN))
        spread = (one.high - one.low) / (2.0 * Z90)
        drawn = one.value + (0.0 if best or not np.isfinite(spread) else by * spread)
        # What cannot be negative, or positive, and was not found so, is not drawn so.
        values[key] = 0.0 if drawn * one.value < 0.0 and one.low * one.high > 0.0 else drawn
    rig = _rig(model, preset, str(path))
    found = _preset(replace(preset, name=path.name, title=f"twin of {path.name}", rig=rig), model, values)
    effects, known = _effects(model, values, found, str(path))
    return Learned(replace(found, known={**found.known, **known}), effects, values)


def _rig(model: SavedModel, preset: Preset, where: str) -> Rig:
    """The rig that the model was fitted with; that of the preset where the file tells none."""
    given = model.details.get("rig")
    if not isinstance(given, Mapping):
        return preset.rig
    rig = Rig.from_json(json.dumps(given), f"{where}, 'rig'")
    if rig.finger is None or rig.motor.pulley_radius is None:
        raise UserError(f"{where} is a model of a bench without a finger; the twin of a verdict needs one.")
    return rig


def _preset(preset: Preset, model: SavedModel, values: Mapping[str, float]) -> Preset:
    """The preset with the constants of the bench that were found; ``known`` holds true over nominal."""
    assert preset.rig.finger is not None  # checked above, or by the preset
    known = dict.fromkeys((*vars(preset.rig.finger), "torque_constant", "pulley_radius", "inertia"), 1.0)
    known |= {name: 1.0 + values[name] for name in FITTED_CONSTANTS if name in values}
    known["torque_constant"] = 1.0 - values.get("torque_gain", 0.0)  # told is what is taken off
    numbers: dict[str, dict[str, Any]] = {name: dict(part) for name, part in preset.numbers.items()}
    inertia = preset.rig.motor.inertia or numbers["motor"]["inertia"]
    numbers["motor"]["inertia"] = max(inertia + values.get("rotor_inertia", 0.0), 0.1 * inertia)
    for cable in CABLE_SIGN:
        arms = [values.get(f"arm_{joint}@{cable}") for joint in ("mcp", "pip")]
        if arms[0] is not None and arms[1] is not None:
            numbers["arms"][cable] = (arms[0], arms[1])
    numbers["arms"]["spread"] = 0.0
    if "trace_mcp" in values:
        numbers["joints"]["viscous"] = tuple(max(values[f"trace_{joint}"], 0.0) for joint in ("mcp", "pip"))
    give = values.get("cable_compliance", 0.0)
    if give > 0.0 and "cable_stretch" not in model.effects:
        numbers["cable"]["stiffness"] = 1.0 / give
    if "force_gain" in values:
        known["force_gain"] = 1.0 / (1.0 + values["force_gain"])
    return replace(preset, numbers=numbers, known=known, effects={})


def _effects(
    model: SavedModel, values: Mapping[str, float], preset: Preset, where: str
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """The model's effects as the plant has them, and what of its chance they tell (sign, phase)."""
    shapes = model.details.get("shapes", {})
    chance: dict[str, float] = {}
    result = {}
    for name in model.effects:
        effect = EFFECTS.get(name)
        if effect is None or effect.found is None:
            why = "the simulated bench has no such effect" if effect is None else "its values do not tell one"
            raise UserError(f"{where} holds the effect {name!r}, which no twin can be given: {why}.")
        own = {key.partition(".")[2]: v for key, v in values.items() if key.startswith(f"{name}.")}
        try:
            parameters = dict(effect.found({**values, **own, **shapes.get(name, {})}, _nominal(preset)))
        except NotCarriedError as reason:
            raise UserError(f"{where}: the simulated bench cannot be given {name!r}; {reason}.") from None
        except KeyError as missing:
            raise UserError(f"{where} lacks {missing} of {name!r}; save the model again.") from None
        chance |= {key: parameters.pop(key) for key in ("sign", "phase") if key in parameters}
        result[name] = {**effect.defaults(), **parameters}
    return result, chance


def _nominal(preset: Preset) -> Nominal:
    finger, known = preset.rig.finger, preset.known
    assert finger is not None
    stiffness = (
        finger.mcp_stiffness * known.get("mcp_stiffness", 1.0),
        finger.pip_stiffness * known.get("pip_stiffness", 1.0),
    )
    numbers = preset.numbers
    return Nominal(stiffness, 1.0 / numbers["cable"]["stiffness"], 1.0 / numbers["contact"]["stiffness"])


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

"""A twin of a verdict: the bench that a found model describes, as a preset of the simulated rig.

What the model tells takes the place of what the preset assumes: the two routings' moment arms, masses and
springs, torque constant, inertia, the cable's give, the traces of viscous friction, the load cell's gain,
and every effect by its twin. The effects' values are translated by ``found`` in ``twin/effects/ID.py``; no
formula of the fit is used. All else is the preset's: controller, sensors and their noise, the contact, what
differs from run to run, the posture at the load cell.

A value is drawn from its uncertainty by the seed, each by itself, for a model's file tells no correlations;
or it is the best one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel, load_model
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import CABLE_SIGN
from fingerlab.twin.effects import EFFECTS
from fingerlab.twin.plant import Nominal, NotCarriedError
from fingerlab.twin.protocols import Preset, load_preset

ENDING = ".json"
"""Of a model's file, where a preset is a name or TOML."""
Z90 = 1.6449
"""Standard deviations that half of a 90 % interval spans (normal distribution)."""
MOST_DRAWN = 2.0
"""Standard deviations beyond which no value is drawn, as for a bench's tolerances."""
SHARES = ("proximal_mass", "distal_mass", "mcp_stiffness", "pip_stiffness")
"""Constants of which a model tells by what share they are off."""


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
    values = _drawn(model, seed, best)
    rig = _rig(model, preset, str(path))
    found = _preset(replace(preset, name=path.name, title=f"twin of {path.name}", rig=rig), model, values)
    effects, known = _effects(model, values, found, str(path))
    return Learned(replace(found, known={**found.known, **known}), effects, values)


def _drawn(model: SavedModel, seed: int, best: bool) -> dict[str, float]:
    rng = np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(7,))
    )  # beside what the seed draws else
    result = {}
    for key, one in model.parameters.items():
        by = float(np.clip(rng.standard_normal(), -MOST_DRAWN, MOST_DRAWN))
        spread = (one.high - one.low) / (2.0 * Z90)
        drawn = one.value + (0.0 if best or not np.isfinite(spread) else by * spread)
        # What cannot be negative, or positive, and was not found so, is not drawn so.
        result[key] = 0.0 if drawn * one.value < 0.0 and one.low * one.high > 0.0 else drawn
    return result


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
    known |= {name: 1.0 + values[name] for name in SHARES if name in values}
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

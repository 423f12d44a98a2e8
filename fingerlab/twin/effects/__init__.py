"""Effects as physical changes of the simulated bench, a file each: how they are found, chosen and put in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from fingerlab.core.errors import UserError
from fingerlab.core.trust import found_in
from fingerlab.physics.parameter import Parameter
from fingerlab.twin.plant import Plant, PlantEffect, Values

ORDER = (
    *("viscous_friction", "coulomb_friction", "stribeck_friction", "presliding_hysteresis"),
    *("spring_hardening", "stiffness_error", "joint_coupling", "viscoelastic_creep", "joint_stop"),
    *("gravity_tilt", "added_mass", "distal_rotation", "varying_moment_arm", "capstan_friction"),
    *("cable_slack", "cable_stretch", "backlash", "motor_coulomb_friction", "motor_viscous_friction"),
    *("motor_inertia", "motor_stribeck_friction", "motor_presliding", "asymmetric_friction"),
    *("load_dependent_friction", "motor_spring", "torque_ripple", "transport_delay"),
    *("angle_sensor_nonlinearity", "sensor_drift", "load_cell_gain", "contact_angle"),
    *("contact_compliance", "routing_change"),
)
"""Order in which they are put into the plant and drawn by lot; what is not named comes behind, by its id."""

EFFECTS: dict[str, PlantEffect] = found_in(__path__, __name__, ORDER)
"""Every effect that the simulated bench can have, by id."""

Effects = Mapping[str, Values]
"""Effects in a plant: id -> parameter -> value, SI."""


def parse_effects(requests: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read ``ID``, ``ID=STRENGTH`` (SI unit of the first parameter) or ``ID=xFACTOR`` (times the default).

    Raises:
        UserError: the id is unknown, is given twice, or the strength is no number.
    """
    result: dict[str, dict[str, float]] = {}
    for request in requests:
        name, separator, strength = request.partition("=")
        effect = EFFECTS.get(name)
        if effect is None:
            raise UserError(f"There is no effect {name!r}; the catalogue has {', '.join(EFFECTS)}.")
        if name in result:
            raise UserError(f"The effect {name!r} is given twice; name it once, with one strength.")
        values = effect.defaults()
        first = effect.parameters[0]
        if separator:
            values[first.name] = _strength(strength, first, name)
        result[name] = values
    return result


def check_effects(effects: Mapping[str, Mapping[str, float]], where: str) -> dict[str, dict[str, float]]:
    """Effects of a preset with the defaults filled in.

    Raises:
        UserError: an unknown effect or parameter, or a value that is no number.
    """
    result: dict[str, dict[str, float]] = {}
    for name, values in effects.items():
        if name not in EFFECTS or not isinstance(values, Mapping):
            raise UserError(
                f"{where} has the unknown effect {name!r}; the catalogue has {', '.join(EFFECTS)}."
            )
        full = EFFECTS[name].defaults()
        for key, value in values.items():
            if key not in full or isinstance(value, bool) or not isinstance(value, int | float):
                raise UserError(
                    f"{where}, effect {name!r}, has {key} = {value!r}; known are {', '.join(full)}."
                )
            full[key] = float(value)
        result[name] = full
    return result


def apply_effects(bench: Plant, effects: Effects) -> None:
    """Put effects into the bench of one run, in the order of the catalogue."""
    for name, effect in EFFECTS.items():
        if name in effects:
            effect.apply(bench, effects[name])


def _strength(text: str, parameter: Parameter, name: str) -> float:
    factor = text.startswith("x")
    try:
        number = float(text[1:] if factor else text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UserError(
            f"The strength of {name!r} is {text!r}; it should be in {parameter.unit or 'plain units'}, or "
            f" like x0.5 for half of the default {parameter.default:g}."
        )
    return number * parameter.default if factor else number

"""What effects between motor and cable share: the drive's friction, the tension left, sheaths, the delay."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fingerlab.effects.base import (
    ALONE,
    REVERSAL_SPEED,
    REVERSAL_SPEEDS,
    STICK_DAMPING,
    Effect,
    Row,
    Shape,
    Term,
    of_shape,
)
from fingerlab.physics.friction_states import friction_state, rubbing_forces, slip_states, with_grid
from fingerlab.physics.motion import Motion, nothing
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import CABLE_SIGN, Array

WINDING_TRAVELS_DEG = (0.15, 0.21, 0.3, 0.42, 0.6, 0.84)
"""Travel over which friction of motor or sheath reverses by 63 %, degrees at the pulley: from a few steps of
the encoder to the wind-up of a gearbox; assumed."""
SHORT_AND_WINDING_TRAVELS_DEG = (0.05, 0.1, *WINDING_TRAVELS_DEG)
"""... of what follows the load at once, as hard teeth or a stiff cable in a hard sheath do, too; assumed."""
USUAL_STICKING_DEG = 0.3
WINDING_SHAPES = tuple({"travel_deg": value} for value in WINDING_TRAVELS_DEG)
MOTOR_ALONE_SHAPES = (
    *({"travel_deg": value, ALONE: 1.0} for value in (0.05, *WINDING_TRAVELS_DEG)),
    *({REVERSAL_SPEED: value, ALONE: 1.0} for value in REVERSAL_SPEEDS),
)
FRICTION = Parameter(
    "N m", 0.0, 0.1, 0.005, title="friction torque at the gearbox output",
    varies_between_runs=True, holds_at_rest=True,
)  # fmt: skip

RIPPLE_ORDERS = (*range(4, 41, 2), *range(44, 61, 4))
"""Periods a turn of the pulley that are tried; between two of them a travel of 30 degrees shifts the phase by
a quarter of a radian at most. 4.3:1 gearing puts the motor's 13 commutator segments at 56."""

FRICTIONS_OF_THE_DRIVE = {
    "drive": ("motor_coulomb_friction", "coulomb"),
    "drive_stribeck": ("motor_stribeck_friction", "coulomb"),
    "drive_uneven": ("asymmetric_friction", "coulomb"),
    "drive_presliding": ("motor_presliding", "dahl"),
}
"""Effects that rub in motor and gearbox, each with its gain, by how their numbers in a shape begin."""
FRICTION_LAW = ("travel_deg", "sharpness", REVERSAL_SPEED)
"""Numbers of a shape by which a friction turns round."""


def _rubbing_numbers() -> dict[str, tuple[str, ...]]:
    """Of every friction of the drive its size and its law."""
    found: dict[str, tuple[str, ...]] = {}
    for start, (name, gain) in FRICTIONS_OF_THE_DRIVE.items():
        found[f"{start}_coulomb"] = (f"{name}.{gain}",)
        found |= {f"{start}_{number}": (of_shape(name, number),) for number in FRICTION_LAW}
    return found


DRIVE = {
    "drive_inertia": ("rotor_inertia", "motor_inertia.inertia"),
    **_rubbing_numbers(),
    "drive_difference": ("asymmetric_friction.difference",),
    "drive_stribeck_extra": ("motor_stribeck_friction.extra",),
    "drive_stribeck_speed": (of_shape("motor_stribeck_friction", "stribeck_speed"),),
    "drive_viscous": ("motor_viscous_friction.viscous",),
    "drive_stiffness": ("motor_spring.stiffness",),
    "drive_order": (of_shape("torque_ripple", "order"),),
    "drive_sine": ("torque_ripple.sine",),
    "drive_cosine": ("torque_ripple.cosine",),
    "drive_double_sine": ("torque_ripple.double_sine",),
    "drive_double_cosine": ("torque_ripple.double_cosine",),
}
"""Numbers of a shape that tell what motor and gearbox keep for themselves, and the unknowns or shapes that
they are: inertia beyond the rig file's (kg m^2); of each friction its size (N m) and the travel or speed over
which it turns round; by how much it differs by direction, what it has more near standstill and below which
speed (N m, rad/s); viscous friction (N m s/rad), stiffness (N m/rad), and a torque that repeats with the
motor's angle (N m), with its double."""


def driven_tension(motion: Motion, shape: Shape) -> Array:
    """Tension that motor and gearbox leave the cable, N, (n,), as far as the shape tells what they keep."""
    kept = {name: shape.get(name, 0.0) for name in DRIVE}

    def driven() -> Array:
        inertia = (motion.motor.inertia or 0.0) + kept["drive_inertia"]
        found = motion.tension - inertia * motion.inertial_pull
        if kept["drive_viscous"]:
            found = found - (kept["drive_viscous"] / motion.radius) * motion.velocity
        if kept["drive_stiffness"]:
            found = found - (kept["drive_stiffness"] / motion.radius) * motion.position
        if kept["drive_difference"]:
            found = found - kept["drive_difference"] / motion.radius
        for start in FRICTIONS_OF_THE_DRIVE:
            if not kept[f"{start}_coulomb"]:
                continue
            law = {name: kept[f"{start}_{name}"] for name in FRICTION_LAW}
            state = drive_state(motion, {name: number for name, number in law.items() if number})
            found = found - (kept[f"{start}_coulomb"] / motion.radius) * state
            if start == "drive_stribeck" and kept["drive_stribeck_speed"]:
                slow = np.exp(-((motion.velocity / kept["drive_stribeck_speed"]) ** 2))
                found = found - (kept["drive_stribeck_extra"] / motion.radius) * state * slow
        for times, name in ((1, ""), (2, "double_")):
            size = complex(kept[f"drive_{name}cosine"], -kept[f"drive_{name}sine"])
            if size:
                turning = turning_with(motion, times * kept["drive_order"])
                found = found - (size * turning).real / motion.radius
        return np.asarray(found)

    return motion.remember(("driven", *kept.values()), driven)


SHARES = {f"share_{cable}": (f"capstan_friction.{cable}",) for cable in CABLE_SIGN}
"""Numbers of a shape that tell the share of the tension that each cable's sheath takes, which is its own: on
the back of the hand a cable bends over the knuckles, in the palm it may run nearly straight."""
MOST_SHARE = 0.7
"""Of the tension; friction of 0.2 over 350 degrees of bends, assumed."""
LEAST_TRAVEL = 0.05
"""Of the other sheath's: what takes less than a twentieth of it is not seen to stick; assumed."""
REFERENCE_PULL_N = 5.0
"""Tension at which the travel of a friction that grows with the load is told, N: what sticks has one spring,
so that it slides over twice the travel at twice the load. Assumed; only a scale."""


def sheath_loss(motion: Motion, shape: Shape, cable: str) -> Array:
    """What a cable's sheath takes of the tension, for a share of one, N, (n,); of a cable not used, nothing.

    The share follows the tension of the moment or, where ``held``, only as far as what sticks is let go: a
    cable that sticks in its sheath keeps its friction while the tension rises on both ends of it. One that
    goes by the speed follows the tension. What motor and gearbox keep for themselves never reaches either.

    What takes the share s of the motor's tension winding in, 1 - exp(-mu phi), gives exp(mu phi) - 1, which
    is s / (1 - s), of it paying out. What sticks is equally stiff in either sheath, so that it slides over a
    travel in proportion to s; the one told is that of the sheath which takes more.
    """
    share, most = shape.get(f"share_{cable}", 0.0), max(shape.get(name, 0.0) for name in SHARES)
    paying_out = 1.0 / (1.0 - min(share, MOST_SHARE))
    by_speed = {name: shape[name] for name in (REVERSAL_SPEED,) if name in shape}
    travel = shape.get("travel_deg", 0.0) * (max(share / most, LEAST_TRAVEL) if most else 1.0)
    sharpness, held = shape.get("sharpness", 0.0), bool(shape.get("held", 0.0))

    def lost() -> Array:
        if motion.cable_sign != CABLE_SIGN[cable]:
            return nothing(len(motion.position))
        tension = driven_tension(motion, shape)
        if not held:
            state = drive_state(motion, by_speed or {"travel_deg": travel, "sharpness": sharpness})
            return np.asarray(tension * taken_along(state, min(share, MOST_SHARE)))
        limit = np.maximum(tension, 0.0)

        def stops(position: Array, reaches: Array) -> Array:
            return rubbing_forces(position, limit, REFERENCE_PULL_N / reaches, paying_out)

        return friction_state(motion.position, float(np.radians(travel)), sharpness, stops)

    drive = (shape.get(name, 0.0) for name in DRIVE)
    key = ("sheath", cable, travel, *by_speed.values(), sharpness, held, paying_out, *drive)
    return motion.remember(key, lost)


def taken_along(state: Array, share: float) -> Array:
    """What a sheath that slides along a part of it takes of the motor's tension, over the share; (n,).

    Its wrap adds up in the exponent (Euler): where ``state`` of it slides, exp(-state mu phi) of the tension
    is left, with exp(-mu phi) = 1 - ``share``.
    """
    if share <= 0.0:
        return state
    return np.asarray(-np.expm1(state * np.log1p(-share)) / share)


LATE = "late"
"""Number of a delay's shape that tells by how much the motor's channels are to be late for what effects make
of them, s; the equations' own channels are shifted by the fit."""


def as_effects_see_it(motion: Motion, effects: Iterable[Effect]) -> Motion:
    """The motion with the motor's channels as late as a delay among the effects was found to be."""
    late = sum(e.shapes[0].get(LATE, 0.0) for e in effects if e.special == "delay" and len(e.shapes))
    return motion.with_motor_late(late) if late else motion


def no_columns(motion: Motion, shape: Shape) -> list[Term]:
    return []


def pull_terms(gain: str, pull: Array) -> list[Term]:
    """Tension (N) that the motor gives and the cable never sees: not in the joints, not in the stretch."""
    return [Term(Row.MCP, gain, pull), Term(Row.PIP, gain, pull), Term(Row.CABLE, gain, pull, "compliance")]


def drive_terms(motion: Motion, gain: str, torque: Array) -> list[Term]:
    """A torque on the motor side (N m): in both joint equations as a tension, or in the bench equation."""
    if motion.finger is None:
        return [Term(Row.BENCH, gain, torque)]
    return pull_terms(gain, torque / motion.radius)


def winding_state(
    motion: Motion, travel_deg: float = USUAL_STICKING_DEG, sharpness: float = 0.0, start: float = 1.0
) -> Array:
    """Direction of cable travel with sticking, in [-1, 1], shape (n,); +1 winding in."""
    way = float(np.radians(travel_deg))

    if sharpness > 0.0:
        key = ("winding", travel_deg, sharpness, start)
        return motion.remember(key, lambda: friction_state(motion.position, way, sharpness, start=start))
    travels = with_grid(travel_deg, WINDING_TRAVELS_DEG)
    keys = [("winding", travel) for travel in travels]
    return motion.remember_each(keys[0], keys, lambda: slip_states(motion.position, np.radians(travels)))


def drive_state(motion: Motion, shape: Shape) -> Array:
    """Direction in which motor and gearbox rub, (n,), in [-1, 1]: by the travel, or by the speed.

    Where what sticks is damped, it is more than that while it winds up.
    """
    if REVERSAL_SPEED in shape:
        width = shape[REVERSAL_SPEED]
        return motion.remember(("by speed", width), lambda: np.tanh(motion.velocity / width))
    travel, sharpness = shape.get("travel_deg", USUAL_STICKING_DEG), shape.get("sharpness", 0.0)
    state = winding_state(motion, travel, sharpness)
    if STICK_DAMPING not in shape:
        return state
    key = ("damped", travel, sharpness, shape[STICK_DAMPING])
    return motion.remember(key, lambda: damped(motion, state, shape))


def damped(motion: Motion, state: Array, shape: Shape) -> Array:
    """A friction state, (n,), with the damping of what sticks beside its spring (LuGre's sigma_1)."""
    return state + shape[STICK_DAMPING] * motion.sample_rate_hz * np.gradient(state)


def turning_with(motion: Motion, order: float) -> Any:
    """exp(i order position), complex (n,); from the usual order two below, which costs a tenth of a sine."""
    if order <= RIPPLE_ORDERS[0] or order % 2 or order > 2 * RIPPLE_ORDERS[-1]:
        return motion.remember(("turning", order), lambda: np.exp(1j * order * motion.position))
    step = motion.remember(("turning", 2), lambda: np.exp(2j * motion.position))
    return motion.remember(("turning", order), lambda: turning_with(motion, order - 2) * step)


def coulomb_terms(motion: Motion, shape: Shape) -> list[Term]:
    if motion.finger is None:
        return drive_terms(motion, "coulomb", drive_state(motion, shape))
    law = {name: shape[name] for name in ("travel_deg", "sharpness", REVERSAL_SPEED) if name in shape}
    key = ("coulomb pull", *law.items())  # one signal for Coulomb and Stribeck friction
    return pull_terms("coulomb", motion.remember(key, lambda: drive_state(motion, law) / motion.radius))

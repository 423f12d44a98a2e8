"""What effects between motor and cable share: the drive's friction, the tension that it leaves, its delay."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fingerlab.effects.base import Effect, Row, Shape, Term
from fingerlab.physics.friction_states import friction_state, slip_states, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

WINDING_TRAVELS_DEG = (0.15, 0.21, 0.3, 0.42, 0.6, 0.84)
"""Travel over which friction of motor or sheath reverses by 63 %, degrees at the pulley: from a few steps of
the encoder to the wind-up of a gearbox; assumed."""
USUAL_STICKING_DEG = 0.3
WINDING_SHAPES = tuple({"travel_deg": value} for value in WINDING_TRAVELS_DEG)
FRICTION = Parameter(
    "N m", 0.0, 0.1, 0.005, title="friction torque at the gearbox output",
    varies_between_runs=True, holds_at_rest=True,
)  # fmt: skip

DRIVE = {
    "drive_inertia": ("rotor_inertia", "motor_inertia.inertia"),
    "drive_coulomb": ("motor_coulomb_friction.coulomb",),
    "drive_viscous": ("motor_viscous_friction.viscous",),
}
"""Numbers of a shape that tell what motor and gearbox keep for themselves, and the unknowns that they are:
inertia beyond the rig file's (kg m^2), friction (N m), and viscous friction (N m s/rad)."""


def driven_tension(motion: Motion, shape: Shape) -> Array:
    """Tension that motor and gearbox leave the cable, N, (n,), as far as the shape tells what they keep.

    Friction is taken with the usual travel: where the motor turns round, the tension is known to that alone.
    """
    inertia = (motion.motor.inertia or 0.0) + shape.get("drive_inertia", 0.0)
    found = motion.tension - inertia * motion.inertial_pull
    if viscous := shape.get("drive_viscous", 0.0):
        found = found - (viscous / motion.radius) * motion.velocity
    if coulomb := shape.get("drive_coulomb", 0.0):
        found = found - (coulomb / motion.radius) * winding_state(motion)
    return np.asarray(found)


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


def winding_state(motion: Motion, travel_deg: float = USUAL_STICKING_DEG, sharpness: float = 0.0) -> Array:
    """Direction of cable travel with sticking, in [-1, 1], shape (n,); +1 winding in."""
    way = float(np.radians(travel_deg))

    if sharpness > 0.0:
        key = ("winding", travel_deg, sharpness)
        return motion.remember(key, lambda: friction_state(motion.position, way, sharpness))
    travels = with_grid(travel_deg, WINDING_TRAVELS_DEG)
    keys = [("winding", travel) for travel in travels]
    return motion.remember_each(keys[0], keys, lambda: slip_states(motion.position, np.radians(travels)))


def coulomb_terms(motion: Motion, shape: Shape) -> list[Term]:
    travel, sharpness = shape["travel_deg"], shape.get("sharpness", 0.0)
    if motion.finger is None:
        return drive_terms(motion, "coulomb", winding_state(motion, travel, sharpness))
    key = ("coulomb pull", travel, sharpness)  # one signal for Coulomb and Stribeck friction
    return pull_terms(
        "coulomb",
        motion.remember(key, lambda: winding_state(motion, travel, sharpness) / motion.radius),
    )

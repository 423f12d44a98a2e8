"""Gravity, mass and rotational energy that the nominal model has otherwise."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term, nothing
from fingerlab.effects.closer import plus
from fingerlab.effects.motion import Motion
from fingerlab.effects.tip import tip_reach, while_pressed
from fingerlab.sessions.model import Array

LARGEST_TILT_RAD = 0.45
TURNS_DEG = (-17.0, 0.0, 17.0)
"""Tilts about which the torques are taken as straight, each half-way to the next; within 1 per cent."""
PRESSED_TURNS_DEG = tuple(8.0 * k for k in range(-3, 4))
"""The same where the load cell stays: what friction does to the tip is within 7 per cent."""


def _tilt(motion: Motion, shape: Shape) -> list[Term]:
    """Gravity torques of a base that stands at another angle, to first order about none or about a large one.

    A load cell that stands on a base of its own (``cell_stays``) then presses from another direction, too:
    the levers of the contact force turn with the finger (thesis equation 3.18).
    """
    about = math.radians(shape.get("turn_deg", 0.0))
    force = motion.force if shape.get("cell_stays") else None
    (mcp, pip), (turn_mcp, turn_pip) = _standing_torques(motion, force, about)
    level = nothing(len(pip)) if force is None else while_pressed(motion, tip_reach(motion))
    terms = [
        Term(Row.MCP, "tilt", turn_mcp, "joint"),
        Term(Row.PIP, "tilt", turn_pip, "joint"),
        Term(Row.TIP, "tilt", level),
    ]
    if about:
        (flat_mcp, flat_pip), _ = _standing_torques(motion, force, 0.0)
        terms += [
            Term(Row.MCP, "", mcp - flat_mcp - about * turn_mcp, "joint", constant=1.0),
            Term(Row.PIP, "", pip - flat_pip - about * turn_pip, "joint", constant=1.0),
        ]
    return terms


def _near(shape: Shape) -> tuple[float, float]:
    """The tilts that a point of the grid stands for."""
    turns = PRESSED_TURNS_DEG if shape["cell_stays"] else TURNS_DEG
    reach = (turns[1] - turns[0]) / 2.0
    low, high = (math.radians(shape["turn_deg"] + side * reach) for side in (-1.0, 1.0))
    return max(low, -LARGEST_TILT_RAD), min(high, LARGEST_TILT_RAD)


def _face_turn(shape: Shape) -> float:
    return math.radians(shape["turn_deg"]) * shape["cell_stays"]


Pair = tuple[Array, Array]


def _standing_torques(motion: Motion, force: Array | None, tilt: float) -> tuple[Pair, Pair]:
    """What gravity and the force (N) do to MCP and PIP on a tilted base, N m, and its slope with the tilt.

    Thesis equations 3.16 to 3.18; the tilt comes on top of the wrist angle.
    """
    f, q = motion.finger_and_joints
    proximal, distal = f.wrist_angle - q.mcp, q.mcp + q.pip - f.wrist_angle
    sines = {
        name: motion.remember(("tilt", name), partial(wave, angle))
        for name, wave, angle in (
            ("sin p", np.sin, proximal), ("cos p", np.cos, proximal),
            ("sin d", np.sin, distal), ("cos d", np.cos, distal),
        )
    }  # fmt: skip
    c, s = np.cos(tilt), np.sin(tilt)
    pressed: Array | float = 0.0 if force is None else force
    near = 2.0 * f.proximal_half_length * pressed
    near = near - (f.proximal_mass + 2.0 * f.distal_mass) * f.gravity * f.proximal_half_length
    far = 2.0 * f.distal_half_length * pressed - f.distal_mass * f.gravity * f.distal_half_length
    pip = far * (c * sines["cos d"] + s * sines["sin d"])
    turn_pip = far * (c * sines["sin d"] - s * sines["cos d"])
    mcp = near * (c * sines["cos p"] - s * sines["sin p"]) + pip
    turn_mcp = turn_pip - near * (c * sines["sin p"] + s * sines["cos p"])
    return (mcp, pip), (turn_mcp, turn_pip)


def _point_mass(motion: Motion, shape: Shape) -> list[Term]:
    """Torques of a unit mass at the share ``place`` of the distal body, 0 at the PIP joint, 1 at the tip."""
    f, q = motion.finger_and_joints
    l1, lever = 2 * f.proximal_half_length, 2 * f.distal_half_length * shape["place"]
    distal = q.mcp + q.pip - f.wrist_angle
    cos2, sin2 = np.cos(q.pip), np.sin(q.pip)
    rate, bend = q.mcp_velocity + q.pip_velocity, q.mcp_acceleration + q.pip_acceleration
    pip = (
        lever**2 * bend
        + lever * l1 * (cos2 * q.mcp_acceleration + sin2 * q.mcp_velocity**2)
        - f.gravity * lever * np.cos(distal)
    )
    mcp = (
        pip
        + l1**2 * q.mcp_acceleration
        + l1 * lever * (cos2 * bend - sin2 * rate**2)
        - f.gravity * l1 * np.cos(f.wrist_angle - q.mcp)
    )
    return [Term(Row.MCP, "mass", mcp, "joint"), Term(Row.PIP, "mass", pip, "joint")]


def _distal_rotation(motion: Motion, shape: Shape) -> list[Term]:
    """What I2 adds when the distal body turns with the absolute rate; relative to the rig's I2."""
    f, q = motion.finger_and_joints
    return [
        Term(Row.MCP, "share", f.distal_inertia * (q.mcp_acceleration + q.pip_acceleration), "joint"),
        Term(Row.PIP, "share", f.distal_inertia * q.mcp_acceleration, "joint"),
    ]


EFFECTS = (
    Effect(
        id="gravity_tilt",
        title="Tilted base",
        acts_on=("joint_torque",),
        gains={
            "tilt": Gain(
                "rad",
                -LARGEST_TILT_RAD,
                LARGEST_TILT_RAD,
                0.1,
                source="assumed: up to 25 degrees",
                title="tilt of the base",
                limits=_near,
            ),
        },
        columns=_tilt,
        coordinate="joint angle",
        equation=Row.MCP,
        explanation="The missing torques are those of gravity from another direction.",
        reveal="slow steps over the whole travel",
        shapes=(
            *({"cell_stays": 0.0, "turn_deg": t} for t in TURNS_DEG),
            *({"cell_stays": 1.0, "turn_deg": t} for t in PRESSED_TURNS_DEG),
        ),
        shape_units={"turn_deg": "deg"},
        closer=plus("turn_deg", (-4.0, 0.0, 4.0)),
        turns=_face_turn,
    ),
    Effect(
        id="added_mass",
        title="Mass that the budget left out",
        acts_on=("joint_torque",),
        gains={"mass": Gain("kg", 0.0, 0.02, 0.003, title="added mass")},
        columns=_point_mass,
        coordinate="joint acceleration",
        equation=Row.MCP,
        explanation="The missing torques are those of more weight and inertia on the finger.",
        reveal="a chirp up to 3 Hz",
        shapes=tuple({"place": value} for value in (0.0, 0.5, 1.0)),
        shape_units={"place": "of the distal length"},
    ),
    Effect(
        id="distal_rotation",
        title="Rotational energy of the distal body",
        acts_on=("joint_torque",),
        gains={
            "share": Gain("1", 0.9, 1.1, 1.0, source="Lagrangian with the absolute rate", title="share of I2")
        },
        columns=_distal_rotation,
        coordinate="joint acceleration",
        equation=Row.MCP,
        explanation="The missing torques are I2 times the acceleration that the relative rate leaves out.",
        reveal="a fast chirp, 2 to 5 Hz",
    ),
)

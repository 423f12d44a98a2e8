"""Stribeck friction of the joints: Coulomb friction that is larger near zero speed."""

import math
from dataclasses import replace

import numpy as np

from fingerlab.effects.base import (
    OCTAVE,
    REVERSAL_SPEED,
    SPEED_FACTORS,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    every,
    falling,
    rubbing,
    times,
)
from fingerlab.effects.joints import (
    COULOMB,
    JOINT_TRAVELS_DEG,
    LEAST_JOINT_SPEED,
    both,
    friction_of_joints,
    joint_terms,
)
from fingerlab.physics.motion import Motion

STRIBECK_SPEEDS = (0.2, 0.6)
"""Speeds by which the excess of breakaway has fallen to 37 %, rad/s; assumed: from where a hinge of polymer
slides for certain to a third of the thesis' fastest motion."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    mcp, pip = friction_of_joints(motion, shape)
    speed = shape["stribeck_speed"]
    return joint_terms("coulomb", mcp, pip) + joint_terms(
        "extra",
        mcp * np.exp(-((joints.mcp_velocity / speed) ** 2)),
        pip * np.exp(-((joints.pip_velocity / speed) ** 2)),
    )


EFFECT = Effect(
    id="stribeck_friction",
    title="Stribeck joint friction",
    family="Joint friction",
    acts_on=("joint_torque",),
    gains=both("coulomb", COULOMB)
    | {
        f"extra_{j}": replace(COULOMB, title="friction added near standstill", excess_of=f"coulomb_{j}")
        for j in ("mcp", "pip")
    },
    columns=columns,
    coordinate="joint speed",
    equation=Row.PIP,
    explanation="The missing torque flips sign with joint speed and is larger when the joint is slow.",
    reveal="a chirp from 0.2 to 3 Hz",
    mend="Grease the hinges, and move faster than the speed below which friction rises.",
    # Neighbours in the grid differ in one number: the travels up at one speed, down at the next.
    shapes=tuple(
        {"stribeck_speed": speed, "travel_deg": travel}
        for speed, travels in zip(
            STRIBECK_SPEEDS, (JOINT_TRAVELS_DEG[:5], JOINT_TRAVELS_DEG[4::-1]), strict=True
        )
        for travel in travels
    ),
    shape_units={"stribeck_speed": "rad/s", "travel_deg": "deg", REVERSAL_SPEED: "rad/s"},
    closer=falling(
        every(
            times("stribeck_speed", SPEED_FACTORS),
            rubbing(
                sharpnesses=(0.0, 1.0), speed_factors=OCTAVE, by_speed=True, least_speed=LEAST_JOINT_SPEED
            ),
        )
    ),
    formula=Formula(
        equation=r"\tau_j = z(\theta_j;\delta)\left(C_j + E_j\,e^{-(\dot\theta_j/v_s)^2}\right)",
        symbols=(
            "C_j: friction torque at speed. E_j: what is added near zero speed. v_s: Stribeck speed. "
            "z: friction state that builds up over the travel δ, or the hyperbolic tangent of the speed over "
            "v_r; both are tried."
        ),
        source="Stribeck 1902, with the exponential of the squared speed (Olsson et al. 1998).",
        values={
            "coulomb_mcp": "C_1",
            "coulomb_pip": "C_2",
            "extra_mcp": "E_1",
            "extra_pip": "E_2",
            "stribeck_speed": "v_s",
            "travel_deg": r"\delta",
            REVERSAL_SPEED: "v_r",
        },
        alike=("coulomb_friction", "presliding_hysteresis", "motor_stribeck_friction"),
    ),
    example=Example(
        {"stribeck_speed": 0.2, "travel_deg": 0.12},
        {"mcp": [0.0, 0.1], "mcp_velocity": [0.0, 0.2]},
        {"MCP coulomb_mcp": [0.0, 1.0], "MCP extra_mcp": [0.0, math.exp(-1.0)]},
    ),
)

"""Coulomb friction of the joints: a state that runs to the other side over a small travel."""

import numpy as np

from fingerlab.effects.base import (
    REVERSAL_SPEED,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    rubbing,
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


def columns(motion: Motion, shape: Shape) -> list[Term]:
    return joint_terms("coulomb", *friction_of_joints(motion, shape))


EFFECT = Effect(
    id="coulomb_friction",
    title="Coulomb joint friction",
    family="Joint friction",
    acts_on=("joint_torque",),
    gains=both("coulomb", COULOMB),
    columns=columns,
    coordinate="joint speed",
    equation=Row.PIP,
    explanation="The missing torque flips sign with joint speed and has one size on each side.",
    reveal="slow sines with full reversals",
    mend="Polish or exchange the hinge pins; a larger motion makes its share smaller.",
    shapes=tuple({"travel_deg": travel} for travel in JOINT_TRAVELS_DEG),
    shape_units={"travel_deg": "deg", REVERSAL_SPEED: "rad/s"},
    closer=rubbing(by_speed=True, least_speed=LEAST_JOINT_SPEED),
    followed={"coulomb_mcp": "MCP friction, Coulomb", "coulomb_pip": "PIP friction, Coulomb"},
    formula=Formula(
        equation=r"\tau_j = C_j\,z(\theta_j;\delta)",
        symbols=(
            "C_j: friction torque. z: friction state between −1 and 1; after a reversal it runs to "
            'the other side over the travel δ (theory, "Friction that sticks"); or it goes by the speed, as '
            "its hyperbolic tangent over v_r. Both are tried."
        ),
        source=(
            "Coulomb 1785 (Olsson et al. 1998); how it builds up after a reversal: Al-Bender, "
            "Lampaert and Swevers 2005."
        ),
        values={"coulomb_mcp": "C_1", "coulomb_pip": "C_2", "travel_deg": r"\delta", REVERSAL_SPEED: "v_r"},
        alike=("stribeck_friction", "presliding_hysteresis", "motor_coulomb_friction", "capstan_friction"),
    ),
    example=Example(
        {"travel_deg": 0.12, "sharpness": 1.0},
        {"mcp": np.radians([0.0, 0.03, 1.0, 0.97])},
        {"MCP coulomb_mcp": [0.0, 0.5, 1.0, 0.5], "PIP coulomb_pip": 0.0},
    ),
)

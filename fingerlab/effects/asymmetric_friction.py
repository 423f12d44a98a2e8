"""Friction in motor and gearbox that differs between the two directions."""

import numpy as np

from fingerlab.effects.base import (
    BESIDE_A_FINGER,
    BOTH_JOINTS,
    REVERSAL_SPEED,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    rubbing,
)
from fingerlab.effects.transmission import FRICTION, WINDING_SHAPES, coulomb_terms, drive_terms, pull_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import LOSS, Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """Friction of its own size in each direction: Coulomb friction of their mean, and half their difference.

    What sticks knows no zero between the two sizes, so that the difference is a constant torque at all times:
    of a motor alone, whose torque has an offset that nobody knows, it cannot be told.
    """
    one = motion.remember("constant drag", lambda: np.full_like(motion.position, 1.0 / motion.radius))
    constant = (
        drive_terms(motion, "difference", one) if motion.finger is None else pull_terms("difference", one)
    )
    return coulomb_terms(motion, shape) + constant


EFFECT = Effect(
    id="asymmetric_friction",
    title="Motor friction that differs by direction",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        "coulomb": FRICTION,
        "difference": Parameter(
            "N m",
            -0.05,
            0.05,
            0.005,
            title="more of it winding in than paying out, half",
            excess_of="coulomb",
            degenerate_with=LOSS,
        ),
    },
    columns=columns,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, and more of it in one direction of travel.",
    reveal="slow sines on the motor bench",
    mend="Have gearbox and brushes looked after, or let the motor's command add the friction of "
    "either direction.",
    shapes=WINDING_SHAPES,
    shape_units={"travel_deg": "deg", REVERSAL_SPEED: "rad/s"},
    closer=rubbing(by_speed=True),
    bench=BESIDE_A_FINGER,
    formula=Formula(
        equation=r"\tau_m = C\,z(\theta_m;\delta) + D",
        symbols=(
            "C: mean of the friction in either direction. D: half of what it is more winding in than "
            "paying out; a friction that sticks has no zero between its two sizes, so that D is "
            "there at all times. z goes by the travel δ, or by the speed, as its hyperbolic tangent over v_r."
        ),
        source=(
            "Coulomb friction with an offset, as in the EMPS benchmark (Janot, Gautier and Brunot 2019)."
        ),
        values={"coulomb": "C", "difference": "D", "travel_deg": r"\delta", REVERSAL_SPEED: "v_r"},
        alike=("motor_coulomb_friction",),
    ),
    example=Example(
        {"travel_deg": 0.3},
        {"position": [0.0, 0.1]},
        {"BENCH coulomb": [0.0, 1.0], "BENCH difference": 1.0},
        on_bench=True,
    ),
)

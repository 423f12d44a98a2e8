"""Friction of the joints that builds up over degrees (Dahl)."""

import math

import numpy as np

from fingerlab.effects.base import (
    PRESLIDING_TRAVELS_DEG,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    dahl_or_masing,
)
from fingerlab.effects.joints import COULOMB, both, friction_of_joints, joint_terms
from fingerlab.physics.friction_states import dahl_states, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    if shape.get("masing"):
        return joint_terms("dahl", *friction_of_joints(motion, shape))

    def state(name: str, angle: Array) -> Array:
        travels = with_grid(shape["travel_deg"], PRESLIDING_TRAVELS_DEG)
        keys = [("dahl", name, travel) for travel in travels]
        return motion.remember_each(keys[0], keys, lambda: dahl_states(angle, np.radians(travels)))

    return joint_terms("dahl", state("mcp", joints.mcp), state("pip", joints.pip))


EFFECT = Effect(
    id="presliding_hysteresis",
    title="Presliding hysteresis (Dahl)",
    family="Joint friction",
    acts_on=("joint_torque",),
    gains=both("dahl", COULOMB),
    columns=columns,
    coordinate="joint speed",
    equation=Row.PIP,
    explanation="After each reversal the missing torque builds up over a small travel of the joint.",
    reveal="sines of small amplitude, 2 to 5 degrees",
    mend="Reverse less often and move by more degrees at a time, or exchange plain hinges for ball bearings.",
    shapes=tuple({"travel_deg": travel} for travel in PRESLIDING_TRAVELS_DEG),
    shape_units={"travel_deg": "deg"},
    closer=dahl_or_masing,
    formula=Formula(
        equation=(
            r"\tau_j = C_j\,z_j,\qquad \frac{dz_j}{d\theta_j} = \frac{1 - "
            r"z_j\,\mathrm{sgn}\,\dot\theta_j}{\delta}"
        ),
        symbols=(
            "C_j: friction torque. z_j: Dahl's state, or spring-sliders (theory, \"Friction that "
            'sticks"). δ: travel over which it builds up.'
        ),
        source="Dahl 1968; spring-sliders: Al-Bender, Lampaert and Swevers 2005.",
        values={"dahl_mcp": "C_1", "dahl_pip": "C_2", "travel_deg": r"\delta"},
        alike=("coulomb_friction", "motor_presliding", "viscoelastic_creep"),
    ),
    example=Example(
        {"travel_deg": 2.0}, {"pip": np.radians([0.0, 2.0])}, {"PIP dahl_pip": [0.0, 1.0 - math.exp(-1.0)]}
    ),
)

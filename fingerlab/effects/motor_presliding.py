"""Friction in motor and gearbox that builds up over degrees (Dahl)."""

import math

import numpy as np

from fingerlab.effects.base import (
    BOTH_JOINTS,
    PRESLIDING_TRAVELS_DEG,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    dahl_or_masing,
)
from fingerlab.effects.transmission import FRICTION, drive_terms, winding_state
from fingerlab.physics.friction_states import dahl_states, with_grid
from fingerlab.physics.motion import Motion


def columns(motion: Motion, shape: Shape) -> list[Term]:
    if shape.get("masing"):
        curve = shape.get("sharpness", 0.0), shape.get("start", 1.0)
        winding = winding_state(motion, shape["travel_deg"], *curve)
        return drive_terms(motion, "dahl", winding)
    travels = with_grid(shape["travel_deg"], PRESLIDING_TRAVELS_DEG)
    keys = [("dahl", travel) for travel in travels]
    state = motion.remember_each(keys[0], keys, lambda: dahl_states(motion.position, np.radians(travels)))
    return drive_terms(motion, "dahl", state)


EFFECT = Effect(
    id="motor_presliding",
    title="Presliding on the motor side",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={"dahl": FRICTION},
    columns=columns,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}; it builds up over a small travel after a reversal.",
    reveal="small sines, 1 to 5 degrees, on the motor bench",
    reveal_of_an_axis="small motions that turn round often",
    mend="Reverse less often, or add a small dither to the motor's command.",
    shapes=tuple({"travel_deg": value} for value in PRESLIDING_TRAVELS_DEG),
    shape_units={"travel_deg": "deg"},
    closer=dahl_or_masing,
    bench=True,
    formula=Formula(
        equation=(
            r"\tau_m = C\,z,\qquad \frac{dz}{d\theta_m} = \frac{1 - "
            r"z\,\mathrm{sgn}\,\dot\theta_m}{\delta}"
        ),
        symbols=(
            "C: friction torque. z: Dahl's state, or spring-sliders (theory, \"Friction that "
            'sticks"). δ: travel over which it builds up.'
        ),
        source="Dahl 1968; spring-sliders: Al-Bender, Lampaert and Swevers 2005.",
        values={"dahl": "C", "travel_deg": r"\delta"},
        alike=("motor_coulomb_friction", "backlash", "presliding_hysteresis"),
    ),
    example=Example(
        {"travel_deg": 2.0},
        {"position": np.radians([0.0, 2.0])},
        {"BENCH dahl": [0.0, 1.0 - math.exp(-1.0)]},
        on_bench=True,
    ),
)

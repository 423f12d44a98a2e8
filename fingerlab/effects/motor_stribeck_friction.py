"""Stribeck friction in motor and gearbox: Coulomb friction that is larger near zero speed."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fingerlab.effects.base import (
    ALONE,
    BOTH_JOINTS,
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
    rubbing,
    times,
)
from fingerlab.effects.transmission import (
    FRICTION,
    USUAL_STICKING_DEG,
    coulomb_terms,
    drive_state,
    drive_terms,
)
from fingerlab.physics.motion import Motion

LEAST_STRIBECK_SPEED = 0.025
"""Speed, rad/s, below which no friction falls with the speed: what is larger there is how it turns round,
more steeply than any hyperbolic tangent that is tried; assumed: a quarter of the slowest one tried."""
SPEEDS = tuple({"stribeck_speed": value} for value in (0.1, 0.3, 0.8, 2.0))


def columns(motion: Motion, shape: Shape) -> list[Term]:
    rubbing = {"travel_deg": USUAL_STICKING_DEG, **shape}
    state = drive_state(motion, rubbing)
    slow = np.exp(-((motion.velocity / shape["stribeck_speed"]) ** 2))
    return coulomb_terms(motion, rubbing) + drive_terms(motion, "extra", state * slow)


def _seen(motions: Sequence[Motion]) -> tuple[Shape, ...]:
    alone = [{**shape, ALONE: 1.0} for shape in SPEEDS]
    return (*alone, *({**shape, REVERSAL_SPEED: 0.02} for shape in alone))


def _with_travel(shape: Shape) -> tuple[Shape]:
    if REVERSAL_SPEED in shape:
        return (shape,)
    return ({"travel_deg": USUAL_STICKING_DEG, **shape},)


EFFECT = Effect(
    id="motor_stribeck_friction",
    title="Stribeck friction in motor and gearbox",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        "coulomb": FRICTION,
        "extra": replace(FRICTION, title="friction added near standstill", excess_of="coulomb"),
    },
    columns=columns,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}; it flips sign with motor speed, larger when slow.",
    reveal="a chirp from 0.1 to 3 Hz on the motor bench",
    reveal_of_an_axis="motion from very slow to fast",
    mend="Grease the gearbox, and keep the motor from creeping: it is largest at low speed.",
    shapes=SPEEDS,
    shape_units={"stribeck_speed": "rad/s", REVERSAL_SPEED: "rad/s"},
    shapes_seen=_seen,
    switches_seen=(ALONE,),
    closer=every(
        _with_travel,
        times("stribeck_speed", SPEED_FACTORS, LEAST_STRIBECK_SPEED),
        rubbing(OCTAVE[1:-1], (0.0, 1.0), OCTAVE, by_speed=True),
    ),
    bench=True,
    formula=Formula(
        equation=r"\tau_m = z(\theta_m;\delta)\left(C + E\,e^{-(\dot\theta_m/v_s)^2}\right)",
        symbols=(
            "C: friction torque at speed. E: what is added near zero speed. v_s: Stribeck speed. z: "
            "friction state, with δ = 0.3 degrees, or the hyperbolic tangent of the speed over v_r; both "
            "are tried."
        ),
        source="Stribeck 1902, with the exponential of the squared speed (Olsson et al. 1998).",
        values={"coulomb": "C", "extra": "E", "stribeck_speed": "v_s", REVERSAL_SPEED: "v_r"},
        alike=("motor_coulomb_friction", "motor_presliding"),
    ),
    example=Example(
        {"stribeck_speed": 0.3},
        {"position": [0.0, 0.1], "velocity": [0.0, 0.3]},
        {"BENCH coulomb": [0.0, 1.0], "BENCH extra": [0.0, math.exp(-1.0)]},
        on_bench=True,
    ),
)

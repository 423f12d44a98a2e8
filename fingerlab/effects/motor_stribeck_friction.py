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
    STICK_DAMPING,
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
    with_damping,
)
from fingerlab.effects.transmission import (
    FRICTION,
    USUAL_STICKING_DEG,
    coulomb_terms,
    damped,
    drive_state,
    drive_terms,
)
from fingerlab.physics.friction_states import lagging_state
from fingerlab.physics.motion import Motion

LEAST_STRIBECK_SPEED = 0.025
"""Speed, rad/s, below which no friction falls with the speed: what is larger there is how it turns round,
more steeply than any hyperbolic tangent that is tried; assumed: a quarter of the slowest one tried."""
SPEEDS = tuple({"stribeck_speed": value} for value in (0.1, 0.3, 0.8, 2.0))


def columns(motion: Motion, shape: Shape) -> list[Term]:
    rubbing = {"travel_deg": USUAL_STICKING_DEG, **shape}
    slow = np.exp(-((motion.velocity / shape["stribeck_speed"]) ** 2))
    if STICK_DAMPING in shape:
        lagging = lagging_state(motion.position, slow, float(np.radians(rubbing["travel_deg"])))
        extra = damped(motion, lagging, shape)
    else:
        extra = drive_state(motion, rubbing) * slow
    return coulomb_terms(motion, rubbing) + drive_terms(motion, "extra", extra)


def _seen(motions: Sequence[Motion]) -> tuple[Shape, ...]:
    alone = [{**shape, ALONE: 1.0} for shape in SPEEDS]
    return (*alone, *({**shape, REVERSAL_SPEED: 0.02} for shape in alone))


def _with_travel(shape: Shape) -> tuple[Shape]:
    if REVERSAL_SPEED in shape:
        return (shape,)
    return ({"travel_deg": USUAL_STICKING_DEG, **shape},)


def _undamped(shape: Shape) -> list[Shape]:
    """Around the one found, at other Stribeck speeds, too; of a motor alone also far from it, at this one."""
    near = rubbing(OCTAVE[1:-1], (0.0, 1.0), OCTAVE, by_speed=True, afar=False)
    speeds = times("stribeck_speed", SPEED_FACTORS, LEAST_STRIBECK_SPEED)
    around = list(every(_with_travel, speeds, near)(shape))
    if shape.get(ALONE):
        far = every(_with_travel, rubbing(OCTAVE[1:-1], (0.0, 1.0), OCTAVE))(shape)
        around += [one for one in far if one not in around]
    return around


def _closer(shape: Shape) -> list[Shape]:
    """Around the one found; where what sticks is damped, at other Stribeck speeds as well."""
    others = times("stribeck_speed", OCTAVE[2:-2], LEAST_STRIBECK_SPEED)(shape)
    return [*with_damping(_undamped)(shape), *(others if STICK_DAMPING in shape else [])]


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
    shape_units={"stribeck_speed": "rad/s", REVERSAL_SPEED: "rad/s", STICK_DAMPING: "s"},
    shapes_seen=_seen,
    switches_seen=(ALONE,),
    closer=falling(_closer),
    bench=True,
    formula=Formula(
        equation=r"\tau_m = z(\theta_m;\delta)\left(C + E\,e^{-(\dot\theta_m/v_s)^2}\right)",
        symbols=(
            "C: friction torque at speed. E: what is added near zero speed. v_s: Stribeck speed. z: "
            "friction state, with δ = 0.3 degrees, or the hyperbolic tangent of the speed over v_r; both "
            "are tried. Of a motor alone what sticks may be damped: z + t_d dz/dt, and what is added near "
            "zero speed then follows the speed over the travel δ, too, as in the LuGre model."
        ),
        source=(
            "Stribeck 1902, with the exponential of the squared speed (Olsson et al. 1998); damping and lag: "
            "Canudas de Wit et al. 1995."
        ),
        values={
            "coulomb": "C",
            "extra": "E",
            "stribeck_speed": "v_s",
            REVERSAL_SPEED: "v_r",
            STICK_DAMPING: "t_d",
        },
        alike=("motor_coulomb_friction", "motor_presliding"),
    ),
    example=Example(
        {"stribeck_speed": 0.3},
        {"position": [0.0, 0.1], "velocity": [0.0, 0.3]},
        {"BENCH coulomb": [0.0, 1.0], "BENCH extra": [0.0, math.exp(-1.0)]},
        on_bench=True,
    ),
)

"""A cable that gives, with a damper beside its spring."""

import math
from collections.abc import Sequence

import numpy as np

from fingerlab.effects.base import (
    REVERSAL_SPEED,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    either,
    of_shape,
    times,
)
from fingerlab.effects.transmission import DRIVE, SHARES, driven_tension, sheath_loss
from fingerlab.physics.friction_states import first_order_lags, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import CABLE_SIGN, Array

LAGS_S = (0.004, 0.008, 0.016, 0.032)
"""Time constants of a damper beside the cable's spring, s; assumed."""


SHEATH = {
    f"sheath_{name}": (of_shape("capstan_friction", name),)
    for name in ("travel_deg", "sharpness", "held", "stretch_behind", REVERSAL_SPEED)
}
"""Numbers of a shape that tell where a sheath lies and how it sticks, or by which speed it goes."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What a damper beside the cable's spring takes from the stretch: the tension lags by the time constant.

    The stretch itself is the compliance that every model carries, set free; this term replaces the tension in
    it by the lagging one: what motor, gearbox and a sheath before it leave the cable. Beside a rotor that
    nobody weighed the torque's lag alone would miss as much as the tension's.
    """
    time_constant = shape["time_constant"]
    if time_constant == 0:
        return []

    constants = with_grid(time_constant, LAGS_S)
    followed = tuple(shape.get(name, 0.0) for name in FOLLOWING)
    keys = [("lag", *followed, constant) for constant in constants]
    tension = _stretching(motion, shape)
    lagging = motion.remember_each(
        keys[0], keys, lambda: first_order_lags(tension, constants, motion.sample_rate_hz)
    )
    return [Term(Row.CABLE, "", lagging - tension, "compliance", constant=-1.0)]


def _stretching(motion: Motion, shape: Shape) -> Array:
    """Tension on the cable's spring, N, (n,), as far as the shape tells what is lost before it."""
    tension = driven_tension(motion, shape)
    if not shape.get("sheath_stretch_behind"):
        return tension
    names = ("travel_deg", "sharpness", "held", REVERSAL_SPEED)
    law = {name: shape.get(f"sheath_{name}", 0.0) for name in names}
    sheath = {**shape, **{name: number for name, number in law.items() if number}}
    losses = (shape.get(f"share_{cable}", 0.0) * sheath_loss(motion, sheath, cable) for cable in CABLE_SIGN)
    return np.asarray(tension - sum(losses))


def _closer(shape: Shape) -> Sequence[Shape]:
    """Around the time constant found, or below the grid's least where none was."""
    if shape["time_constant"] == 0.0:
        return either("time_constant", (0.0, LAGS_S[0] / 4, LAGS_S[0] / 2, LAGS_S[0]))(shape)
    return times("time_constant")(shape)


FOLLOWING = {**DRIVE, **SHARES, **SHEATH}
"""What a shape takes from the unknowns of its model, and from the sheath's shape."""

EFFECT = Effect(
    id="cable_stretch",
    title="Cable stretch",
    family="Cable",
    acts_on=("cable_kinematics",),
    gains={},
    columns=columns,
    shapes=tuple({"time_constant": value} for value in (0.0, *LAGS_S)),
    shape_units={"time_constant": "s"},
    closer=_closer,
    follows=FOLLOWING,
    relaxes={
        "cable_compliance": Parameter(
            "m/N", 0.0, 5e-3, 1e-4, "assumed: a fabric glove gives 2 mm a newton", "cable compliance"
        ),
        "cable_damping": Parameter(
            "m s/N", -5e-5, 5e-5, 2e-6, title="stretch by the tension's rate (below 0: it lags)"
        ),
    },
    coordinate="tension",
    equation=Row.CABLE,
    explanation="The cable that is wound beyond what the joints call for is proportional to the tension.",
    reveal="a contact run, where the tension changes much and the joints hardly move",
    mend="Use a stiffer or a shorter cable.",
    formula=Formula(
        equation=r"x = c\,\bar T + d\,\dot T,\qquad T_c\,\dot{\bar T} + \bar T = T",
        symbols=(
            "c: compliance of the cable. d: stretch by the tension's rate (a damper has d below 0). "
            "T_c: time by which a damper beside the spring lets the stretch lag."
        ),
        source=(
            "Hooke's law with damping (standard linear solid, Zener 1948); the thesis suspects "
            "elasticity and has no equation for it."
        ),
        values={"cable_compliance": "c", "cable_damping": "d", "time_constant": "T_c"},
        alike=("motor_spring", "stiffness_error", "backlash"),
    ),
    example=Example(
        {"time_constant": 1.0 / math.log(2.0)},
        {"torque": [0.0, 0.02, 0.02]},
        {"CABLE ": [0.0, -1.0 / math.log(2.0), -0.5 / math.log(2.0)]},
        sample_rate_hz=1.0,
    ),
)

"""A cable that gives, with a damper beside its spring, and maybe the stiffer the more it is pulled."""

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
STIFFENS_AT = "stiffens_at"
"""Number of a shape, N: tension at which a cable that stiffens gives 1.6 times less than it does slack."""
STIFFENING_N = (10.0, 40.0)
"""Where that is looked for: a braid beds in under the loads of a hand, and a cable that stiffens at ten times
its load gives less by a tenth there; assumed. In reduced units, as all that is tried."""
STIFFENING_FACTORS = tuple(2.0 ** (k / 2) for k in range(-4, 5))
SHEATH_TAKES = ("travel_deg", "sharpness", "held", "stretch_behind", REVERSAL_SPEED)

SHEATH = {f"sheath_{name}": (of_shape("capstan_friction", name),) for name in SHEATH_TAKES}
"""Numbers of a shape that tell where a sheath lies and how it sticks, or by which speed it goes."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What a damper beside the cable's spring takes from the stretch: the tension lags by the time constant.

    The stretch itself is the compliance that every model carries, set free; this term replaces the tension in
    it by the lagging one: what motor, gearbox and a sheath before it leave the cable. Beside a rotor that
    nobody weighed the torque's lag alone would miss as much as the tension's. A cable that stiffens is
    stretched as by less of the tension.
    """
    time_constant, stiffens_at = shape["time_constant"], shape.get(STIFFENS_AT, 0.0)
    if not (time_constant or stiffens_at):
        return []

    tension = _stretching(motion, shape)
    linear = linear_pull(tension, stiffens_at)
    if not time_constant:
        return [Term(Row.CABLE, "", linear - tension, "compliance", constant=-1.0)]
    constants = with_grid(time_constant, LAGS_S)
    followed = (*(shape.get(name, 0.0) for name in FOLLOWING), stiffens_at)
    keys = [("lag", *followed, constant) for constant in constants]
    lagging = motion.remember_each(
        keys[0], keys, lambda: first_order_lags(linear, constants, motion.sample_rate_hz)
    )
    return [Term(Row.CABLE, "", lagging - tension, "compliance", constant=-1.0)]


def linear_pull(tension: Array, stiffens_at: float) -> Array:
    """What would stretch a cable of the stiffness that it has slack as far as the tension does; N, (n,).

    Of a cable with the tension k x (1 + k x / T_s), stretched by x: k x. T_s is ``stiffens_at``; 0: never.
    """
    if not stiffens_at:
        return tension
    return 2.0 * tension / (1.0 + np.sqrt(1.0 + 4.0 * np.maximum(tension, 0.0) / stiffens_at))


def _stretching(motion: Motion, shape: Shape) -> Array:
    """Tension on the cable's spring, N, (n,), as far as the shape tells what is lost before it."""
    tension = driven_tension(motion, shape)
    if not shape.get("sheath_stretch_behind"):
        return tension
    names = (name for name in SHEATH_TAKES if name != "stretch_behind")
    law = {name: shape.get(f"sheath_{name}", 0.0) for name in names}
    sheath = {**shape, **{name: number for name, number in law.items() if number}}
    losses = (shape.get(f"share_{cable}", 0.0) * sheath_loss(motion, sheath, cable) for cable in CABLE_SIGN)
    return np.asarray(tension - sum(losses))


def _closer(shape: Shape) -> Sequence[Shape]:
    """Around the time constant found, or below the grid's least where none was; stiffening more or less."""
    if shape["time_constant"] == 0.0:
        lags = either("time_constant", (0.0, LAGS_S[0] / 4, LAGS_S[0] / 2, LAGS_S[0]))(shape)
    else:
        lags = times("time_constant")(shape)
    if STIFFENS_AT not in shape:
        return [*lags, *either(STIFFENS_AT, STIFFENING_N)(shape)]
    straight = {name: number for name, number in shape.items() if name != STIFFENS_AT}
    stiffer = times(STIFFENS_AT, STIFFENING_FACTORS)(shape)
    return [*lags, *(one for one in stiffer if one not in lags), straight]


FOLLOWING = {**DRIVE, **SHARES, **SHEATH}
"""What a shape takes from the unknowns of its model, and from the sheath's shape."""

EFFECT = Effect(
    id="cable_stretch",
    title="Cable stretch",
    family="Cable",
    acts_on=("cable_kinematics",),
    gains={},
    columns=columns,
    shapes=(
        *({"time_constant": value} for value in (0.0, *LAGS_S)),
        {"time_constant": 0.0, STIFFENS_AT: math.sqrt(math.prod(STIFFENING_N))},
    ),
    shape_units={"time_constant": "s", STIFFENS_AT: "N"},
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
    explanation="The cable that is wound beyond what the joints call for grows with the tension.",
    reveal="a contact run, where the tension changes much and the joints hardly move",
    mend="Use a stiffer or a shorter cable.",
    formula=Formula(
        equation=(
            r"x = c\,\bar T + d\,\dot T,\qquad T_c\,\dot{\bar T} + \bar T = T_l,\qquad "
            r"T = T_l\,(1 + T_l / T_s)"
        ),
        symbols=(
            "c: compliance of the cable. d: stretch by the tension's rate (a damper has d below 0). "
            "T_c: time by which a damper beside the spring lets the stretch lag. T_s: tension at which a "
            "cable that stiffens gives 1.6 times less than it does slack; where it does not, T_l is T."
        ),
        source=(
            "Hooke's law with damping (standard linear solid, Zener 1948); the thesis suspects "
            "elasticity and has no equation for it."
        ),
        values={"cable_compliance": "c", "cable_damping": "d", "time_constant": "T_c", STIFFENS_AT: "T_s"},
        alike=("motor_spring", "stiffness_error", "backlash"),
    ),
    example=Example(
        {"time_constant": 1.0 / math.log(2.0)},
        {"torque": [0.0, 0.02, 0.02]},
        {"CABLE ": [0.0, -1.0 / math.log(2.0), -0.5 / math.log(2.0)]},
        sample_rate_hz=1.0,
    ),
)

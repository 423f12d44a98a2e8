"""A cable that gives, with a damper beside its spring."""

import math

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, times
from fingerlab.physics.friction_states import first_order_lags, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

LAGS_S = (0.004, 0.008, 0.016, 0.032)
"""Time constants of a damper beside the cable's spring, s; assumed."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What a damper beside the cable's spring takes from the stretch: the tension lags by the time constant.

    The stretch itself is the compliance that every model carries, set free; these terms replace the tension
    in it by the lagging one.
    """
    time_constant = shape["time_constant"]
    if time_constant == 0:
        return []

    constants = with_grid(time_constant, LAGS_S)

    def change(name: str, values: Array) -> Array:
        keys = [("lag", name, constant) for constant in constants]
        lagging = motion.remember_each(
            keys[0], keys, lambda: first_order_lags(values, constants, motion.sample_rate_hz)
        )
        return lagging - values

    inertia = motion.motor.inertia or 0.0
    return [
        Term(Row.CABLE, "", change("tension", motion.tension), "compliance", constant=-1.0),
        Term(Row.CABLE, "", change("pull", motion.inertial_pull), "compliance", constant=inertia),
    ]


EFFECT = Effect(
    id="cable_stretch",
    title="Cable stretch",
    family="Cable",
    acts_on=("cable_kinematics",),
    gains={},
    columns=columns,
    shapes=tuple({"time_constant": value} for value in (0.0, *LAGS_S)),
    shape_units={"time_constant": "s"},
    closer=times("time_constant"),
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
        {"CABLE ": [0.0, -1.0, -0.5]},
        sample_rate_hz=1.0,
    ),
)

"""Joint springs that relax: a spring in series with a damper beside each (standard linear solid)."""

import math

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, times
from fingerlab.effects.joints import both, joint_terms
from fingerlab.physics.friction_states import first_order_lags, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

RELAXING_S = (0.1, 0.2, 0.35, 0.6, 1.1, 1.9, 3.3)
"""Time constants of creep, s; assumed: those that runs of half a minute can show."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What a spring in series with a damper still holds: the angle less its lag.

    The lag begins as if the finger had hung there for long; what it had not relaxed of an earlier angle when
    the run began dies away beside it.
    """
    _, joints = motion.finger_and_joints
    constants = with_grid(shape["time_constant"], RELAXING_S)

    def relaxing(name: str, angle: Array) -> Array:
        keys = [("lag", name, constant) for constant in constants]
        rate = motion.sample_rate_hz
        return angle - motion.remember_each(keys[0], keys, lambda: first_order_lags(angle, constants, rate))

    fading = np.exp(-motion.time / shape["time_constant"])
    return [
        *joint_terms("relaxing", relaxing("mcp", joints.mcp), relaxing("pip", joints.pip)),
        *joint_terms("start", fading, fading),
    ]


EFFECT = Effect(
    id="viscoelastic_creep",
    title="Viscoelastic creep",
    family="Springs of the joints",
    acts_on=("joint_torque",),
    gains=both("relaxing", Parameter("N m/rad", 0.0, 0.06, 0.01, title="relaxing stiffness"))
    | both("start", Parameter("N m", -0.03, 0.03, 0.002, title="torque not yet relaxed at the start")),
    columns=columns,
    coordinate="time",
    equation=Row.PIP,
    explanation="After a change of angle an extra spring torque appears and dies away.",
    reveal="steps, each held for several seconds",
    mend="Hold until the springs have settled before you measure, or use steel springs.",
    shapes=tuple({"time_constant": value} for value in RELAXING_S),
    shape_units={"time_constant": "s"},
    closer=times("time_constant"),
    formula=Formula(
        equation=(
            r"\tau_j = K_{rj}(\theta_j - \bar\theta_j) + \tau_{0j}\,e^{-t/T_r},\qquad "
            r"T_r\,\dot{\bar\theta}_j + \bar\theta_j = \theta_j"
        ),
        symbols=(
            "K_rj: stiffness that relaxes. T_r: time constant of the relaxation (standard linear "
            "solid). τ_0j: torque that had not relaxed when the run began."
        ),
        source="Standard linear solid (Zener 1948).",
        values={
            "relaxing_mcp": "K_{r1}",
            "relaxing_pip": "K_{r2}",
            "start_mcp": r"\tau_{01}",
            "start_pip": r"\tau_{02}",
            "time_constant": "T_r",
        },
        alike=("presliding_hysteresis", "viscous_friction", "transport_delay"),
    ),
    example=Example(
        {"time_constant": 1.0 / math.log(2.0)},
        {"mcp": [0.0, 1.0, 1.0], "time": [0.0, 1.0, 2.0]},
        {
            "MCP relaxing_mcp": [0.0, 0.5 / math.log(2.0), 0.25 / math.log(2.0)],
            "PIP start_pip": [1.0, 0.5, 0.25],
        },
        sample_rate_hz=1.0,
    ),
)

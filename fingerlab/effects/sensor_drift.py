"""An angle sensor that drifts as it warms up."""

import math
from collections.abc import Sequence

import numpy as np

from fingerlab.effects.base import FINE_OCTAVE, Effect, Example, Formula, Row, Shape, Term, times
from fingerlab.effects.joints import angle_error_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

STEADY_S = 1e4
"""A sensor that warms up so slowly drifts steadily, s."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A sensor that warms up since the run began: fast at first and ever slower, with a time constant (s)."""
    warm = shape["time_constant"]
    drifted = -warm * np.expm1(-motion.time / warm)
    return angle_error_terms(motion, "rate", drifted, drifted)


def _warming_closer(shape: Shape) -> Sequence[Shape]:
    """Finer time constants; of a steady drift there are none."""
    return [shape] if shape["time_constant"] == STEADY_S else times("time_constant", FINE_OCTAVE)(shape)


EFFECT = Effect(
    id="sensor_drift",
    title="Drift of an angle sensor",
    family="Sensors",
    acts_on=("joint_torque", "cable_kinematics"),
    gains={
        f"rate_{joint}": Parameter(
            "rad/s",
            -0.01,
            0.01,
            0.0005,
            "assumed: 0.64 degrees (KMA210 data sheet) in a second",
            "drift rate",
        )
        for joint in ("mcp", "pip")
    },
    columns=columns,
    coordinate="time",
    equation=Row.CABLE,
    explanation="The misfit grows over each run, whatever the motion.",
    reveal="a run of several minutes at rest",
    mend="Let the sensors warm up before the first run, and keep the runs short.",
    shapes=tuple({"time_constant": value} for value in (5.0, 10.0, 20.0, 40.0, STEADY_S)),
    shape_units={"time_constant": "s"},
    closer=_warming_closer,
    formula=Formula(
        equation=(
            r"e_j = \rho_j \tau_w\,(1 - e^{-t/\tau_w}),\qquad \tau_j = -\sum_k \frac{\partial "
            r"Q_j}{\partial\theta_k}\,e_k,\qquad x = -s(a e_1 + b e_2)"
        ),
        symbols=(
            "ρ_j: drift rate at first; τ_w: time constant of the warming; t counts from the start of "
            "the run. Q_j: what springs, gravity and contact ask of joint j."
        ),
        source=(
            "NXP KMA210 data sheet: temperature drift 0.64°; the exponential of a sensor that warms "
            "up is ours."
        ),
        values={"rate_mcp": r"\rho_1", "rate_pip": r"\rho_2", "time_constant": r"\tau_w"},
        alike=("viscoelastic_creep",),
    ),
    example=Example(
        {"time_constant": 10.0},
        {"time": [0.0, 10.0]},
        {"CABLE rate_mcp": [0.0, -10.0 * (1.0 - math.exp(-1.0))]},
    ),
)

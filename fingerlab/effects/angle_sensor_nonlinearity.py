"""Harmonic error of the angle sensors."""

import math
from dataclasses import replace

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, either
from fingerlab.effects.joints import ANGLES, angle_error_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

HARMONIC = Parameter(
    "rad", -0.05, 0.05, 0.01, source="KMA210 data sheet: +-1 degree linearity", title="harmonic error"
)


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A harmonic of the angle, and in another law twice that harmonic beside it.

    A magnetoresistive bridge turns twice as fast as the magnet: its offset shows as the second harmonic of
    the angle, its unequal amplitudes as the fourth, and an error that is large, seen over the angle that it
    falsifies, has the double of its own harmonic in it.
    """
    _, joints = motion.finger_and_joints
    harmonics = {"": shape["harmonic"]}
    if shape.get("double"):
        harmonics["double_"] = 2.0 * shape["harmonic"]
    terms: list[Term] = []
    for prefix, n in harmonics.items():
        for name, wave in (("sine", np.sin), ("cosine", np.cos)):
            terms += angle_error_terms(motion, f"{prefix}{name}", wave(n * joints.mcp), wave(n * joints.pip))
    return terms


EFFECT = Effect(
    id="angle_sensor_nonlinearity",
    title="Harmonic error of the angle sensors",
    family="Sensors",
    acts_on=("joint_torque", "cable_kinematics"),
    gains={
        f"{prefix}{part}_{joint}": replace(HARMONIC, title=f"{title}, {part}")
        for prefix, title in (("", HARMONIC.title), ("double_", "error of the double harmonic"))
        for part in ("sine", "cosine")
        for joint in ANGLES
    },
    columns=columns,
    coordinate="joint angle",
    equation=Row.CABLE,
    explanation="Torque and cable length miss what an angle error with a harmonic would cause.",
    reveal="slow steps over the whole travel",
    mend="Centre the magnets, or calibrate the angle sensors over the whole travel in small steps.",
    shapes=tuple({"harmonic": float(n)} for n in (2, 4, 8)),
    shape_units={"harmonic": "1/turn"},
    closer=either("double", (0.0, 1.0)),
    formula=Formula(
        equation=(
            r"e_j = A_j\sin n\theta_j + B_j\cos n\theta_j + D_j\sin 2n\theta_j + E_j\cos "
            r"2n\theta_j,\qquad \tau_j = -\sum_k \frac{\partial Q_j}{\partial\theta_k}\,e_k,\qquad x "
            "= -s(a e_1 + b e_2)"
        ),
        symbols=(
            "e_j: by how much the sensor reads too much. n: harmonic, periods a turn of the joint; "
            "its double (D, E) is tried in the second look. Q_j: what springs, gravity and contact "
            "ask of joint j."
        ),
        source="NXP KMA210 data sheet: linearity ±1°; a magnetoresistive bridge sees twice the angle.",
        values={
            "sine_mcp": "A_1",
            "sine_pip": "A_2",
            "cosine_mcp": "B_1",
            "cosine_pip": "B_2",
            "double_sine_mcp": "D_1",
            "double_sine_pip": "D_2",
            "double_cosine_mcp": "E_1",
            "double_cosine_pip": "E_2",
            "harmonic": "n",
        },
        alike=("varying_moment_arm", "spring_hardening"),
    ),
    example=Example(
        {"harmonic": 2.0},
        {"mcp": 0.25 * math.pi},
        {
            "CABLE sine_mcp": -1.0,
            "CABLE cosine_mcp": 0.0,
            "CABLE cosine_pip": -1.0,
            # The MCP spring, 0.1 N m/rad, and gravity, 8e-3 N m times the cosine of the angle.
            "MCP sine_mcp": -0.1 - 8e-3 * math.sqrt(0.5),
        },
    ),
)

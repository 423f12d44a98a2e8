"""Mass that the budget left out: a point on the distal body."""

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """Torques of a unit mass at the share ``place`` of the distal body, 0 at the PIP joint, 1 at the tip."""
    f, q = motion.finger_and_joints
    l1, lever = 2 * f.proximal_half_length, 2 * f.distal_half_length * shape["place"]
    distal = q.mcp + q.pip - f.wrist_angle
    cos2, sin2 = np.cos(q.pip), np.sin(q.pip)
    rate, bend = q.mcp_velocity + q.pip_velocity, q.mcp_acceleration + q.pip_acceleration
    pip = (
        lever**2 * bend
        + lever * l1 * (cos2 * q.mcp_acceleration + sin2 * q.mcp_velocity**2)
        - f.gravity * lever * np.cos(distal)
    )
    mcp = (
        pip
        + l1**2 * q.mcp_acceleration
        + l1 * lever * (cos2 * bend - sin2 * rate**2)
        - f.gravity * l1 * np.cos(f.wrist_angle - q.mcp)
    )
    return [Term(Row.MCP, "mass", mcp, "joint"), Term(Row.PIP, "mass", pip, "joint")]


EFFECT = Effect(
    id="added_mass",
    title="Mass that the budget left out",
    family="Mass and gravity",
    acts_on=("joint_torque",),
    gains={"mass": Parameter("kg", 0.0, 0.02, 0.003, title="added mass")},
    columns=columns,
    coordinate="joint acceleration",
    equation=Row.MCP,
    explanation="The missing torques are those of more weight and inertia on the finger.",
    reveal="a chirp up to 3 Hz",
    mend="Weigh screws, magnets and covers and enter them in the rig file, or take them off.",
    shapes=tuple({"place": value} for value in (0.0, 0.5, 1.0)),
    shape_units={"place": "of the distal length"},
    formula=Formula(
        equation=(
            r"\begin{align*} \tau_2 &= m\left[c^2(\ddot\theta_1+\ddot\theta_2) + "
            r"cL(\cos\theta_2\,\ddot\theta_1 + \sin\theta_2\,\dot\theta_1^2) - g "
            r"c\cos(\theta_1+\theta_2-\alpha)\right] \\ \tau_1 &= \tau_2 + m\left[L^2\ddot\theta_1 + "
            r"Lc(\cos\theta_2(\ddot\theta_1+\ddot\theta_2) - "
            r"\sin\theta_2(\dot\theta_1+\dot\theta_2)^2) - g L\cos(\alpha-\theta_1)\right] "
            r"\end{align*}"
        ),
        symbols=(
            "m: added mass, a point on the distal body. L = 2 l₁. c = 2 l₂ times the place: 0 at the "
            "PIP joint, 1 at the tip."
        ),
        source=(
            "Ours: Lagrange's equation (3.5) of a point mass; the thesis leaves screws, magnets and "
            "covers without mass."
        ),
        values={"mass": "m", "place": "c/2l_2"},
        alike=("gravity_tilt", "motor_inertia"),
    ),
    example=Example({"place": 1.0}, {}, {"MCP mass": -0.8, "PIP mass": -0.4}),
)

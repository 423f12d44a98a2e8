"""Moment arms that change with the joint angle."""

import math

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """a(theta1) = a (1 + p theta1), b(theta2) = b (1 + q theta2).

    The growth has a part that is the same for both routings, and a part that turns with the side on which
    the cable runs. The tension carries 1/a: its second order in p has a gain of its own, because p is not
    small (0.4/rad over 0.6 rad takes a quarter of the arm).
    """
    f, q = motion.finger_and_joints
    contact_mcp, contact_pip = motion.contact_torques
    mcp = nominal.mcp_torque(f, q).total + contact_mcp
    pip = nominal.pip_torque(f, q).total + contact_pip
    terms = [
        Term(Row.MCP, "bend_mcp", mcp * q.mcp**2, "joint"),
        Term(Row.PIP, "bend_pip", pip * q.pip**2, "joint"),
    ]
    for name, sign in (("growth", 1.0), ("turn", float(motion.cable_sign))):
        terms += [
            Term(Row.MCP, f"{name}_mcp", -sign * mcp * q.mcp, "joint"),
            Term(Row.PIP, f"{name}_pip", -sign * pip * q.pip, "joint"),
            Term(Row.CABLE, f"{name}_mcp", 0.5 * sign * q.mcp**2, "arm_mcp"),
            Term(Row.CABLE, f"{name}_pip", 0.5 * sign * q.pip**2, "arm_pip"),
        ]
    return terms


EFFECT = Effect(
    id="varying_moment_arm",
    title="Moment arm that changes with angle",
    family="Cable",
    acts_on=("joint_torque", "cable_kinematics"),
    gains={
        "growth_mcp": Parameter("1/rad", -1.0, 1.0, 0.2, title="growth of a with angle"),
        "growth_pip": Parameter("1/rad", -1.0, 1.0, 0.2, title="growth of b with angle"),
        "turn_mcp": Parameter("1/rad", -1.0, 1.0, 0.2, title="growth of a that turns with the routing"),
        "turn_pip": Parameter("1/rad", -1.0, 1.0, 0.2, title="growth of b that turns with the routing"),
        "bend_mcp": Parameter("1/rad^2", 0.0, 1.0, 0.04, title="growth of a, squared in the torque"),
        "bend_pip": Parameter("1/rad^2", 0.0, 1.0, 0.04, title="growth of b, squared in the torque"),
    },
    columns=columns,
    coordinate="joint angle",
    equation=Row.CABLE,
    explanation="Torque and cable length call for a moment arm that changes with the joint angle.",
    reveal="a slow sine over the whole travel",
    mend="Lead the cable over a round pulley at the joint, or use less of the travel.",
    formula=Formula(
        equation=(
            r"\begin{align*} a(\theta_1) &= a\,(1 + (p_1 + s\,q_1)\,\theta_1), \qquad b(\theta_2) = "
            r"b\,(1 + (p_2 + s\,q_2)\,\theta_2) \\ x &= \frac{1}{2} s\left[a(p_1 + s q_1)\theta_1^2 + "
            r"b(p_2 + s q_2)\theta_2^2\right] \end{align*}"
        ),
        symbols=(
            "p: growth that both routings share. q: growth that turns with the side on which the "
            "cable runs. The tension carries 1/a(θ₁), to second order in p; its square has a gain w "
            "of its own."
        ),
        source="Ours, by virtual work: a length that changes with the angle is an arm that does.",
        values={
            "growth_mcp": "p_1",
            "growth_pip": "p_2",
            "turn_mcp": "q_1",
            "turn_pip": "q_2",
            "bend_mcp": "w_1",
            "bend_pip": "w_2",
        },
        alike=("spring_hardening", "angle_sensor_nonlinearity"),
    ),
    example=Example(
        {},
        {"pip": 0.5 * math.pi},
        {
            # The PIP spring asks for 0.05 N m/rad times the angle; the distal body hangs straight down.
            "PIP bend_pip": 0.05 * (0.5 * math.pi) ** 3,
            "PIP growth_pip": -0.05 * (0.5 * math.pi) ** 2,
            "PIP turn_pip": 0.05 * (0.5 * math.pi) ** 2,
            "CABLE growth_pip": 0.5 * (0.5 * math.pi) ** 2,
        },
    ),
)

"""Moment arms that change with the joint angle."""

import math

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Scale, Shape, Term
from fingerlab.effects.joints import ANGLES
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

FOLLOWING = {
    f"{kind}_{joint}": (f"varying_moment_arm.{kind}_{joint}",)
    for kind in ("growth", "turn")
    for joint in ANGLES
}
"""What a shape takes from the unknowns of its model."""
LEAST_ARM = 0.2
"""Share of an arm that is left of it at least in the torque; assumed: no fit is to divide by nothing."""


def arms(motion: Motion, shape: Shape) -> dict[Row, Array]:
    """How many times as long as in the straight finger both arms are, (n,) each; {} where none is known."""
    if not any(shape.get(name) for name in FOLLOWING):  # the same columns for both cables
        return {}
    _, q = motion.finger_and_joints
    grown = _growth(motion, shape)
    return {
        row: np.maximum(1.0 + grown[joint] * angle, LEAST_ARM)
        for joint, row, angle in (("mcp", Row.MCP, q.mcp), ("pip", Row.PIP, q.pip))
    }


def _growth(motion: Motion, shape: Shape) -> dict[str, float]:
    """By what share a radian each arm grows with the cable at hand, by joint."""
    sign = float(motion.cable_sign)
    return {
        joint: shape.get(f"growth_{joint}", 0.0) + sign * shape.get(f"turn_{joint}", 0.0) for joint in ANGLES
    }


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """a(theta1) = a (1 + p theta1), b(theta2) = b (1 + q theta2).

    The growth has a part that is the same for both routings, and a part that turns with the side on which
    the cable runs. The tension carries 1/a. On the grid no growth is known, and the second order in p has a
    gain of its own, because p is not small (0.4/rad over 0.6 rad takes a quarter of the arm). Around the
    growth that was found everything that a joint calls for is divided by the arm (:func:`arms`), and only
    the change of 1/a with p is told here, to first order.
    """
    f, q = motion.finger_and_joints
    sign = float(motion.cable_sign)
    at_mcp, at_pip = motion.contact_torques
    each: tuple[tuple[str, Row, Array, Array, Scale], ...] = (
        ("mcp", Row.MCP, q.mcp, nominal.mcp_torque(f, q).total + at_mcp, "arm_mcp"),
        ("pip", Row.PIP, q.pip, nominal.pip_torque(f, q).total + at_pip, "arm_pip"),
    )
    terms, known, grown = [], arms(motion, shape), _growth(motion, shape)
    for joint, row, angle, torque, scale in each:
        if known:
            slope = -torque * angle / known[row] ** 2
            terms.append(Term(row, "", -grown[joint] * slope, "joint", constant=1.0))
        else:
            slope = -torque * angle
            terms.append(Term(row, f"bend_{joint}", torque * angle**2, "joint"))
        for name, side in (("growth", 1.0), ("turn", sign)):
            terms += [
                Term(row, f"{name}_{joint}", side * slope, "joint"),
                Term(Row.CABLE, f"{name}_{joint}", 0.5 * side * angle**2, scale),
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
    follows=FOLLOWING,
    arms=arms,
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
            "cable runs. The tension carries 1/a(θ₁): to second order in p, whose square has a gain w of "
            "its own, and exactly once p is known."
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

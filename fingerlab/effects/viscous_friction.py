"""Viscous friction of the joints."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.joints import both, joint_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

VISCOUS_GAIN = Parameter("N m s/rad", 0.0, 0.02, 0.002, title="viscous coefficient", varies_between_runs=True)


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    return joint_terms("viscous", joints.mcp_velocity, joints.pip_velocity)


EFFECT = Effect(
    id="viscous_friction",
    title="Viscous joint friction",
    family="Joint friction",
    acts_on=("joint_torque",),
    gains=both("viscous", VISCOUS_GAIN),
    columns=columns,
    coordinate="joint speed",
    equation=Row.PIP,
    explanation="The missing torque grows in proportion to joint speed and changes sign with it.",
    reveal="sines at two frequencies, 0.5 and 2 Hz, with the same amplitude",
    mend="Use a thinner grease in the hinges, or move more slowly.",
    followed={"viscous_mcp": "MCP friction, viscous", "viscous_pip": "PIP friction, viscous"},
    formula=Formula(
        equation=r"\tau_j = B_j\,\dot\theta_j",
        symbols="B_j: viscous coefficient of joint j.",
        source="Friction in proportion to speed, as in every survey of friction (Olsson et al. 1998).",
        values={"viscous_mcp": "B_1", "viscous_pip": "B_2"},
        alike=("motor_viscous_friction", "stribeck_friction", "transport_delay"),
    ),
    example=Example(
        {}, {"mcp_velocity": 2.0, "pip_velocity": -3.0}, {"MCP viscous_mcp": 2.0, "PIP viscous_pip": -3.0}
    ),
)

"""Joint springs with a cubic term."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.joints import both, joint_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    return joint_terms("cubic", joints.mcp * joints.mcp * joints.mcp, joints.pip * joints.pip * joints.pip)


EFFECT = Effect(
    id="spring_hardening",
    title="Spring hardening",
    family="Springs of the joints",
    acts_on=("joint_torque",),
    gains=both("cubic", Parameter("N m/rad^3", 0.0, 2.0, 0.1, title="cubic stiffness")),
    columns=columns,
    coordinate="joint angle",
    equation=Row.PIP,
    explanation="The missing torque grows with the cube of the joint angle.",
    reveal="a sine of larger amplitude and offset",
    mend="Use springs that stay linear over the travel, or a smaller motion.",
    formula=Formula(
        equation=r"\tau_j = K_{3j}\,\theta_j^3",
        symbols="K_3j: cubic stiffness.",
        source="Duffing 1918: a spring with a cubic term.",
        values={"cubic_mcp": "K_{31}", "cubic_pip": "K_{32}"},
        alike=("joint_stop", "stiffness_error", "varying_moment_arm"),
    ),
    example=Example({}, {"mcp": 2.0, "pip": -1.0}, {"MCP cubic_mcp": 8.0, "PIP cubic_pip": -1.0}),
)

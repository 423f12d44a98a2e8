"""Joint springs of another stiffness than the rig file says."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.joints import both, joint_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    return joint_terms("stiffness", joints.mcp, joints.pip)


EFFECT = Effect(
    id="stiffness_error",
    title="Other joint stiffness",
    family="Springs of the joints",
    acts_on=("joint_torque",),
    gains=both("stiffness", Parameter("N m/rad", -0.06, 0.06, 0.01, title="stiffness beyond nominal")),
    columns=columns,
    coordinate="joint angle",
    equation=Row.PIP,
    explanation="The missing torque is proportional to the joint angle.",
    reveal="steps over the whole travel",
    mend="Measure the stiffness of the joint springs and enter it in the rig file.",
    formula=Formula(
        equation=r"\tau_j = \Delta K_j\,\theta_j",
        symbols="ΔK_j: stiffness beyond that of the rig file.",
        source="Ours: the spring of (3.16) and (3.17) with another constant.",
        values={"stiffness_mcp": r"\Delta K_1", "stiffness_pip": r"\Delta K_2"},
        alike=("motor_spring", "spring_hardening", "joint_coupling", "motor_inertia"),
    ),
    example=Example({}, {"mcp": 0.2, "pip": -0.1}, {"MCP stiffness_mcp": 0.2, "PIP stiffness_pip": -0.1}),
)

"""A spring between MCP and PIP."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    difference = joints.mcp - joints.pip
    return [Term(Row.MCP, "coupling", difference, "joint"), Term(Row.PIP, "coupling", -difference, "joint")]


EFFECT = Effect(
    id="joint_coupling",
    title="Stiffness between MCP and PIP",
    family="Springs of the joints",
    acts_on=("joint_torque",),
    gains={"coupling": Parameter("N m/rad", 0.0, 0.06, 0.01, title="coupling stiffness")},
    columns=columns,
    coordinate="difference of joint angles",
    equation=Row.PIP,
    explanation="MCP and PIP miss equal and opposite torques that follow the difference of the angles.",
    reveal="a chirp, in which the two joints move in different proportion",
    mend="Free the skin, tape or cables that join the two phalanges.",
    formula=Formula(
        equation=r"\tau_1 = K_c(\theta_1 - \theta_2),\qquad \tau_2 = -\tau_1",
        symbols="K_c: stiffness between the joints.",
        source="Ours: a linear spring between the joints, assumed (tendon, skin, glove).",
        values={"coupling": "K_c"},
        alike=("stiffness_error",),
    ),
    example=Example({}, {"mcp": 0.3, "pip": 0.1}, {"MCP coupling": 0.2, "PIP coupling": -0.2}),
)

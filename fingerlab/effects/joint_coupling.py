"""A spring between MCP and PIP."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, either
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What bends one joint as the other bends, or, along both of them (``sum``), straightens it."""
    _, joints = motion.finger_and_joints
    sign = 1.0 if shape.get("sum") else -1.0
    stretch = joints.mcp + sign * joints.pip
    return [Term(Row.MCP, "coupling", stretch, "joint"), Term(Row.PIP, "coupling", sign * stretch, "joint")]


EFFECT = Effect(
    id="joint_coupling",
    title="Stiffness between MCP and PIP",
    family="Springs of the joints",
    acts_on=("joint_torque",),
    gains={"coupling": Parameter("N m/rad", 0.0, 0.06, 0.01, title="coupling stiffness")},
    columns=columns,
    coordinate="difference of joint angles",
    equation=Row.PIP,
    explanation="MCP and PIP miss torques of one size that follow the difference, or the sum, of the angles.",
    reveal="a chirp, in which the two joints move in different proportion",
    shapes=({"sum": 0.0}, {"sum": 1.0}),
    closer=either("sum", (0.0, 1.0)),
    mend="Free the skin, tape or cables that join the two phalanges.",
    formula=Formula(
        equation=r"\tau_1 = K_c(\theta_1 + \sigma\theta_2),\qquad \tau_2 = \sigma\tau_1",
        symbols=(
            "K_c: stiffness between the joints. σ: −1 for what bends one joint as the other bends, 1 for "
            "what runs along the same side of both and is stretched by either; both are tried."
        ),
        source="Ours: a linear spring between the joints, assumed (tendon, skin, glove).",
        values={"coupling": "K_c"},
        alike=("stiffness_error",),
    ),
    example=Example({"sum": 0.0}, {"mcp": 0.3, "pip": 0.1}, {"MCP coupling": 0.2, "PIP coupling": -0.2}),
)

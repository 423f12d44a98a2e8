"""The distal body turns with its absolute rate."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What I2 adds when the distal body turns with the absolute rate; relative to the rig's I2."""
    f, q = motion.finger_and_joints
    return [
        Term(Row.MCP, "share", f.distal_inertia * (q.mcp_acceleration + q.pip_acceleration), "joint"),
        Term(Row.PIP, "share", f.distal_inertia * q.mcp_acceleration, "joint"),
    ]


EFFECT = Effect(
    id="distal_rotation",
    title="Rotational energy of the distal body",
    family="Mass and gravity",
    acts_on=("joint_torque",),
    gains={
        "share": Parameter(
            "1", 0.9, 1.1, 1.0, source="Lagrangian with the absolute rate", title="share of I2"
        )
    },
    columns=columns,
    coordinate="joint acceleration",
    equation=Row.MCP,
    explanation="The missing torques are I2 times the acceleration that the relative rate leaves out.",
    reveal="a fast chirp, 2 to 5 Hz",
    mend="Move more slowly; nothing on the bench is wrong, the term belongs in the model.",
    formula=Formula(
        equation=(
            r"\tau_1 = \kappa I_2(\ddot\theta_1+\ddot\theta_2),\qquad \tau_2 = \kappa "
            r"I_2\,\ddot\theta_1"
        ),
        symbols="κ: share of I₂; 1 is the Lagrangian with the absolute rate of the distal body.",
        source=(
            "Ours: Lagrange's equation (3.5) with the absolute rate, where the thesis takes the relative one."
        ),
        values={"share": r"\kappa"},
        alike=("added_mass", "motor_inertia"),
    ),
    example=Example(
        {}, {"mcp_acceleration": 3.0, "pip_acceleration": 4.0}, {"MCP share": 1.4e-5, "PIP share": 6e-6}
    ),
)

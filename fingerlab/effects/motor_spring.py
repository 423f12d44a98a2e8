"""An elastic torque on the motor side."""

from fingerlab.effects.base import BOTH_JOINTS, Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import drive_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

OF_AN_AXIS = (
    "The motor's equation misses a torque in proportion to its angle: that of a spring or, over a short "
    "travel, of the weight of a link."
)


def columns(motion: Motion, shape: Shape) -> list[Term]:
    return drive_terms(motion, "stiffness", motion.position)


EFFECT = Effect(
    id="motor_spring",
    title="Elastic torque on the motor side",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={"stiffness": Parameter("N m/rad", -0.05, 0.2, 0.01, title="stiffness")},
    columns=columns,
    coordinate="motor angle",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, in proportion to the motor angle.",
    of_an_axis=lambda shape: OF_AN_AXIS,
    reveal="slow steps on the motor bench",
    reveal_of_an_axis="slow steps over the whole travel",
    mend="Keep wires, hoses and what else is fastened there from pulling at what the motor turns.",
    bench=True,
    formula=Formula(
        equation=r"\tau_m = k\,\theta_m",
        symbols="k: stiffness on the motor side.",
        source="Ours: a linear spring on the motor side, assumed (cable loop, seals, return spring).",
        values={"stiffness": "k"},
        alike=("stiffness_error", "motor_inertia", "cable_stretch", "torque_ripple"),
    ),
    example=Example({}, {"position": 0.5}, {"MCP stiffness": 50.0, "PIP stiffness": 50.0}),
)

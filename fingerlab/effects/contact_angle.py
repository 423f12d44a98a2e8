"""A contact force that leans from the load cell's axis."""

import math

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.joints import sideways_terms
from fingerlab.physics.motion import Motion, tip_reach, while_pressed
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A face that leans turns the force, and a tip that slides on it goes up and down."""
    force = np.zeros_like(motion.time) if motion.force is None else motion.force
    slope = Term(Row.TIP, "lean", while_pressed(motion, tip_reach(motion)))
    return [*sideways_terms(motion, "lean", force), slope]


EFFECT = Effect(
    id="contact_angle",
    title="Contact force that leans",
    family="Contact",
    acts_on=("endpoint_force",),
    gains={"lean": Parameter("1", -1.7, 1.7, 0.3, title="tangent of the lean")},
    columns=columns,
    coordinate="force",
    equation=Row.PIP,
    explanation="In contact both joints miss torques in the proportion of a sideways force.",
    reveal="free motion with the flexion cable before contact",
    mend="Set the load cell's face at a right angle to the fingertip's way.",
    phases=("contact",),
    formula=Formula(
        equation=(
            r"\tau_2 = F\tan\beta\;2l_2\sin(\theta_1+\theta_2-\alpha),\qquad \tau_1 = \tau_2 - "
            r"F\tan\beta\;2l_1\sin(\alpha-\theta_1)"
        ),
        symbols=(
            "β: angle by which the contact force leans from the load cell's axis; a tip that slides "
            "on the leaning face sinks by tan β times its travel."
        ),
        source="Thesis, figure 5.2; the lever of the MCP joint is ours, by virtual work.",
        values={"lean": r"\tan\beta"},
        alike=("load_cell_gain", "routing_change"),
    ),
    example=Example(
        {},
        {"force": 2.0, "pip": [0.5 * math.pi, 0.0]},
        {"MCP lean": [0.08, 0.0], "PIP lean": [0.08, 0.0], "TIP lean": [-0.02, 0.02]},
    ),
)

"""A fingertip and a load cell that give way."""

import math

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.joints import sideways_terms
from fingerlab.physics.motion import Motion, dragged_tip
from fingerlab.physics.parameter import Parameter

SIDEWAYS_STIFFNESSES = (600.0, 1500.0, 3800.0, 9500.0)
"""Sideways stiffness over friction coefficient of a tip that gives way, N/m: what is soft to pressing is two
thirds to nine tenths as stiff sideways (Mindlin 1949); for 0.2 to 3 mm/N, friction 0.1 to 0.5; assumed."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A tip that gives way rolls along before it slides.

    That it sinks is the compliance that every model carries, set free.
    """
    if motion.force is None:
        return sideways_terms(motion, "rub", np.zeros_like(motion.time))
    return sideways_terms(motion, "rub", -dragged_tip(motion, shape["sideways"], SIDEWAYS_STIFFNESSES))


EFFECT = Effect(
    id="contact_compliance",
    title="Fingertip and load cell that give way",
    family="Contact",
    acts_on=("endpoint_force",),
    gains={"rub": Parameter("1", 0.0, 0.8, 0.2, title="friction of the yielding tip")},
    columns=columns,
    shapes=tuple({"sideways": value} for value in SIDEWAYS_STIFFNESSES),
    shape_units={"sideways": "N/m"},
    relaxes={"tip_compliance": Parameter("m/N", 0.0, 1e-2, 1e-3, title="give of tip and load cell")},
    coordinate="force",
    equation=Row.TIP,
    explanation="In contact the fingertip sinks in proportion to the force.",
    reveal="a contact run with steps of the force",
    mend="Use a harder fingertip and a stiffer mount of the load cell, or press more slowly.",
    phases=("contact",),
    formula=Formula(
        equation=(
            r"2l_1\sin(\theta_1-\alpha)+2l_2\sin(\theta_1+\theta_2-\alpha) = h + c\,F,\qquad \tau_2 = "
            r"-\mu\,z\;2l_2\sin(\theta_1+\theta_2-\alpha)"
        ),
        symbols=(
            "c: give of fingertip and load cell. h: depth of the load cell's face, unknown in each "
            "run. μ: friction of the tip. z: force of a soft spring along the face that slides at F."
        ),
        source="Ours, linear; stiffness along the face against that across it: Mindlin 1949.",
        values={"rub": r"\mu", "sideways": "k_s", "tip_compliance": "c"},
        alike=("contact_angle",),
    ),
    example=Example(
        {"sideways": 600.0},
        {"force": 2.0, "pip": [0.0, 0.5 * math.pi]},
        {"MCP rub": [0.0, 0.08], "PIP rub": [0.0, 0.08]},
    ),
)

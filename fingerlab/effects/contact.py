"""Contact that is not what the model says: a force that leans, a tip that gives way, another routing."""

from __future__ import annotations

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term
from fingerlab.effects.cable import _no_columns
from fingerlab.effects.motion import Motion
from fingerlab.effects.sensing import lateral_levers
from fingerlab.effects.tip import dragged_tip, tip_reach, while_pressed
from fingerlab.sessions.model import Array

SIDEWAYS_STIFFNESSES = (600.0, 1500.0, 3800.0, 9500.0)
"""Sideways stiffness over friction coefficient of a tip that gives way, N/m: what is soft to pressing is two
thirds to nine tenths as stiff sideways (Mindlin 1949); for 0.2 to 3 mm/N, friction 0.1 to 0.5; assumed."""


def _sideways(motion: Motion, gain: str, force: Array) -> list[Term]:
    """Torques of a force (N) along the load cell's face, away from the MCP joint."""
    return [Term(t.row, gain, force * t.values, "joint") for t in lateral_levers(motion, gain)]


def _lean(motion: Motion, shape: Shape) -> list[Term]:
    """A face that leans turns the force, and a tip that slides on it goes up and down."""
    force = np.zeros_like(motion.time) if motion.force is None else motion.force
    slope = Term(Row.TIP, "lean", while_pressed(motion, tip_reach(motion)))
    return [*_sideways(motion, "lean", force), slope]


def _soft_rubbing(motion: Motion, shape: Shape) -> list[Term]:
    """A tip that gives way rolls along before it slides.

    That it sinks is the compliance that every model carries, set free.
    """
    if motion.force is None:
        return _sideways(motion, "rub", np.zeros_like(motion.time))
    return _sideways(motion, "rub", -dragged_tip(motion, shape["sideways"], SIDEWAYS_STIFFNESSES))


EFFECTS = (
    Effect(
        id="contact_angle",
        title="Contact force that leans",
        acts_on=("endpoint_force",),
        gains={"lean": Gain("1", -1.7, 1.7, 0.3, title="tangent of the lean")},
        columns=_lean,
        coordinate="force",
        equation=Row.PIP,
        explanation="In contact both joints miss torques in the proportion of a sideways force.",
        reveal="free motion with the flexion cable before contact",
        phases=("contact",),
    ),
    Effect(
        id="contact_compliance",
        title="Fingertip and load cell that give way",
        acts_on=("endpoint_force",),
        gains={"rub": Gain("1", 0.0, 0.8, 0.2, title="friction of the yielding tip")},
        columns=_soft_rubbing,
        shapes=tuple({"sideways": value} for value in SIDEWAYS_STIFFNESSES),
        shape_units={"sideways": "N/m"},
        relaxes={"tip_compliance": Gain("m/N", 0.0, 1e-2, 1e-3, title="give of tip and load cell")},
        coordinate="force",
        equation=Row.TIP,
        explanation="In contact the fingertip sinks in proportion to the force.",
        reveal="a contact run with steps of the force",
        phases=("contact",),
    ),
    Effect(
        id="routing_change",
        title="Other moment arms of the flexion cable",
        acts_on=("joint_torque", "cable_kinematics", "endpoint_force"),
        gains={},
        columns=_no_columns,
        relaxes={
            f"arm_{joint}@flexion": Gain(
                "m",
                0.002,
                0.04,
                0.003,
                "assumed: from 2 to 40 mm",
                f"{joint.upper()} arm of the flexion cable",
            )
            for joint in ("mcp", "pip")
        },
        cables=("extension", "flexion"),
        coordinate="tension",
        equation=Row.PIP,
        explanation="The flexion cable's moment arms do not go with those of the extension cable.",
        reveal="free motion with the flexion cable",
    ),
)

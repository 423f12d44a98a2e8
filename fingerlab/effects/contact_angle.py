"""A contact force that leans from the load cell's axis."""

import math

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.joints import PRESSED_TURNS_DEG, sideways_terms, turned_torques
from fingerlab.physics.motion import Motion, tip_reach, while_pressed
from fingerlab.physics.parameter import Parameter

LEANS = (-1.7, 1.7)
"""Tangents of sixty degrees either way, as far as the thesis tried (figure 5.2)."""
STANDS: Shape = {"cell_turns": 0.0, "turn_deg": 0.0}
"""The force leans from the axis of a cell that stands as it should; older models tell no more than that."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """The force away from the load cell's axis, or along it where the whole cell is turned.

    A face that leans turns the force, and a tip that slides on it goes up and down.
    """
    force = np.zeros_like(motion.time) if motion.force is None else motion.force
    slope = Term(Row.TIP, "lean", while_pressed(motion, tip_reach(motion)))
    if not shape.get("cell_turns"):
        return [*sideways_terms(motion, "lean", force), slope]
    about = math.radians(shape["turn_deg"])
    turned, slopes = turned_torques(motion, force, about, weighs=False)
    upright, _ = turned_torques(motion, force, 0.0, weighs=False)
    # To first order in the tangent about that of the turn.
    per_lean = math.cos(about) ** 2
    terms = [slope]
    for row, there, straight, change in zip((Row.MCP, Row.PIP), turned, upright, slopes, strict=True):
        leaned = per_lean * change
        terms.append(Term(row, "lean", leaned, "joint"))
        terms.append(Term(row, "", there - straight - math.tan(about) * leaned, "joint", constant=1.0))
    return terms


def _near(shape: Shape) -> tuple[float, float]:
    """The tangents that a point of the grid stands for."""
    if not shape.get("cell_turns"):
        return LEANS
    reach = 0.5 * (PRESSED_TURNS_DEG[1] - PRESSED_TURNS_DEG[0])
    low, high = (math.tan(math.radians(shape["turn_deg"] + side * reach)) for side in (-1.0, 1.0))
    return low, high


def _face_turn(shape: Shape) -> float:
    return math.radians(shape["turn_deg"]) if shape.get("cell_turns") else 0.0


def _closer(shape: Shape) -> list[Shape]:
    """Turns half-way to the next, and the force that leans from a cell that stands."""
    turn = shape.get("turn_deg", 0.0)
    steps = (-4.0, 0.0, 4.0) if shape.get("cell_turns") else (0.0,)
    return [STANDS, *({"cell_turns": 1.0, "turn_deg": turn + step} for step in steps)]


EFFECT = Effect(
    id="contact_angle",
    title="Contact force that leans",
    family="Contact",
    acts_on=("endpoint_force",),
    gains={"lean": Parameter("1", *LEANS, 0.3, title="tangent of the lean", limits=_near)},
    columns=columns,
    coordinate="force",
    equation=Row.PIP,
    explanation="In contact both joints miss torques in the proportion of a sideways force.",
    reveal="free motion with the flexion cable before contact",
    mend="Set the load cell's face at a right angle to the fingertip's way.",
    shapes=(STANDS, *({"cell_turns": 1.0, "turn_deg": turn} for turn in PRESSED_TURNS_DEG)),
    shape_units={"turn_deg": "deg"},
    closer=_closer,
    turns=_face_turn,
    phases=("contact",),
    formula=Formula(
        equation=(
            r"\tau_2 = F\tan\beta\;2l_2\sin(\theta_1+\theta_2-\alpha),\qquad \tau_1 = \tau_2 - "
            r"F\tan\beta\;2l_1\sin(\alpha-\theta_1)"
        ),
        symbols=(
            "β: angle by which the contact force leans from the load cell's axis; a tip that slides "
            "on the leaning face sinks by tan β times its travel. Where the whole cell is turned, F is along "
            "its axis: F cos β in place of F, and F sin β sideways, about the point β_0 of a grid; both are "
            "tried."
        ),
        source="Thesis, figure 5.2; the lever of the MCP joint is ours, by virtual work.",
        values={"lean": r"\tan\beta", "turn_deg": r"\beta_0"},
        alike=("load_cell_gain", "routing_change"),
    ),
    example=Example(
        STANDS,
        {"force": 2.0, "pip": [0.5 * math.pi, 0.0]},
        {"MCP lean": [0.08, 0.0], "PIP lean": [0.08, 0.0], "TIP lean": [-0.02, 0.02]},
    ),
)

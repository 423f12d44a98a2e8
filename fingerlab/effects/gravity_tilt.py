"""A base that stands at another angle than the rig file says."""

import math

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, either, every, plus
from fingerlab.effects.joints import PRESSED_TURNS_DEG, turned_torques
from fingerlab.physics.motion import Motion, nothing, tip_reach, while_pressed
from fingerlab.physics.parameter import Parameter

LARGEST_TILT_RAD = 0.45

TURNS_DEG = (-17.0, 0.0, 17.0)
"""Tilts about which the torques are taken as straight, each half-way to the next; within 1 per cent."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """Gravity torques of a base that stands at another angle, to first order about none or about a large one.

    A load cell that stands on a base of its own (``cell_stays``) then presses from another direction, too:
    the levers of the contact force turn with the finger (thesis equation 3.18).
    """
    about = math.radians(shape.get("turn_deg", 0.0))
    force = motion.force if shape.get("cell_stays") else None
    (mcp, pip), (turn_mcp, turn_pip) = turned_torques(motion, force, about)
    level = nothing(len(pip)) if force is None else while_pressed(motion, tip_reach(motion))
    terms = [
        Term(Row.MCP, "tilt", turn_mcp, "joint"),
        Term(Row.PIP, "tilt", turn_pip, "joint"),
        Term(Row.TIP, "tilt", level),
    ]
    if about:
        (flat_mcp, flat_pip), _ = turned_torques(motion, force, 0.0)
        terms += [
            Term(Row.MCP, "", mcp - flat_mcp - about * turn_mcp, "joint", constant=1.0),
            Term(Row.PIP, "", pip - flat_pip - about * turn_pip, "joint", constant=1.0),
        ]
    return terms


def _near(shape: Shape) -> tuple[float, float]:
    """The tilts that a point of the grid stands for."""
    turns = PRESSED_TURNS_DEG if shape["cell_stays"] else TURNS_DEG
    reach = (turns[1] - turns[0]) / 2.0
    low, high = (math.radians(shape["turn_deg"] + side * reach) for side in (-1.0, 1.0))
    return max(low, -LARGEST_TILT_RAD), min(high, LARGEST_TILT_RAD)


def _face_turn(shape: Shape) -> float:
    return math.radians(shape["turn_deg"]) * shape["cell_stays"]


EFFECT = Effect(
    id="gravity_tilt",
    title="Tilted base",
    family="Mass and gravity",
    acts_on=("joint_torque",),
    gains={
        "tilt": Parameter(
            "rad",
            -LARGEST_TILT_RAD,
            LARGEST_TILT_RAD,
            0.1,
            source="assumed: up to 25 degrees",
            title="tilt of the base",
            limits=_near,
        )
    },
    columns=columns,
    coordinate="joint angle",
    equation=Row.MCP,
    explanation="The missing torques are those of gravity from another direction.",
    reveal="slow steps over the whole travel",
    mend="Level the base, or measure its tilt and enter it in the rig file.",
    shapes=(
        *({"cell_stays": 0.0, "turn_deg": t} for t in TURNS_DEG),
        *({"cell_stays": 1.0, "turn_deg": t} for t in PRESSED_TURNS_DEG),
    ),
    shape_units={"turn_deg": "deg"},
    closer=every(plus("turn_deg", (-4.0, 0.0, 4.0)), either("cell_stays", (0.0, 1.0))),
    turns=_face_turn,
    formula=Formula(
        equation=(
            r"\begin{align*} \tau_2 &= \varepsilon\,(2\sigma F - m_2 g)\,l_2 "
            r"\sin(\theta_1+\theta_2-\alpha) + \sigma f\left[\lambda_2(\alpha+\varepsilon) - "
            r"\lambda_2(\alpha)\right] \\ \tau_1 &= \varepsilon\left[(2\sigma F - m_2 g)\,l_2 "
            r"\sin(\theta_1+\theta_2-\alpha) - (2\sigma F - (m_1+2m_2)\,g)\,l_1 "
            r"\sin(\alpha-\theta_1)\right] + \sigma f\left[\lambda_1(\alpha+\varepsilon) - "
            r"\lambda_1(\alpha)\right] \end{align*}"
        ),
        symbols=(
            "ε: tilt of the base. σ: 1 where the load cell stands on a base of its own, 0 where it "
            "tilts with the finger; both are tried. f: the tip's friction along the load cell's "
            "face. λ₁, λ₂: its levers about MCP and PIP, which turn with the finger. Written to "
            "first order about no tilt; a larger one is taken about the point ε_0 of a grid."
        ),
        source="Ours: the potential energy (3.6) to (3.15) with another wrist angle.",
        values={"tilt": r"\varepsilon", "turn_deg": r"\varepsilon_0"},
        alike=("added_mass", "stiffness_error"),
    ),
    example=Example(
        {"cell_stays": 0.0, "turn_deg": 0.0},
        {"pip": 0.5 * math.pi},
        {"MCP tilt": -0.002, "PIP tilt": -0.002, "TIP tilt": 0.0},
    ),
)

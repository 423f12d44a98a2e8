"""Friction of the joints that builds up over degrees (Dahl)."""

import math

import numpy as np

from fingerlab.effects.base import (
    HALF_OCTAVE,
    PRESLIDING_TRAVELS_DEG,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    dahl_or_masing,
)
from fingerlab.effects.joints import COULOMB, both, friction_of_joints, joint_terms
from fingerlab.physics.friction_states import dahl_states, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array

PIP_TRAVEL = "pip_travel_deg"
"""Travel of the PIP joint where that is another one than that of the MCP joint: a hinge has its own pin."""
TRAVEL_RATIOS = tuple(2.0 ** (k / 2) for k in (-3, -2, -1, 1, 2, 3))
"""Of the PIP joint to the MCP joint's, that are tried: the PIP joint is the smaller, and either may swing
further; assumed."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    of_pip = {**shape, "travel_deg": shape.get(PIP_TRAVEL, shape["travel_deg"])}
    if shape.get("masing"):
        return joint_terms(
            "dahl", friction_of_joints(motion, shape)[0], friction_of_joints(motion, of_pip)[1]
        )

    def state(name: str, angle: Array, travel_deg: float) -> Array:
        travels = with_grid(travel_deg, PRESLIDING_TRAVELS_DEG)
        keys = [("dahl", name, travel) for travel in travels]
        return motion.remember_each(keys[0], keys, lambda: dahl_states(angle, np.radians(travels)))

    mcp = state("mcp", joints.mcp, shape["travel_deg"])
    return joint_terms("dahl", mcp, state("pip", joints.pip, of_pip["travel_deg"]))


def _closer(shape: Shape) -> list[Shape]:
    """Around the one found, and with a travel of its own for each joint."""
    mcp, pip = shape["travel_deg"], shape.get(PIP_TRAVEL, shape["travel_deg"])
    ratio = {PIP_TRAVEL: pip / mcp} if PIP_TRAVEL in shape else {}
    alike = dahl_or_masing({name: value for name, value in shape.items() if name != PIP_TRAVEL})
    near = [{**one, **{name: one["travel_deg"] * value for name, value in ratio.items()}} for one in alike]
    ratios = HALF_OCTAVE if ratio else TRAVEL_RATIOS
    return [
        *near,
        *(
            {**shape, "travel_deg": mcp * factor / root, PIP_TRAVEL: pip * factor * root}
            for factor in (HALF_OCTAVE[0], 1.0, HALF_OCTAVE[-1])
            for root in map(math.sqrt, ratios)
        ),
    ]


EFFECT = Effect(
    id="presliding_hysteresis",
    title="Presliding hysteresis (Dahl)",
    family="Joint friction",
    acts_on=("joint_torque",),
    gains=both("dahl", COULOMB),
    columns=columns,
    coordinate="joint speed",
    equation=Row.PIP,
    explanation="After each reversal the missing torque builds up over a small travel of the joint.",
    reveal="sines of small amplitude, 2 to 5 degrees",
    mend="Reverse less often and move by more degrees at a time, or exchange plain hinges for ball bearings.",
    shapes=tuple({"travel_deg": travel} for travel in PRESLIDING_TRAVELS_DEG),
    shape_units={"travel_deg": "deg", PIP_TRAVEL: "deg"},
    closer=_closer,
    formula=Formula(
        equation=(
            r"\tau_j = C_j\,z_j,\qquad \frac{dz_j}{d\theta_j} = \frac{1 - "
            r"z_j\,\mathrm{sgn}\,\dot\theta_j}{\delta_j}"
        ),
        symbols=(
            "C_j: friction torque. z_j: Dahl's state, or spring-sliders (theory, \"Friction that "
            'sticks"). δ_j: travel over which it builds up, the same for both joints or one for each; both '
            "are tried."
        ),
        source="Dahl 1968; spring-sliders: Al-Bender, Lampaert and Swevers 2005.",
        values={"dahl_mcp": "C_1", "dahl_pip": "C_2", "travel_deg": r"\delta_1", PIP_TRAVEL: r"\delta_2"},
        alike=("coulomb_friction", "motor_presliding", "viscoelastic_creep"),
    ),
    example=Example(
        {"travel_deg": 2.0}, {"pip": np.radians([0.0, 2.0])}, {"PIP dahl_pip": [0.0, 1.0 - math.exp(-1.0)]}
    ),
)

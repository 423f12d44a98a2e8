"""Play between gearbox and pulley, taken up at each reversal."""

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, times
from fingerlab.physics.friction_states import stop_operators, with_grid
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

GAPS_DEG = (0.5, 1.0, 2.0, 4.0)
"""Play between gearbox and pulley, degrees at the pulley; assumed."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    gaps = with_grid(shape["gap_deg"], GAPS_DEG)
    keys = [("gap", gap) for gap in gaps]
    state = motion.remember_each(
        keys[0], keys, lambda: stop_operators(motion.position, 0.5 * np.radians(gaps))
    )
    return [Term(Row.CABLE, "half_gap", motion.radius * state)]


EFFECT = Effect(
    id="backlash",
    title="Play between gearbox and pulley",
    family="Cable",
    acts_on=("cable_kinematics",),
    gains={"half_gap": Parameter("rad", 0.0, 0.1, 0.01, title="half the play")},
    columns=columns,
    coordinate="motor speed",
    equation=Row.CABLE,
    explanation="At each reversal the motor turns through a gap before the cable follows.",
    reveal="slow steps up and down with the cable under tension",
    mend="Pin the pulley, preload the gearbox, or put the encoder on the pulley.",
    shapes=tuple({"gap_deg": value} for value in GAPS_DEG),
    shape_units={"gap_deg": "deg"},
    closer=times("gap_deg"),
    formula=Formula(
        equation=r"x = r\,h\,p(\theta_m)",
        symbols="h: half the play. p: Prandtl's stop operator, −1 to 1 over the gap g.",
        source="Prandtl's stop operator (Visintin 1994).",
        values={"half_gap": "h", "gap_deg": "g"},
        alike=("cable_slack", "motor_presliding", "cable_stretch"),
    ),
    example=Example(
        {"gap_deg": 1.0},
        {"position": np.radians([0.0, 0.25, 2.0, 1.5])},
        {"CABLE half_gap": [0.0, 0.005, 0.01, 0.0]},
    ),
)

"""The sheath takes its share of the tension."""

from collections.abc import Sequence
from dataclasses import replace

from fingerlab.effects.base import (
    FINEST_OCTAVE,
    FINGER_SPEEDS,
    HALF_OCTAVE,
    OCTAVE,
    REVERSAL_SPEED,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    either,
    every,
    times,
)
from fingerlab.effects.transmission import (
    DRIVE,
    MOST_SHARE,
    SHARES,
    SHORT_AND_WINDING_TRAVELS_DEG,
    USUAL_STICKING_DEG,
    WINDING_TRAVELS_DEG,
    pull_terms,
    sheath_loss,
)
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import CABLE_SIGN

HELD_TRAVELS_DEG = (0.1, 0.2, 0.8)
"""Travel over which a cable that is held in its sheath slides at a tension of REFERENCE_PULL_N, degrees at
the pulley; assumed: what a stiff cable of 2e-5 m/N stretches under its friction on a pulley of 10 to 15 mm. A
gearbox, whose friction also grows with the load, winds up by more, and so does a cable in a soft glove."""
EQUAL_SHARE = 0.9
"""Of the larger share from which on the other sheath takes about as much; assumed."""
OTHER_HELD_TRAVELS_DEG = tuple(0.1 * 2.0 ** (k / 2) for k in range(-1, 8))
"""Where they are looked for when a cable that follows the tension was found: from the stiff cable's to eight
times as far, for a sheath of textile on a soft glove."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """The sheath takes its share of the tension in the cable.

    ``stretch_behind`` of the stretch lies behind it, seen from the finger: all that the motor pulls is felt
    there.

    On the grid the share is small, and the same for both cables; between its points it is what was found.
    """
    terms = [t for cable in CABLE_SIGN for t in pull_terms(cable, sheath_loss(motion, shape, cable))]
    behind = shape["stretch_behind"]
    if behind == 1.0:
        return terms
    rows = [t for t in terms if behind or t.row != Row.CABLE]
    return [replace(t, values=behind * t.values) if t.row == Row.CABLE else t for t in rows]


def _share(cable: str) -> Parameter:
    return Parameter(
        "1", 0.0, MOST_SHARE, 0.05, "assumed: friction of 0.2 over 200 degrees of bends",
        f"share of the tension lost in the {cable} cable's sheath",
        varies_between_runs=True, holds_at_rest=True, cable=cable,
    )  # fmt: skip


def _sheath(travel: float, stretch_behind: float, held: float = 0.0) -> Shape:
    """What is held is one contact, what follows the tension are many."""
    return {"travel_deg": travel, "stretch_behind": stretch_behind, "held": held, "sharpness": held}


def _sheath_closer(shape: Shape) -> Sequence[Shape]:
    """Around the one found, and where the other laws would be looked for."""
    by_speed, travel = REVERSAL_SPEED in shape, shape.get("travel_deg", USUAL_STICKING_DEG)
    around = [factor * travel for factor in OCTAVE] if shape["held"] else OTHER_HELD_TRAVELS_DEG
    held = either("travel_deg", around)
    sharp = shape.get("sharpness", 0.0)
    if shape["held"]:
        many, over = USUAL_STICKING_DEG, either("travel_deg", SHORT_AND_WINDING_TRAVELS_DEG)
    else:
        many, over = travel / (1.0 + sharp), times("travel_deg", HALF_OCTAVE)
    following = _sheath(many, 1.0)
    # What winds up as one spring and lets go all at once does so over twice the travel that reverses 63 %,
    # and what lets go part by part over half as much again.
    as_one = {
        **following,
        "sharpness": 1.0,
        "travel_deg": 2.0 * many,
        "stretch_behind": shape["stretch_behind"],
    }
    evenly = {**as_one, "sharpness": 0.5, "travel_deg": 1.5 * many}
    behind = either("stretch_behind", (1.0, 0.0))
    speeds = [factor * shape[REVERSAL_SPEED] for factor in FINEST_OCTAVE] if by_speed else FINGER_SPEEDS
    shapes = [
        *every(held, behind)(_sheath(travel, 1.0, held=1.0)),
        _sheath(travel, stretch_behind=0.5, held=1.0),
        *every(over, behind)(following),
        *times("travel_deg", HALF_OCTAVE)(evenly),
        *times("travel_deg", FINEST_OCTAVE if sharp == 1.0 and not shape["held"] else HALF_OCTAVE)(as_one),
        *every(either(REVERSAL_SPEED, speeds), behind)({"stretch_behind": 1.0, "held": 0.0}),
    ]
    found = {name: shape[name] for name in FOLLOWING if name in shape}
    return [{**found, **one} for one in [*shapes, *_equal_sheaths(shape)]]


def _equal_sheaths(shape: Shape) -> list[Shape]:
    """What is held, with both sheaths taking the larger share; none where they nearly do.

    A sheath that takes less slides sooner, and what slides sooner seems to take less: from a travel that was
    too short a share comes down and stays there.
    """
    told = {name: shape[name] for name in SHARES if name in shape}
    most = max(told.values(), default=0.0)
    if not shape["held"] or most * EQUAL_SHARE <= min(told.values(), default=0.0):
        return []
    equal = {**_sheath(shape["travel_deg"], shape["stretch_behind"], held=1.0), **dict.fromkeys(told, most)}
    return list(times("travel_deg", OCTAVE[1:-1])(equal))


FOLLOWING = {**DRIVE, **SHARES}
"""What a shape takes from the unknowns of its model."""

EFFECT = Effect(
    id="capstan_friction",
    title="Sheath (capstan) friction",
    family="Cable",
    acts_on=("joint_torque", "motor_torque"),
    gains={cable: _share(cable) for cable in CABLE_SIGN},
    columns=columns,
    coordinate="tension times direction of travel",
    equation=Row.PIP,
    explanation="The motor needs more tension winding in, less paying out, in proportion to the tension.",
    reveal="runs at several loads, contact included",
    mend="Lead the cable around fewer or wider bends, or line the sheath with PTFE.",
    shapes=(
        *(_sheath(travel, stretch_behind=1.0, held=1.0) for travel in HELD_TRAVELS_DEG),
        *(_sheath(travel, stretch_behind=1.0) for travel in WINDING_TRAVELS_DEG[-2::-2]),
        *(_sheath(travel, stretch_behind=0.0) for travel in WINDING_TRAVELS_DEG[::2]),
    ),
    shape_units={"travel_deg": "deg", REVERSAL_SPEED: "rad/s"},
    closer=_sheath_closer,
    follows=FOLLOWING,
    formula=Formula(
        equation=r"T_m = T + \mu\,T\,z(\theta_m;\delta)",
        symbols=(
            "T_m: tension from the motor; T: what the sheath leaves of it. μ: share that this "
            "cable's sheath takes. z: friction state of the winding, −1 to 1, or the hyperbolic tangent of "
            "the motor's speed over v_r. The cable's stretch lies "
            "before or behind the sheath, and what sticks may keep its friction while the tension changes "
            '(theory, "Friction that sticks"); all are tried. What takes μ winding in gives '
            "μ/(1 − μ) paying out."
        ),
        source=("Euler 1769 and Eytelwein 1808 for a small angle of wrap; sheaths: Kaneko, Do et al. 2013."),
        values={**dict.fromkeys(CABLE_SIGN, r"\mu"), "travel_deg": r"\delta", REVERSAL_SPEED: "v_r"},
        alike=("load_dependent_friction", "motor_coulomb_friction", "coulomb_friction"),
    ),
    example=Example(
        _sheath(0.3, stretch_behind=1.0),
        {"torque": 0.02, "position": [0.0, 0.1]},
        {f"{row} extension": [0.0, 2.0] for row in ("MCP", "PIP", "CABLE")},
    ),
)

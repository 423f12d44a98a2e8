"""Friction of gear or cable that grows with the torque transmitted."""

import numpy as np

from fingerlab.effects.base import (
    HALF_OCTAVE,
    OCTAVE,
    REVERSAL_SPEED,
    STICK_DAMPING,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
    either,
    every,
    rubbing,
    times,
)
from fingerlab.effects.transmission import SHORT_AND_WINDING_TRAVELS_DEG, drive_state, drive_terms
from fingerlab.physics.friction_states import friction_state, rubbing_forces
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

REFERENCE_LOAD_NM = 0.1
"""Load at which the travel of a friction that grows with it is told, N m; assumed, only a scale."""
LOAD_SHARE = "load_share"
"""Number of a shape: the share that was found to be lost."""
MOST_SHARE = 0.5
"""Of the torque; assumed: a dry worm gear, the worst that turns both ways."""
HELD_TRAVELS_DEG = (0.3, 0.42, 0.6, 0.85, 1.2, 1.7)
"""Travel over which teeth that are held slide at a load of REFERENCE_LOAD_NM, degrees at the pulley; assumed:
the wind-up of a gearbox."""

DAMPINGS_S = (0.002, 0.006)
"""Where the damping of teeth that are held is looked for first; see ``base.STICK_DAMPINGS_S``."""


SHAPES = (
    *({"travel_deg": value, "sharpness": 1.0, "held": 1.0} for value in HELD_TRAVELS_DEG),
    *({"travel_deg": value, "sharpness": 0.0, "held": 0.0} for value in SHORT_AND_WINDING_TRAVELS_DEG[::2]),
)


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """Teeth that slide at a share of the load.

    What sticks is held by one spring, whatever the load, so that it is not let go when the load rises and
    slides over a travel in proportion to the load, and may be damped beside its spring; or, not ``held``, by
    many that the load itself presses together, and has its share of the load of the moment.

    The share is one of what the gears transmit: of a known load, s. Of the motor's torque, which has the loss
    in it, that is less winding in, s / (1 + s), and more paying out, s / (1 - s). On the grid s is taken for
    small in these; between its points it is what was found.
    """
    share = 0.0  # of the loss itself, in the torque at hand
    load = motion.load
    if load is None:
        load = motion.torque - (motion.motor.inertia or 0.0) * motion.acceleration
        share = min(shape.get(LOAD_SHARE, 0.0), MOST_SHARE)
    load = np.abs(load)
    if not shape.get("held", 1.0):
        state = drive_state(motion, shape)
        return drive_terms(motion, "share", load * state / (1.0 + share * state))
    way, sharpness = float(np.radians(shape["travel_deg"])), shape.get("sharpness", 0.0)
    lead = shape[STICK_DAMPING] * motion.velocity if STICK_DAMPING in shape else None

    def stops(position: Array, reaches: Array) -> Array:
        backward = (1.0 + share) / (1.0 - share)
        return rubbing_forces(position, load / (1.0 + share), REFERENCE_LOAD_NM / reaches, backward, lead)

    return drive_terms(motion, "share", friction_state(motion.position, way, sharpness, stops))


def _damped_contact(shape: Shape) -> list[Shape]:
    """What sticks in one contact with damping: over other travels, and between the dampings tried."""
    found = shape.get(STICK_DAMPING)
    dampings = DAMPINGS_S if found is None else [found * factor for factor in OCTAVE[::2]]
    as_one = 2.0 * shape["travel_deg"] / (1.0 + shape.get("sharpness", 0.0))
    one_contact = {**shape, "sharpness": 1.0, "travel_deg": as_one}
    return list(every(times("travel_deg", HALF_OCTAVE), either(STICK_DAMPING, dampings))(one_contact))


def _closer(shape: Shape) -> list[Shape]:
    """Around the one found, and where the other law would be looked for."""
    if REVERSAL_SPEED in shape:
        return list(rubbing()(shape))
    undamped = {name: value for name, value in shape.items() if name != STICK_DAMPING}
    held, following = {**undamped, "held": 1.0}, {**undamped, "held": 0.0}
    if shape.get("held", 1.0):
        others = [{**following, "travel_deg": t, "sharpness": 0.0} for t in SHORT_AND_WINDING_TRAVELS_DEG]
        return [*rubbing(OCTAVE[1:-1])(held), *_damped_contact(shape), *others]
    others = [{**held, "travel_deg": t, "sharpness": 1.0} for t in HELD_TRAVELS_DEG]
    return [*rubbing(by_speed=True)(following), *others]


EFFECT = Effect(
    id="load_dependent_friction",
    title="Friction that grows with load",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        "share": Parameter(
            "1",
            0.0,
            MOST_SHARE,
            0.05,
            title="friction as a share of the torque",
            varies_between_runs=True,
            holds_at_rest=True,
        )
    },
    columns=columns,
    coordinate="tension times direction of travel",
    equation=Row.PIP,
    explanation="The missing tension opposes the travel and grows with the torque transmitted.",
    of_an_axis=lambda shape: (
        "The motor's equation misses a torque that opposes the travel and grows with the load."
    ),
    reveal="a motor bench with two known loads",
    reveal_of_an_axis="runs under two known loads",
    mend="Grease the gearbox, or choose one with a smaller ratio; less pretension lowers it, too.",
    shapes=SHAPES,
    shape_units={"travel_deg": "deg", STICK_DAMPING: "s", REVERSAL_SPEED: "rad/s"},
    shapes_seen=lambda motions: (*SHAPES, {REVERSAL_SPEED: 0.02, "held": 0.0}),
    closer=_closer,
    follows={LOAD_SHARE: ("load_dependent_friction.share",)},
    bench=True,
    formula=Formula(
        equation=r"\tau_m = \mu\,f,\qquad |f| \leq |\tau_l|",
        symbols=(
            "μ: share of the torque that is lost. τ_l: torque transmitted, without that of the "
            "rotor's inertia; on the motor bench, the known load. f: spring-sliders (theory, "
            '"Friction that sticks") whose limit is the load of the moment: a slider that slides '
            "holds the load's size against the motion, one that sticks keeps its force when the load "
            "rises, or has its share of the load of the moment; both are tried. δ: travel, where what "
            "sticks is held at a load of 0.1 N m. v_r: speed over which it turns round, where it "
            "rubs by the speed. t_d: damping of what sticks over its stiffness."
        ),
        source="Friction that grows with the load of a gear (Duclusaud et al. 2024).",
        values={"share": r"\mu", "travel_deg": r"\delta", STICK_DAMPING: "t_d", REVERSAL_SPEED: "v_r"},
        alike=("capstan_friction", "motor_coulomb_friction"),
    ),
    example=Example(
        {"travel_deg": 1.2, "sharpness": 1.0},
        {"load": 0.1, "position": np.radians([0.0, 0.3, 5.0])},
        {"BENCH share": [0.0, 0.05, 0.1]},
        on_bench=True,
    ),
)

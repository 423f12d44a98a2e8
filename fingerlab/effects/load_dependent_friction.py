"""Friction of gear or cable that grows with the torque transmitted."""

import numpy as np

from fingerlab.effects.base import OCTAVE, Effect, Example, Formula, Row, Shape, Term, rubbing
from fingerlab.effects.transmission import drive_terms
from fingerlab.physics.friction_states import friction_state, rubbing_forces
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

REFERENCE_LOAD_NM = 0.1
"""Load at which the travel of a friction that grows with it is told, N m; assumed, only a scale."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A tooth that slides at a share of the load: what sticks is not let go when the load rises.

    It is held by one spring, whatever the load, so that it slides over a travel in proportion to the load.
    """
    inertia = motion.motor.inertia or 0.0
    load = np.abs(motion.torque - inertia * motion.acceleration if motion.load is None else motion.load)

    def stops(position: Array, reaches: Array) -> Array:
        return rubbing_forces(position, load, REFERENCE_LOAD_NM / reaches)

    way, sharpness = float(np.radians(shape["travel_deg"])), shape.get("sharpness", 0.0)
    return drive_terms(motion, "share", friction_state(motion.position, way, sharpness, stops))


EFFECT = Effect(
    id="load_dependent_friction",
    title="Friction that grows with load",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        "share": Parameter(
            "1",
            0.0,
            0.5,
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
    mend="Grease the gearbox, or choose one with a smaller ratio; less pretension lowers it, too.",
    shapes=tuple({"travel_deg": value, "sharpness": 1.0} for value in (0.6, 0.85, 1.2, 1.7)),
    shape_units={"travel_deg": "deg"},
    closer=rubbing(OCTAVE[1:-1]),
    bench=True,
    formula=Formula(
        equation=r"\tau_m = \mu\,f,\qquad |f| \leq |\tau_l|",
        symbols=(
            "μ: share of the torque that is lost. τ_l: torque transmitted, without that of the "
            "rotor's inertia; on the motor bench, the known load. f: spring-sliders (theory, "
            '"Friction that sticks") whose limit is the load of the moment: a slider that slides '
            "holds the load's size against the motion, one that sticks keeps its force when the load "
            "rises. δ: travel at a load of 0.1 N m."
        ),
        source="Friction that grows with the load of a gear (Duclusaud et al. 2024).",
        values={"share": r"\mu", "travel_deg": r"\delta"},
        alike=("capstan_friction", "motor_coulomb_friction"),
    ),
    example=Example(
        {"travel_deg": 1.2, "sharpness": 1.0},
        {"load": 0.1, "position": np.radians([0.0, 0.3, 5.0])},
        {"BENCH share": [0.0, 0.05, 0.1]},
        on_bench=True,
    ),
)

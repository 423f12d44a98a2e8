"""Another inertia of rotor, gearbox and pulley than the rig file says."""

from fingerlab.effects.base import BESIDE_A_FINGER, BOTH_JOINTS, Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import drive_terms, pull_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    if motion.finger is None:
        return drive_terms(motion, "inertia", motion.acceleration)
    return pull_terms("inertia", motion.inertial_pull)


EFFECT = Effect(
    id="motor_inertia",
    title="Other inertia of rotor, gearbox and pulley",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={"inertia": Parameter("kg m^2", -3e-4, 2e-3, 2e-4, title="inertia beyond nominal")},
    columns=columns,
    coordinate="motor acceleration",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, in proportion to motor acceleration.",
    reveal="a fast chirp on the motor bench",
    mend="Enter the inertia of rotor, gearbox and pulley in the rig file, or accelerate less.",
    bench=BESIDE_A_FINGER,
    formula=Formula(
        equation=r"\tau_m = \Delta J\,\ddot\theta_m",
        symbols="ΔJ: inertia at the gearbox output beyond that of the rig file.",
        source=(
            "Newton's law; inertias of rotor and gearbox: data sheets of maxon RE40 148867 and GP 42C 203144."
        ),
        values={"inertia": r"\Delta J"},
        alike=("stiffness_error", "added_mass", "motor_spring"),
    ),
    example=Example({}, {"acceleration": 2.0}, {"BENCH inertia": 2.0}, on_bench=True),
)

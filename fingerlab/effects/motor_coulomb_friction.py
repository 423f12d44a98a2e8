"""Coulomb friction in motor and gearbox."""

from fingerlab.effects.base import (
    ALONE,
    BOTH_JOINTS,
    REVERSAL_SPEED,
    STICK_DAMPING,
    Effect,
    Example,
    Formula,
    Row,
    rubbing,
    with_damping,
)
from fingerlab.effects.transmission import FRICTION, MOTOR_ALONE_SHAPES, WINDING_SHAPES, coulomb_terms

EFFECT = Effect(
    id="motor_coulomb_friction",
    title="Coulomb friction in motor and gearbox",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={"coulomb": FRICTION},
    columns=coulomb_terms,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, which flips sign with motor speed.",
    reveal="a motor-bench run without a finger",
    reveal_of_an_axis="slow motion that turns round often",
    mend="Run the gearbox in and grease it, or choose a smaller ratio.",
    shapes=WINDING_SHAPES,
    shape_units={"travel_deg": "deg", REVERSAL_SPEED: "rad/s", STICK_DAMPING: "s"},
    shapes_seen=lambda motions: MOTOR_ALONE_SHAPES,
    switches_seen=(ALONE,),
    closer=with_damping(rubbing(by_speed=True)),
    bench=True,
    followed={"coulomb": "Motor friction, Coulomb"},
    formula=Formula(
        equation=r"\tau_m = C\,z(\theta_m;\delta)",
        symbols=(
            "C: friction torque at the gearbox output. z: friction state of the travel, −1 to 1, or the "
            "hyperbolic tangent of the speed over v_r; both are tried. Of a motor alone what sticks may be "
            "damped: z + t_d dz/dt, as in the LuGre model."
        ),
        source=(
            "Coulomb 1785 (Olsson et al. 1998), at the gearbox output; damping: Canudas de Wit et al. 1995."
        ),
        values={"coulomb": "C", "travel_deg": r"\delta", REVERSAL_SPEED: "v_r", STICK_DAMPING: "t_d"},
        alike=("capstan_friction", "asymmetric_friction", "motor_stribeck_friction", "motor_presliding"),
    ),
    example=Example(
        {"travel_deg": 0.3},
        {"position": [0.0, 0.1, -0.1]},
        {"MCP coulomb": [0.0, 100.0, -100.0], "PIP coulomb": [0.0, 100.0, -100.0]},
    ),
)

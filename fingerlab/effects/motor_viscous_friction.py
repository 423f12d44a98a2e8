"""Viscous friction in motor and gearbox."""

from fingerlab.effects.base import BOTH_JOINTS, Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import drive_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    return drive_terms(motion, "viscous", motion.velocity)


EFFECT = Effect(
    id="motor_viscous_friction",
    title="Viscous friction in motor and gearbox",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        "viscous": Parameter(
            "N m s/rad", 0.0, 0.02, 0.001, title="viscous coefficient", varies_between_runs=True
        )
    },
    columns=columns,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, in proportion to motor speed.",
    reveal="a motor-bench run at several speeds",
    reveal_of_an_axis="runs at several speeds",
    mend="Use a thinner grease in the gearbox, let it warm up, or move more slowly.",
    bench=True,
    followed={"viscous": "Motor friction, viscous"},
    like_late_torque=True,
    formula=Formula(
        equation=r"\tau_m = B\,\dot\theta_m",
        symbols="B: viscous coefficient at the gearbox output.",
        source="Friction in proportion to speed (Olsson et al. 1998), at the gearbox output.",
        values={"viscous": "B"},
        alike=("viscous_friction", "motor_stribeck_friction"),
    ),
    example=Example(
        {}, {"velocity": 3.0}, {"MCP viscous": 300.0, "PIP viscous": 300.0, "CABLE viscous": 300.0}
    ),
)

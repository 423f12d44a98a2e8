"""Viscous friction in motor and gearbox, and the drag of a fluid that is stirred."""

from collections.abc import Sequence

import numpy as np

from fingerlab.effects.base import BOTH_JOINTS, Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import drive_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

TURBULENT = "turbulent"
"""Switch of a shape: drag grows with the square of the speed, too, as of a fan or through an orifice."""
DRY_SHARES = (0.002, 0.01, 0.05, 0.2)
"""Shares of the fastest speed over which dry friction may turn round; assumed."""
LEAST_GAIN, LEAST_LEFT = 0.5, 1e-4
"""Share of the squared torque left without it, below which the square of the speed has a say, and share of
the torque's variance that has to be left; assumed."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    terms = drive_terms(motion, "viscous", motion.velocity)
    if shape.get(TURBULENT):
        terms += drive_terms(motion, TURBULENT, motion.velocity * np.abs(motion.velocity))
    return terms


def _seen(motions: Sequence[Motion]) -> tuple[Shape, ...]:
    """With the drag of a fluid where the square of the speed halves what simpler laws leave of the torque."""
    inner = [(m, slice(m.lead, None)) for m in motions]
    torque, position, speed, acceleration = (
        np.concatenate([getattr(m, name)[here] for m, here in inner])
        for name in ("torque", "position", "velocity", "acceleration")
    )
    fastest = max(float(np.abs(speed).max()), 1e-12)
    dry = [np.tanh(speed / (share * fastest)) for share in DRY_SHARES]
    laws = (np.ones_like(speed), acceleration, position, speed, *dry, speed * np.abs(speed))
    columns = np.stack([law / max(float(np.abs(law).max()), 1e-300) for law in laws], axis=1)

    def left(columns: Array) -> float:
        return float(np.mean((torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]) ** 2))

    without, beside = left(columns[:, :-1]), left(columns)
    told = without > LEAST_LEFT * float(torque.var()) and beside < LEAST_GAIN * without
    return ({}, {TURBULENT: 1.0}) if told else ({},)


def _of_an_axis(shape: Shape) -> str:
    if shape.get(TURBULENT):
        return (
            "The motor's equation misses a torque that grows with the square of its speed, as that of a fan "
            "or of a fluid that is pressed through an orifice."
        )
    return "The motor's equation misses a torque, in proportion to motor speed."


EFFECT = Effect(
    id="motor_viscous_friction",
    title="Viscous friction in motor and gearbox",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        "viscous": Parameter(
            "N m s/rad", 0.0, 0.02, 0.001, title="viscous coefficient", varies_between_runs=True
        ),
        TURBULENT: Parameter(
            "N m s^2/rad^2", 0.0, 0.02, 0.001, title="drag by the square of the speed", cable="none"
        ),
    },
    columns=columns,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, in proportion to motor speed.",
    reveal="a motor-bench run at several speeds",
    of_an_axis=_of_an_axis,
    reveal_of_an_axis="runs at several speeds",
    mend="Use a thinner grease in the gearbox, let it warm up, or move more slowly.",
    shapes_seen=_seen,
    switches_seen=(TURBULENT,),
    bench=True,
    followed={"viscous": "Motor friction, viscous"},
    like_late_torque=True,
    formula=Formula(
        equation=r"\tau_m = B\,\dot\theta_m + D\,\dot\theta_m\,|\dot\theta_m|",
        symbols=(
            "B: viscous coefficient at the gearbox output. D: drag of a flow that is turbulent, which is "
            "tried of a motor alone."
        ),
        source=(
            "Friction in proportion to speed (Olsson et al. 1998), at the gearbox output; drag by the square "
            "of the speed (Rayleigh 1876), as of a fan or an orifice."
        ),
        values={"viscous": "B", TURBULENT: "D"},
        alike=("viscous_friction", "motor_stribeck_friction"),
    ),
    example=Example(
        {TURBULENT: 1.0},
        {"velocity": -3.0},
        {"BENCH viscous": -3.0, "BENCH turbulent": -9.0},
        on_bench=True,
    ),
)

"""Seals of motor and gearbox: friction that builds up over degrees."""

from fingerlab.twin.plant import (
    DRIVE,
    MOTOR,
    Plant,
    PlantEffect,
    Values,
    constant,
    numbers_for_fit,
    numbers_of_fit,
    spread,
)


def apply(bench: Plant, v: Values) -> None:
    spread(bench, MOTOR, v["torque"], v["travel"])


EFFECT = PlantEffect(
    id="motor_presliding",
    parameters=(constant("torque", "N m", 7.0e-3, 2e-3, 2.5e-2), constant("travel", "rad", 0.15, 0.04, 0.4)),
    phases=DRIVE,
    apply=apply,
    found=numbers_of_fit(wound=True, torque="dahl"),
    expected=numbers_for_fit(torque="dahl"),
)

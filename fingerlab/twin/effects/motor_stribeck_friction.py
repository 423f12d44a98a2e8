"""Motor and gearbox rub, and break away harder than they slide."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    MOTOR,
    Plant,
    PlantEffect,
    Values,
    breaking_away,
    constant,
)


def apply(bench: Plant, v: Values) -> None:
    breaking_away(bench, {MOTOR: 1.0}, v, v["torque"])


EFFECT = PlantEffect(
    id="motor_stribeck_friction",
    parameters=(
        constant("torque", "N m", 4.5e-3, 1e-3, 2e-2),
        constant("excess", "", 1.0, 0.3, 2.0, "assumed: breakaway over sliding level"),
        constant("speed", "rad/s", 0.25, 0.05, 1.0),
        GEAR_WIND_UP,
    ),
    phases=DRIVE,
    apply=apply,
)

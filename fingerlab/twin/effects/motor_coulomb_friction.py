"""Motor and gearbox rub."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    MOTOR,
    Plant,
    PlantEffect,
    Values,
    constant,
    dry,
    numbers_for_fit,
    numbers_of_fit,
)


def apply(bench: Plant, v: Values) -> None:
    dry(bench, MOTOR, v["torque"], v["travel"])


EFFECT = PlantEffect(
    id="motor_coulomb_friction",
    parameters=(
        constant("torque", "N m", 6.0e-3, 1.5e-3, 2.5e-2, "RE40 no-load current 137 mA is 17.8 mN m"),
        GEAR_WIND_UP,
    ),
    phases=DRIVE,
    apply=apply,
    found=numbers_of_fit(wound=True, torque="coulomb"),
    expected=numbers_for_fit(torque="coulomb"),
    practised=True,
)

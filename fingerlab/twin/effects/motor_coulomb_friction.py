"""Motor and gearbox rub."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    MOTOR,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    constant,
    dry,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    dry(bench, MOTOR, v["torque"], v["travel"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"torque": v["coulomb"], **winding(v)}


def expected(v: Values) -> dict[str, float]:
    return {"coulomb": v["torque"]}


EFFECT = PlantEffect(
    id="motor_coulomb_friction",
    parameters=(
        constant("torque", "N m", 6.0e-3, 1.5e-3, 2.5e-2, "RE40 no-load current 137 mA is 17.8 mN m"),
        GEAR_WIND_UP,
    ),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

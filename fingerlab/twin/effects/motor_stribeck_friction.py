"""Motor and gearbox rub, and break away harder than they slide."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    LEAST,
    MOTOR,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    breaking_away,
    constant,
    half_speed,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    breaking_away(bench, {MOTOR: 1.0}, v, v["torque"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    excess = v["extra"] / max(v["coulomb"], LEAST)
    return {"torque": v["coulomb"], "excess": excess, "speed": half_speed(v), **winding(v)}


def expected(v: Values) -> dict[str, float]:
    return {"coulomb": v["torque"], "extra": v["torque"] * v["excess"]}


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
    found=found,
    expected=expected,
)

"""Motor and gearbox rub more in one direction than in the other."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    LEAST,
    MOTOR,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    constant,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    law = bench.friction[MOTOR]
    law["forward"] += v["torque"] * (1.0 + v["asymmetry"])
    law["backward"] += v["torque"] * (1.0 - v["asymmetry"])
    law["travel"] = v["travel"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    asymmetry = v["difference"] / max(v["coulomb"], LEAST)
    return {"torque": v["coulomb"], "asymmetry": asymmetry, **winding(v)}


def expected(v: Values) -> dict[str, float]:
    return {"coulomb": v["torque"], "difference": v["torque"] * v["asymmetry"]}


EFFECT = PlantEffect(
    id="asymmetric_friction",
    parameters=(
        constant("torque", "N m", 6.0e-3, 1.5e-3, 2.5e-2, "mean of the two directions"),
        constant("asymmetry", "", 0.5, -0.9, 0.9),
        GEAR_WIND_UP,
    ),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

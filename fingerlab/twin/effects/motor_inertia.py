"""A coupling and a larger pulley on the output shaft."""

from fingerlab.twin.plant import DRIVE, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["inertia"] += v["inertia"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"inertia": v["inertia"]}


def expected(v: Values) -> dict[str, float]:
    return {"inertia": v["inertia"]}


EFFECT = PlantEffect(
    id="motor_inertia",
    parameters=(constant("inertia", "kg m^2", 4.0e-4, 1e-4, 2e-3, "assumed: steel disc of 40 mm"),),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
)

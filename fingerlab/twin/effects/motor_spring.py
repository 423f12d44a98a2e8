"""An elastic torque at the output shaft (cable loop, seals, return spring)."""

from fingerlab.twin.plant import DRIVE, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["motor_spring"] += v["stiffness"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"stiffness": v["stiffness"]}


def expected(v: Values) -> dict[str, float]:
    return {"stiffness": v["stiffness"]}


EFFECT = PlantEffect(
    id="motor_spring",
    parameters=(constant("stiffness", "N m/rad", 0.03, 5e-3, 0.15),),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

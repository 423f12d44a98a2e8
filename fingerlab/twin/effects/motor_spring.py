"""An elastic torque at the output shaft (cable loop, seals, return spring)."""

from fingerlab.twin.plant import DRIVE, Plant, PlantEffect, Values, constant, numbers_for_fit, numbers_of_fit


def apply(bench: Plant, v: Values) -> None:
    bench.plant["motor_spring"] += v["stiffness"]


EFFECT = PlantEffect(
    id="motor_spring",
    parameters=(constant("stiffness", "N m/rad", 0.03, 5e-3, 0.15),),
    phases=DRIVE,
    apply=apply,
    found=numbers_of_fit(stiffness="stiffness"),
    expected=numbers_for_fit(stiffness="stiffness"),
    practised=True,
)

"""A coupling and a larger pulley on the output shaft."""

from fingerlab.twin.plant import DRIVE, Plant, PlantEffect, Values, constant, numbers_for_fit, numbers_of_fit


def apply(bench: Plant, v: Values) -> None:
    bench.plant["inertia"] += v["inertia"]


EFFECT = PlantEffect(
    id="motor_inertia",
    parameters=(constant("inertia", "kg m^2", 4.0e-4, 1e-4, 2e-3, "assumed: steel disc of 40 mm"),),
    phases=DRIVE,
    apply=apply,
    found=numbers_of_fit(inertia="inertia"),
    expected=numbers_for_fit(inertia="inertia"),
)

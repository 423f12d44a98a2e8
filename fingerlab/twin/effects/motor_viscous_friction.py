"""Grease in motor and gearbox."""

from fingerlab.twin.plant import DRIVE, Plant, PlantEffect, Values, constant, numbers_for_fit, numbers_of_fit


def apply(bench: Plant, v: Values) -> None:
    bench.plant["motor_viscous"] += v["coefficient"]


EFFECT = PlantEffect(
    id="motor_viscous_friction",
    parameters=(constant("coefficient", "N m s/rad", 4.0e-3, 5e-4, 1.5e-2),),
    phases=DRIVE,
    apply=apply,
    found=numbers_of_fit(coefficient="viscous"),
    expected=numbers_for_fit(coefficient="viscous"),
    practised=True,
)

"""Grease in motor and gearbox, and a fluid that is stirred."""

from fingerlab.twin.plant import DRIVE, Nominal, Plant, PlantEffect, Values, constant, numbers_for_fit


def apply(bench: Plant, v: Values) -> None:
    bench.plant["motor_viscous"] += v["coefficient"]
    bench.plant["motor_drag"] += v["drag"]


def found(v: Values, nominal: Nominal) -> Values:
    return {"coefficient": v["viscous"], "drag": v.get("turbulent", 0.0)}


EFFECT = PlantEffect(
    id="motor_viscous_friction",
    parameters=(
        constant("coefficient", "N m s/rad", 4.0e-3, 0.0, 1.5e-2),
        constant("drag", "N m s^2/rad^2", 0.0, 0.0, 1.5e-2, "assumed: none in a gearbox"),
    ),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=numbers_for_fit(coefficient="viscous"),
    practised=True,
)

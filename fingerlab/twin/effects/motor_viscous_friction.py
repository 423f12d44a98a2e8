"""Grease in motor and gearbox."""

from fingerlab.twin.plant import DRIVE, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["motor_viscous"] += v["coefficient"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"coefficient": v["viscous"]}


def expected(v: Values) -> dict[str, float]:
    return {"viscous": v["coefficient"]}


EFFECT = PlantEffect(
    id="motor_viscous_friction",
    parameters=(constant("coefficient", "N m s/rad", 4.0e-3, 5e-4, 1.5e-2),),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

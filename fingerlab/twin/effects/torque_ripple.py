"""Torque that repeats with the motor angle (gear mesh, commutation)."""

from fingerlab.twin.plant import DRIVE, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["ripple"] = v["torque"]
    bench.plant["ripple_order"] = v["order"]
    bench.plant["ripple_phase"] = bench.truth.phase


EFFECT = PlantEffect(
    id="torque_ripple",
    parameters=(constant("torque", "N m", 4.0e-3, 1e-3, 1.5e-2), constant("order", "1/rev", 22.0, 8.0, 60.0)),
    phases=DRIVE,
    apply=apply,
)

"""Torque that repeats with the motor angle (gear mesh, commutation)."""

import math

from fingerlab.twin.plant import DRIVE, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["ripple"] = v["torque"]
    bench.plant["ripple_order"] = v["order"]
    bench.plant["ripple_phase"] = bench.truth.phase


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    size, phase = math.hypot(v["sine"], v["cosine"]), math.atan2(v["cosine"], v["sine"])
    return {"torque": size, "order": v["order"], "phase": phase}


EFFECT = PlantEffect(
    id="torque_ripple",
    parameters=(constant("torque", "N m", 4.0e-3, 1e-3, 1.5e-2), constant("order", "1/rev", 22.0, 8.0, 60.0)),
    phases=DRIVE,
    apply=apply,
    found=found,
    practised=True,
)

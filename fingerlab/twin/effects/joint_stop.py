"""The PIP hinge meets a stop in extension."""

import math

from fingerlab.twin.plant import FINGER, LEAST, Nominal, NotCarriedError, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["stop_stiffness"] = v["stiffness"]
    bench.plant["stop_angle"] = v["angle"]
    bench.plant["stop_damping"] = v["damping"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    if v["edge_deg"] > 0.0 or not v.get("hertz") or v["stop_pip"] <= LEAST:
        raise NotCarriedError("its stop is that of the PIP in extension, between round faces")
    # The shift is told as a torque: 1.5 times the stiffness times the way, against the extension.
    way = v["shift_pip"] / (1.5 * v["stop_pip"])
    return {
        "stiffness": v["stop_pip"],
        "angle": math.radians(v["edge_deg"]) + way,
        "damping": max(v["damp_pip"] / v["stop_pip"], 0.0),
    }


EFFECT = PlantEffect(
    id="joint_stop",
    parameters=(
        constant("stiffness", "N m/rad^1.5", 0.8, 0.2, 5.0),
        constant("angle", "rad", -0.28, -0.5, -0.1),
        constant("damping", "s/rad", 0.2, 0.0, 1.0),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    practised=True,
)

"""Offset and unequal amplitude of the angle sensors' bridges."""

import math

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    # Half the bridge angle is the shaft angle: an error e of the bridges turns into e / 2 of angle.
    bench.sensors.bridge_offset = 2.0 * v["angle"] * math.cos(bench.truth.phase)
    bench.sensors.bridge_mismatch = 4.0 * v["angle"] * bench.truth.sign


EFFECT = PlantEffect(
    id="angle_sensor_nonlinearity",
    parameters=(
        constant(
            "angle",
            "rad",
            0.03,
            8e-3,
            0.08,
            "KMA210 data sheet: error up to 1.1 degrees; misplaced magnet more",
        ),
    ),
    phases=FINGER,
    apply=apply,
)

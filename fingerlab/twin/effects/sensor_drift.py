"""The MCP angle sensor drifts as it warms up."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.sensors.drift = v["angle"] * bench.truth.sign


EFFECT = PlantEffect(
    id="sensor_drift",
    parameters=(
        constant(
            "angle", "rad", 0.03, 8e-3, 0.1, "KMA210 data sheet: 0.64 degrees over temperature; more assumed"
        ),
    ),
    phases=FINGER,
    apply=apply,
)

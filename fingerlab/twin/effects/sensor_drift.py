"""The MCP angle sensor drifts as it warms up."""

import math

from fingerlab.twin.plant import FINGER, Nominal, NotCarriedError, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.sensors.drift = v["angle"] * bench.truth.sign


RUN_S = 30.0
"""A run of the thesis; what warms up does so over one (s)."""


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    if abs(v["rate_pip"]) > abs(v["rate_mcp"]):
        raise NotCarriedError("its drift is that of the MCP sensor")
    warm = v["time_constant"]
    return {"angle": -v["rate_mcp"] * warm * math.expm1(-RUN_S / warm), "sign": 1.0}


EFFECT = PlantEffect(
    id="sensor_drift",
    parameters=(
        constant(
            "angle", "rad", 0.03, 8e-3, 0.1, "KMA210 data sheet: 0.64 degrees over temperature; more assumed"
        ),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
)

"""The fingertip presses on a face that leans from the load cell's axis."""

import math

from fingerlab.twin.plant import TOUCH, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["contact_angle"] += v["angle"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"angle": math.atan(v["lean"])}


def expected(v: Values) -> dict[str, float]:
    return {"lean": math.tan(v["angle"])}


EFFECT = PlantEffect(
    id="contact_angle",
    parameters=(constant("angle", "rad", 0.45, 0.1, 1.05, "thesis figure 5.2 tried up to 60 degrees"),),
    phases=TOUCH,
    apply=apply,
    found=found,
    expected=expected,
)

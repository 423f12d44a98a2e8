"""The flexion cable passes the MCP closer and the PIP farther than the bench expects."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    if bench.cable == "flexion":
        bench.plant["arm_1"] *= 1.0 - v["relative"]
        bench.plant["arm_2"] *= 1.0 + v["relative"]


EFFECT = PlantEffect(
    id="routing_change",
    parameters=(constant("relative", "", 0.35, -0.5, 0.5),),
    phases=FINGER,
    apply=apply,
)

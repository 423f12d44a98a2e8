"""The flexion cable passes the MCP closer and the PIP farther than the bench expects."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    if bench.cable == "flexion":
        bench.plant["arm_1"] *= 1.0 - v["relative"]
        bench.plant["arm_2"] *= 1.0 + v["relative"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"relative": 0.0}  # the arms of the flexion cable are those that were found


EFFECT = PlantEffect(
    id="routing_change",
    parameters=(constant("relative", "", 0.35, -0.5, 0.5),),
    phases=FINGER,
    apply=apply,
    found=found,
)

"""The distal body's spin counts with its absolute speed, as it really does."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["distal_rotation"] = v["share"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"share": v["share"]}


EFFECT = PlantEffect(
    id="distal_rotation",
    parameters=(constant("share", "", 1.0, 0.0, 1.0, "0 is the thesis' energy, 1 is rigid-body mechanics"),),
    phases=FINGER,
    apply=apply,
    found=found,
)

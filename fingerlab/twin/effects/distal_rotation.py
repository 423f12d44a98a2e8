"""The distal body's spin counts with its absolute speed, as it really does."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant, numbers_of_fit


def apply(bench: Plant, v: Values) -> None:
    bench.plant["distal_rotation"] = v["share"]


EFFECT = PlantEffect(
    id="distal_rotation",
    parameters=(constant("share", "", 1.0, 0.0, 1.0, "0 is the thesis' energy, 1 is rigid-body mechanics"),),
    phases=FINGER,
    apply=apply,
    found=numbers_of_fit(share="share"),
)

"""The cable rubs in its sheath and sticks there at reversal."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["wrap"] += v["wrap"]


EFFECT = PlantEffect(
    id="capstan_friction",
    parameters=(
        constant("wrap", "", 0.18, 0.05, 0.6, "friction 0.1 to 0.2 times the bend; Kaneko's sheath model"),
    ),
    phases=FINGER,
    apply=apply,
)

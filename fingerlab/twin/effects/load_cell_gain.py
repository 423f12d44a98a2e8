"""The load cell reads too much."""

from fingerlab.twin.plant import TOUCH, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.sensors.force_gain *= 1.0 + v["relative"]


EFFECT = PlantEffect(
    id="load_cell_gain",
    parameters=(
        constant(
            "relative", "", 0.15, -0.3, 0.3, "FC2231 span is good to 5 %; a wrong calibration does more"
        ),
    ),
    phases=TOUCH,
    apply=apply,
)

"""The load cell reads too much."""

from fingerlab.twin.plant import TOUCH, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.sensors.force_gain *= 1.0 + v["relative"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"relative": 1.0 / (1.0 + v["gain"]) - 1.0}


EFFECT = PlantEffect(
    id="load_cell_gain",
    parameters=(
        constant(
            "relative", "", 0.15, -0.3, 0.3, "FC2231 span is good to 5 %; a wrong calibration does more"
        ),
    ),
    phases=TOUCH,
    apply=apply,
    found=found,
)

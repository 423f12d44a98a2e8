"""The cable rubs in its sheath and sticks there at reversal."""

import math

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["wrap"] += v["wrap"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    # What a wrap lets through of the tension is exp(-wrap); one wrap for both cables.
    let_through = [v[cable] for cable in ("extension", "flexion") if cable in v]
    return {"wrap": -math.log1p(-min(sum(let_through) / len(let_through), 0.9))}


EFFECT = PlantEffect(
    id="capstan_friction",
    parameters=(
        constant("wrap", "", 0.18, 0.05, 0.6, "friction 0.1 to 0.2 times the bend; Kaneko's sheath model"),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    practised=True,
)

"""The base stands at another angle than the wrist angle in the rig file."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["tilt"] += v["angle"] * bench.truth.sign


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"angle": v["tilt"], "sign": 1.0}


def expected(v: Values) -> dict[str, float]:
    return {"tilt": v["angle"]}


EFFECT = PlantEffect(
    id="gravity_tilt",
    parameters=(constant("angle", "rad", 0.26, 0.05, 0.6, "assumed: 15 degrees"),),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
)

"""Play between gearbox and pulley, whose bearing holds it where it was left until the gap is closed.

Idealised: the cable's torque reaches the motor also while the gap is crossed. Under a cable that only pulls,
a free pulley would rest against one flank for ever and play would never show.
"""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["play"] += v["play"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"play": 2.0 * v["half_gap"]}


def expected(v: Values) -> dict[str, float]:
    return {"half_gap": 0.5 * v["play"]}


EFFECT = PlantEffect(
    id="backlash",
    parameters=(
        constant(
            "play", "rad", 0.015, 4e-3, 0.025, "GP 42C data sheet: below 1 degree; keyed pulley adds to it"
        ),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

"""Joint angles and force reach the recorder later than the motor's own channels."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.sensors.delay += v["delay"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"delay": max(v["delay"], 0.0)}


def expected(v: Values) -> dict[str, float]:
    return {"delay": v["delay"]}


EFFECT = PlantEffect(
    id="transport_delay",
    parameters=(constant("delay", "s", 0.04, 5e-3, 0.2, "thesis section 4.2 saw 162 ms; cause open"),),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

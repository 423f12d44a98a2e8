"""Dead travel: the cable hangs loose until this length is wound."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["slack"] += v["travel"]


EFFECT = PlantEffect(
    id="cable_slack",
    parameters=(constant("travel", "m", 3.5e-3, 8e-4, 8e-3, "thesis chapter 5: 'some slack'; size assumed"),),
    phases=FINGER,
    apply=apply,
)

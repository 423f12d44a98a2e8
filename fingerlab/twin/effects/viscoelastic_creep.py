"""A relaxing spring beside each joint spring."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    for joint in ("1", "2"):
        bench.plant["relaxing_" + joint] = bench.plant["stiffness_" + joint] * v["relative"]
    bench.plant["relaxation_time"] = v["time"]


EFFECT = PlantEffect(
    id="viscoelastic_creep",
    parameters=(
        constant("relative", "", 0.3, 0.08, 1.0, "assumed: instantaneous over relaxed stiffness, less one"),
        constant("time", "s", 0.8, 0.1, 5.0, "assumed: silicone and printed ABS"),
    ),
    phases=FINGER,
    apply=apply,
)

"""Cable guides whose lever changes as the joint turns."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    # An extension cable climbs over the knuckle as the joint extends, a flexion cable bows out.
    bench.plant["arm_slope_1"] += v["slope"] * bench.plant["cable_sign"]
    bench.plant["arm_slope_2"] += v["slope"] * v["pip_ratio"] * bench.plant["cable_sign"]


EFFECT = PlantEffect(
    id="varying_moment_arm",
    parameters=(
        constant("slope", "1/rad", 0.45, 0.1, 1.2, "assumed: straight cable between guides"),
        constant("pip_ratio", "", 0.8, 0.3, 1.2),
    ),
    phases=FINGER,
    apply=apply,
)

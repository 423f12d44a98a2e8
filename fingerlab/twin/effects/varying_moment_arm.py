"""Cable guides whose lever changes as the joint turns."""

from fingerlab.twin.plant import (
    FINGER,
    Nominal,
    NotCarriedError,
    Plant,
    PlantEffect,
    Values,
    both_joints,
    constant,
)


def apply(bench: Plant, v: Values) -> None:
    # An extension cable climbs over the knuckle as the joint extends, a flexion cable bows out.
    bench.plant["arm_slope_1"] += v["slope"] * bench.plant["cable_sign"]
    bench.plant["arm_slope_2"] += v["slope"] * v["pip_ratio"] * bench.plant["cable_sign"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    turn, growth = v["turn_mcp"], v["growth_mcp"]
    if abs(growth) + abs(v["growth_pip"]) > abs(turn) + abs(v["turn_pip"]):
        raise NotCarriedError("its arms grow with the side on which the cable runs, not alike on both")
    shares = both_joints(turn, v["turn_pip"])
    return {"slope": shares["mcp"], "pip_ratio": shares["pip_ratio"]}


EFFECT = PlantEffect(
    id="varying_moment_arm",
    parameters=(
        constant("slope", "1/rad", 0.45, 0.1, 1.2, "assumed: straight cable between guides"),
        constant("pip_ratio", "", 0.8, 0.3, 1.2),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
)

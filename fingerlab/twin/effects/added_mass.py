"""Screws, magnets and covers on the distal body and at the PIP axis."""

from fingerlab.twin.plant import FINGER, LEAST, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["distal_mass"] += v["distal"]
    bench.plant["knuckle_mass"] += v["distal"] * v["knuckle_ratio"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    # A point at a share of the distal body weighs as much about the PIP as twice that share at its middle.
    distal = max(2.0 * v["place"] * v["mass"], LEAST)
    return {"distal": distal, "knuckle_ratio": max(v["mass"] - distal, 0.0) / distal}


EFFECT = PlantEffect(
    id="added_mass",
    parameters=(
        constant("distal", "kg", 6.0e-3, 1e-3, 1.5e-2, "assumed: M3 screws, ring magnet, cover"),
        constant("knuckle_ratio", "", 0.7, 0.0, 2.0),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
)

"""Joint springs with a cubic term."""

from fingerlab.twin.plant import FINGER, RATIO, Plant, PlantEffect, Values, constant, per_joint


def apply(bench: Plant, v: Values) -> None:
    per_joint(bench, "cubic", v["mcp"], v["pip_ratio"])


EFFECT = PlantEffect(
    id="spring_hardening",
    parameters=(constant("mcp", "N m/rad^3", 0.35, 0.08, 1.2), RATIO),
    phases=FINGER,
    apply=apply,
)

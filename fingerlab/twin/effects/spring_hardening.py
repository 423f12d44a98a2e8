"""Joint springs with a cubic term."""

from fingerlab.twin.plant import (
    FINGER,
    RATIO,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    both_joints,
    constant,
    gains_of_joints,
    per_joint,
)


def apply(bench: Plant, v: Values) -> None:
    per_joint(bench, "cubic", v["mcp"], v["pip_ratio"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return both_joints(v["cubic_mcp"], v["cubic_pip"])


def expected(v: Values) -> dict[str, float]:
    return gains_of_joints("cubic", v)


EFFECT = PlantEffect(
    id="spring_hardening",
    parameters=(constant("mcp", "N m/rad^3", 0.35, 0.08, 1.2), RATIO),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

"""Grease in both hinges."""

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
    per_joint(bench, "viscous", v["mcp"], v["pip_ratio"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return both_joints(v["viscous_mcp"], v["viscous_pip"])


def expected(v: Values) -> dict[str, float]:
    return gains_of_joints("viscous", v)


EFFECT = PlantEffect(
    id="viscous_friction",
    parameters=(constant("mcp", "N m s/rad", 2.5e-3, 5e-4, 8e-3), RATIO),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

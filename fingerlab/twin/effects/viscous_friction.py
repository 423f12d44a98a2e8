"""Grease in both hinges."""

from functools import partial

from fingerlab.twin.plant import (
    FINGER,
    RATIO,
    Plant,
    PlantEffect,
    Values,
    constant,
    gains_of_joints,
    joints_of_fit,
    per_joint,
)


def apply(bench: Plant, v: Values) -> None:
    per_joint(bench, "viscous", v["mcp"], v["pip_ratio"])


EFFECT = PlantEffect(
    id="viscous_friction",
    parameters=(constant("mcp", "N m s/rad", 2.5e-3, 5e-4, 8e-3), RATIO),
    phases=FINGER,
    apply=apply,
    found=joints_of_fit("viscous"),
    expected=partial(gains_of_joints, "viscous"),
    practised=True,
)

"""Joint springs with a cubic term."""

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
    per_joint(bench, "cubic", v["mcp"], v["pip_ratio"])


EFFECT = PlantEffect(
    id="spring_hardening",
    parameters=(constant("mcp", "N m/rad^3", 0.35, 0.08, 1.2), RATIO),
    phases=FINGER,
    apply=apply,
    found=joints_of_fit("cubic"),
    expected=partial(gains_of_joints, "cubic"),
    practised=True,
)

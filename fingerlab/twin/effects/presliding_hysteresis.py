"""Soft seals in both hinges: friction that builds up over degrees (spring-sliders in a row)."""

from functools import partial

from fingerlab.twin.plant import (
    FINGER,
    MCP,
    PIP,
    RATIO,
    Plant,
    PlantEffect,
    Values,
    constant,
    gains_of_joints,
    joints_of_fit,
    spread,
)


def apply(bench: Plant, v: Values) -> None:
    spread(bench, MCP, v["mcp"], v["travel"])
    spread(bench, PIP, v["mcp"] * v["pip_ratio"], v["travel"])


EFFECT = PlantEffect(
    id="presliding_hysteresis",
    parameters=(
        constant("mcp", "N m", 3.0e-3, 8e-4, 8e-3),
        constant("travel", "rad", 0.12, 0.03, 0.3),
        RATIO,
    ),
    phases=FINGER,
    apply=apply,
    found=joints_of_fit("dahl", wound=True),
    expected=partial(gains_of_joints, "dahl"),
    practised=True,
)

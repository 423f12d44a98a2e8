"""Both hinges rub: a spring-slider that truly sticks."""

from functools import partial

from fingerlab.twin.plant import (
    FINGER,
    MCP,
    PIP,
    RATIO,
    WIND_UP,
    Plant,
    PlantEffect,
    Values,
    constant,
    dry,
    gains_of_joints,
    joints_of_fit,
)


def apply(bench: Plant, v: Values) -> None:
    dry(bench, MCP, v["mcp"], v["travel"])
    dry(bench, PIP, v["mcp"] * v["pip_ratio"], v["travel"])


EFFECT = PlantEffect(
    id="coulomb_friction",
    parameters=(constant("mcp", "N m", 2.5e-3, 6e-4, 8e-3), RATIO, WIND_UP),
    phases=FINGER,
    apply=apply,
    found=joints_of_fit("coulomb", wound=True),
    expected=partial(gains_of_joints, "coulomb"),
)

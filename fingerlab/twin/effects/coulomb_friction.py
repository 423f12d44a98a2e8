"""Both hinges rub: a spring-slider that truly sticks."""

from fingerlab.twin.plant import (
    FINGER,
    MCP,
    PIP,
    RATIO,
    WIND_UP,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    both_joints,
    constant,
    dry,
    gains_of_joints,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    dry(bench, MCP, v["mcp"], v["travel"])
    dry(bench, PIP, v["mcp"] * v["pip_ratio"], v["travel"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return both_joints(v["coulomb_mcp"], v["coulomb_pip"]) | winding(v)


def expected(v: Values) -> dict[str, float]:
    return gains_of_joints("coulomb", v)


EFFECT = PlantEffect(
    id="coulomb_friction",
    parameters=(constant("mcp", "N m", 2.5e-3, 6e-4, 8e-3), RATIO, WIND_UP),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
)

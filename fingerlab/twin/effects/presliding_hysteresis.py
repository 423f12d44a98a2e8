"""Soft seals in both hinges: friction that builds up over degrees (spring-sliders in a row)."""

from fingerlab.twin.plant import (
    FINGER,
    MCP,
    PIP,
    RATIO,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    both_joints,
    constant,
    gains_of_joints,
    spread,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    spread(bench, MCP, v["mcp"], v["travel"])
    spread(bench, PIP, v["mcp"] * v["pip_ratio"], v["travel"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return both_joints(v["dahl_mcp"], v["dahl_pip"]) | winding(v)


def expected(v: Values) -> dict[str, float]:
    return gains_of_joints("dahl", v)


EFFECT = PlantEffect(
    id="presliding_hysteresis",
    parameters=(
        constant("mcp", "N m", 3.0e-3, 8e-4, 8e-3),
        constant("travel", "rad", 0.12, 0.03, 0.3),
        RATIO,
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

"""Both hinges rub, and break away harder than they slide."""

from fingerlab.twin.plant import (
    FINGER,
    LEAST,
    MCP,
    PIP,
    RATIO,
    WIND_UP,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    both_joints,
    breaking_away,
    constant,
    gains_of_joints,
    half_speed,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    breaking_away(bench, {MCP: 1.0, PIP: v["pip_ratio"]}, v, v["mcp"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    level = max(v["coulomb_mcp"] + v["coulomb_pip"], LEAST)
    excess = (v["extra_mcp"] + v["extra_pip"]) / level
    joints = both_joints(v["coulomb_mcp"], v["coulomb_pip"])
    return {**joints, **winding(v), "excess": excess, "speed": half_speed(v)}


def expected(v: Values) -> dict[str, float]:
    return gains_of_joints("coulomb", v) | gains_of_joints("extra", v, v["excess"])


EFFECT = PlantEffect(
    id="stribeck_friction",
    parameters=(
        constant("mcp", "N m", 2.0e-3, 5e-4, 6e-3),
        constant("excess", "", 1.0, 0.3, 2.0, "assumed: breakaway over sliding level"),
        constant("speed", "rad/s", 0.3, 0.05, 1.0, "assumed: half of the excess is gone"),
        RATIO,
        WIND_UP,
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
)

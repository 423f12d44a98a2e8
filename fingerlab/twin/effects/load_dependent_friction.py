"""Tooth friction: a share of the torque transmitted is lost in either direction."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    MOTOR,
    Nominal,
    Plant,
    PlantEffect,
    Values,
    constant,
    winding,
)


def apply(bench: Plant, v: Values) -> None:
    bench.friction[MOTOR]["load_share"] += v["share"]
    bench.friction[MOTOR]["travel"] = v["travel"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"share": v["share"], **winding(v)}


def expected(v: Values) -> dict[str, float]:
    return {"share": v["share"]}


EFFECT = PlantEffect(
    id="load_dependent_friction",
    parameters=(
        constant("share", "", 0.13, 0.03, 0.35, "GP 42C efficiency 90 %; more when dry"),
        GEAR_WIND_UP,
    ),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

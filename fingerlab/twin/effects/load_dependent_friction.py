"""Tooth friction: a share of the torque transmitted is lost in either direction."""

from fingerlab.twin.plant import (
    DRIVE,
    GEAR_WIND_UP,
    MOTOR,
    Plant,
    PlantEffect,
    Values,
    constant,
    numbers_for_fit,
    numbers_of_fit,
)


def apply(bench: Plant, v: Values) -> None:
    bench.friction[MOTOR]["load_share"] += v["share"]
    bench.friction[MOTOR]["travel"] = v["travel"]


EFFECT = PlantEffect(
    id="load_dependent_friction",
    parameters=(
        constant("share", "", 0.13, 0.03, 0.35, "GP 42C efficiency 90 %; more when dry"),
        GEAR_WIND_UP,
    ),
    phases=DRIVE,
    apply=apply,
    found=numbers_of_fit(wound=True, share="share"),
    expected=numbers_for_fit(share="share"),
    practised=True,
)

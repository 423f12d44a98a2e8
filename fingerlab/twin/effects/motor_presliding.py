"""Seals of motor and gearbox: friction that builds up over degrees."""

from fingerlab.twin.plant import DRIVE, MOTOR, Nominal, Plant, PlantEffect, Values, constant, spread, winding


def apply(bench: Plant, v: Values) -> None:
    spread(bench, MOTOR, v["torque"], v["travel"])


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"torque": v["dahl"], **winding(v)}


def expected(v: Values) -> dict[str, float]:
    return {"dahl": v["torque"]}


EFFECT = PlantEffect(
    id="motor_presliding",
    parameters=(constant("torque", "N m", 7.0e-3, 2e-3, 2.5e-2), constant("travel", "rad", 0.15, 0.04, 0.4)),
    phases=DRIVE,
    apply=apply,
    found=found,
    expected=expected,
)

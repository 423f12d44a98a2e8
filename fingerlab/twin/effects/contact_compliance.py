"""A soft fingertip on the load cell."""

from fingerlab.twin.plant import TOUCH, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    softer = 1.0 / (1.0 / float(bench.plant["contact_stiffness"]) + v["compliance"])
    bench.plant["tip_stiffness"] *= softer / float(bench.plant["contact_stiffness"])
    bench.plant["contact_stiffness"] = softer


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"compliance": max(v["tip_compliance"] - nominal.contact_compliance, 0.0)}


EFFECT = PlantEffect(
    id="contact_compliance",
    parameters=(constant("compliance", "m/N", 1.0e-3, 2e-4, 4e-3, "assumed: silicone cap"),),
    phases=TOUCH,
    apply=apply,
    found=found,
)

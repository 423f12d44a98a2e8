"""A compliant cable, and one that stiffens."""

from fingerlab.twin.plant import FINGER, LEAST, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    plant = bench.plant
    before = float(plant["cable_stiffness"])
    after = 1.0 / (1.0 / before + v["compliance"])
    plant["cable_stiffness"] = after
    # The same material loss at every stiffness, and no less than polymer cable has.
    plant["cable_stiffening"] = v["stiffening"]
    plant["cable_damping"] = max(plant["cable_damping"] * after / before, v["damping_time"] * after)


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    compliance = max(v["cable_compliance"], LEAST)
    # A damper beside the spring lets the stretch lag by damping over stiffness: x = c T - c t dT/dt.
    lag = v.get("time_constant", 0.0) - v["cable_damping"] / compliance
    more = max(compliance - nominal.cable_compliance, 0.0)
    stiffens_at = v.get("stiffens_at", 0.0)
    stiffening = 1.0 / stiffens_at if stiffens_at else 0.0
    return {"compliance": more, "damping_time": max(lag, 0.0), "stiffening": stiffening}


def expected(v: Values) -> dict[str, float]:
    return {"cable_compliance": v["compliance"]}


EFFECT = PlantEffect(
    id="cable_stretch",
    parameters=(
        constant("compliance", "m/N", 3.5e-4, 5e-5, 3e-3, "assumed: polymer cable or glove fabric"),
        constant("damping_time", "s", 4e-3, 1e-3, 2e-2),
        constant("stiffening", "1/N", 0.0, 0.0, 1.0),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
    practised=True,
)

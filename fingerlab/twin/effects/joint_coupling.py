"""A spring that pulls the two joint angles together (glove, skin, tendon)."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["coupling"] += v["stiffness"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    return {"stiffness": v["coupling"]}


def expected(v: Values) -> dict[str, float]:
    return {"coupling": v["stiffness"]}


EFFECT = PlantEffect(
    id="joint_coupling",
    parameters=(constant("stiffness", "N m/rad", 0.025, 5e-3, 0.08),),
    phases=FINGER,
    apply=apply,
    found=found,
    expected=expected,
)

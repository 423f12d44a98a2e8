"""A spring that pulls the two joint angles together (glove, skin, tendon)."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant, numbers_for_fit, numbers_of_fit


def apply(bench: Plant, v: Values) -> None:
    bench.plant["coupling"] += v["stiffness"]


EFFECT = PlantEffect(
    id="joint_coupling",
    parameters=(constant("stiffness", "N m/rad", 0.025, 5e-3, 0.08),),
    phases=FINGER,
    apply=apply,
    found=numbers_of_fit(stiffness="coupling"),
    expected=numbers_for_fit(stiffness="coupling"),
)

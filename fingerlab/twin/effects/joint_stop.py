"""The PIP hinge meets a stop in extension."""

from fingerlab.twin.plant import FINGER, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["stop_stiffness"] = v["stiffness"]
    bench.plant["stop_angle"] = v["angle"]
    bench.plant["stop_damping"] = v["damping"]


EFFECT = PlantEffect(
    id="joint_stop",
    parameters=(
        constant("stiffness", "N m/rad^1.5", 0.8, 0.2, 5.0),
        constant("angle", "rad", -0.28, -0.5, -0.1),
        constant("damping", "s/rad", 0.2, 0.0, 1.0),
    ),
    phases=FINGER,
    apply=apply,
)

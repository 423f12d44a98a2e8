"""Joint springs stiffer than the rig file says."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, both_joints, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["stiffness_1"] *= 1.0 + v["relative"]
    bench.plant["stiffness_2"] *= 1.0 + v["relative"] * v["pip_ratio"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    mcp, pip = v["stiffness_mcp"] / nominal.stiffness[0], v["stiffness_pip"] / nominal.stiffness[1]
    shares = both_joints(mcp, pip)
    return {"relative": shares["mcp"], "pip_ratio": shares["pip_ratio"]}


EFFECT = PlantEffect(
    id="stiffness_error",
    parameters=(constant("relative", "", 0.25, -0.5, 0.6), constant("pip_ratio", "", 1.0, 0.0, 1.5)),
    phases=FINGER,
    apply=apply,
    found=found,
)

"""A relaxing spring beside each joint spring."""

from fingerlab.twin.plant import FINGER, Nominal, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    for joint in ("1", "2"):
        bench.plant["relaxing_" + joint] = bench.plant["stiffness_" + joint] * v["relative"]
    bench.plant["relaxation_time"] = v["time"]


def found(v: Values, nominal: Nominal) -> dict[str, float]:
    # One relaxing share for both joints, by their stiffness.
    share = (v["relaxing_mcp"] + v["relaxing_pip"]) / sum(nominal.stiffness)
    return {"relative": share, "time": v["time_constant"]}


EFFECT = PlantEffect(
    id="viscoelastic_creep",
    parameters=(
        constant("relative", "", 0.3, 0.08, 1.0, "assumed: instantaneous over relaxed stiffness, less one"),
        constant("time", "s", 0.8, 0.1, 5.0, "assumed: silicone and printed ABS"),
    ),
    phases=FINGER,
    apply=apply,
    found=found,
    practised=True,
)

"""Other moment arms of the flexion cable: an unknown of every model, set free; there is no column."""

from fingerlab.effects.base import Effect, Example, Formula, Row
from fingerlab.effects.transmission import no_columns
from fingerlab.physics.parameter import Parameter

EFFECT = Effect(
    id="routing_change",
    title="Other moment arms of the flexion cable",
    family="Contact",
    acts_on=("joint_torque", "cable_kinematics", "endpoint_force"),
    gains={},
    columns=no_columns,
    relaxes={
        f"arm_{joint}@flexion": Parameter(
            "m", 0.002, 0.04, 0.003, "assumed: from 2 to 40 mm", f"{joint.upper()} arm of the flexion cable"
        )
        for joint in ("mcp", "pip")
    },
    cables=("extension", "flexion"),
    coordinate="tension",
    equation=Row.PIP,
    explanation="The flexion cable's moment arms do not go with those of the extension cable.",
    reveal="free motion with the flexion cable",
    mend="Lead the flexion cable as its moment arms were measured, or measure them anew.",
    formula=Formula(
        equation=(
            r"a_\mathrm{flexion} \ne \rho_1\,a_\mathrm{extension},\qquad b_\mathrm{flexion} \ne "
            r"\rho_2\,b_\mathrm{extension}"
        ),
        symbols=(
            "ρ_1, ρ_2: usual ratio of the two cables' moment arms, within its tolerance ([unknowns "
            "of every model](../nuisances.md))."
        ),
        source="Ours: the thesis takes one set of moment arms for both cables.",
        values={"arm_mcp@flexion": r"a_\mathrm{flexion}", "arm_pip@flexion": r"b_\mathrm{flexion}"},
        alike=("contact_angle", "load_cell_gain"),
    ),
    example=Example({}, {"torque": 0.02}, {}),
)

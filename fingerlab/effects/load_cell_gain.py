"""A load cell of another span."""

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    mcp, pip = motion.contact_torques
    return [Term(Row.MCP, "gain", mcp, "joint"), Term(Row.PIP, "gain", pip, "joint")]


EFFECT = Effect(
    id="load_cell_gain",
    title="Span error of the load cell",
    family="Sensors",
    acts_on=("endpoint_force",),
    gains={"gain": Parameter("1", -0.3, 0.3, 0.05, title="force that the load cell leaves out, as a share")},
    columns=columns,
    coordinate="force",
    equation=Row.PIP,
    explanation="In contact both joints miss a torque in proportion to the force that was read.",
    reveal="a calibration of the load cell with known weights",
    mend="Calibrate the load cell anew, with known weights.",
    phases=("contact",),
    formula=Formula(
        equation=r"\tau_j = \gamma\,F\,\ell_j",
        symbols=(
            "γ: force that the load cell leaves out, as a share. ℓ_j: lever of the contact force "
            "about joint j."
        ),
        source="TE FC2231 data sheet: 1 % of span; the calibrated slope may be 10.6 to 11.7 N/V.",
        values={"gain": r"\gamma"},
        alike=("contact_angle",),
    ),
    example=Example({}, {"force": 2.0}, {"MCP gain": 0.16, "PIP gain": 0.08}),
)

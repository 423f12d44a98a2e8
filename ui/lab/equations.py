"""What the window says about each equation: short name, axis, help."""

from __future__ import annotations

from dataclasses import dataclass

from fingerlab.diagnosis.answer.results import EQUATION_TITLES


@dataclass(frozen=True)
class EquationText:
    """``family`` is the key of ``Diagnosis.errors`` that the equation counts towards."""

    button: str
    quantity: str
    family: str
    help: str


EQUATION_TEXTS = {
    "mcp_torque": EquationText(
        "MCP",
        "MCP torque",
        "joint_torque",
        "Torque at the MCP joint, N m.\n"
        "Measured: what the motor's torque gives at the joint, s·a·T.\n"
        "Modelled: inertia, Coriolis, gravity and spring at the joint, less the losses: "
        "LHS1 = s·a·T + L1 (thesis 3.16).\n"
        "a moment arm (m), T cable tension (N), s +1 flexion, −1 extension.",
    ),
    "pip_torque": EquationText(
        "PIP",
        "PIP torque",
        "joint_torque",
        "Torque at the PIP joint, N m.\n"
        "Measured: what the motor's torque gives at the joint, s·b·T.\n"
        "Modelled: inertia, Coriolis, gravity and spring at the joint, less the losses: "
        "LHS2 = s·b·T + L2 (thesis 3.17).\n"
        "b moment arm (m), T cable tension (N), s +1 flexion, −1 extension.",
    ),
    "cable_kinematics": EquationText(
        "Cable",
        "Cable wound",
        "cable_kinematics",
        "Cable wound on the pulley, m.\n"
        "Measured: pulley radius times motor angle, x = r·θm.\n"
        "Modelled: what the joints call for while the cable is taut, x0 + s·(a·θ1 + b·θ2).\n"
        "Slack, stretch and backlash show here and hardly anywhere else.",
    ),
    "endpoint_force_pip": EquationText(
        "Force, PIP",
        "Fingertip force",
        "endpoint_force",
        "Force of the fingertip on the load cell, N, compression positive.\n"
        "Measured: load cell.\n"
        "Modelled from the PIP balance: F = (s·b·T + L2 − LHS2) / lever (thesis 3.18).",
    ),
    "endpoint_force_mcp": EquationText(
        "Force, MCP",
        "Fingertip force",
        "endpoint_force",
        "Force of the fingertip on the load cell, N, compression positive.\n"
        "Measured: load cell.\n"
        "Modelled from the MCP balance: F = (s·a·T + L1 − LHS1) / lever. "
        "It must agree with the PIP equation; where it does not, that is evidence.",
    ),
    "motor_torque": EquationText(
        "Motor",
        "Motor torque",
        "motor_torque",
        "Torque at the gearbox output, N m.\n"
        "Measured: torque constant × gear ratio × current.\n"
        "Modelled: J·acceleration + gain·load + offset.",
    ),
}

FLOOR_HELP = (
    "Floor: how well the bench repeats itself when the same motion is run again. "
    "No model can be expected to do better."
)
SCORE_HELP = (
    "Error of the whole model on runs held out of the fit, over all equations, in multiples of the floor. "
    "1.0 is as good as the bench repeats itself."
)


def equation_text(equation: str) -> EquationText:
    """Texts of an equation; of one that this window does not know, its id."""
    known = EQUATION_TEXTS.get(equation)
    if known is not None:
        return known
    title = EQUATION_TITLES.get(equation, equation.replace("_", " ").capitalize())
    return EquationText(title, title, equation, title)

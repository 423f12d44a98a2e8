"""What the Acquire tab shows: quantities, their columns in the ring, units on the screen, and plots."""

from __future__ import annotations

from dataclasses import dataclass

from fingerlab.core.text import (
    AMPERE,
    DEGREE,
    DEGREE_A_SECOND,
    MILLI_NEWTON_METRE,
    NEWTON,
    ScreenUnit,
    fixed,
)

MODELLED_TORQUE = "modelled_torque"
MODELLED_FORCE = "modelled_force"
TORQUE_RESIDUAL = "torque_residual"
FORCE_RESIDUAL = "force_residual"
MODELLED = (MODELLED_TORQUE, MODELLED_FORCE, TORQUE_RESIDUAL, FORCE_RESIDUAL)


@dataclass(frozen=True)
class LiveQuantity:
    """One measured or modelled quantity.

    Attributes:
        column: of the ring, or of the model. title: as an operator says. digits: behind the point.
        help: symbol, unit and where it comes from.
    """

    column: str
    title: str
    unit: ScreenUnit
    digits: int
    help: str

    def text(self, value: float) -> str:
        """A value (SI) with its unit, in a width that does not change from one value to the next."""
        if value != value:
            return self.unit.after("–")
        return self.unit.after(fixed(value * self.unit.factor, self.digits))  # never "−0.00"


BALANCE = "by the PIP balance LHS₂ = s b T + L₂ − lever F, thesis (3.17), (3.18)"
QUANTITIES = {
    quantity.column: quantity
    for quantity in (
        LiveQuantity("motor_command", "Command", DEGREE, 1, "θ_cmd (°): where the pulley is told to be."),
        LiveQuantity(
            "motor_position", "Position", DEGREE, 1, "θ_m (°): the pulley's angle, from the encoder."
        ),
        LiveQuantity("motor_speed", "Speed", DEGREE_A_SECOND, 0, "ω = dθ_m/dt (°/s), over 10 ms."),
        LiveQuantity("motor_torque", "Torque", MILLI_NEWTON_METRE, 1, "τ = k_t N i (mN m) at the pulley."),
        LiveQuantity("motor_current", "Current", AMPERE, 2, "i (A): the amplifier's current monitor."),
        LiveQuantity("mcp_angle", "MCP", DEGREE, 1, "θ₁ (°): knuckle angle, flexion positive."),
        LiveQuantity("pip_angle", "PIP", DEGREE, 1, "θ₂ (°): middle joint's angle, flexion positive."),
        LiveQuantity("endpoint_force", "Force", NEWTON, 2, "F (N): the load cell under the fingertip."),
        LiveQuantity(MODELLED_TORQUE, "Modelled torque", MILLI_NEWTON_METRE, 1, f"r T (mN m), {BALANCE}."),
        LiveQuantity(MODELLED_FORCE, "Modelled force", NEWTON, 2, f"F (N), {BALANCE}."),
        LiveQuantity(TORQUE_RESIDUAL, "Torque residual", MILLI_NEWTON_METRE, 1, "τ less r T (mN m)."),
        LiveQuantity(FORCE_RESIDUAL, "Force residual", NEWTON, 2, "F measured less F modelled (N)."),
    )
}

SHOWN = tuple(name for name in QUANTITIES if name not in MODELLED)
"""Columns that are taken from the ring."""


@dataclass(frozen=True)
class LiveTrace:
    """A curve: its quantity, the role that gives its colour, and whether its line is wide.

    Colour never tells alone: of two curves in a plot one is wide.
    """

    column: str
    role: str
    wide: bool = False


@dataclass(frozen=True)
class LivePlotSpec:
    """One plot.

    Attributes:
        key, title, unit: of the left axis. share: of the height. least: smallest automatic range (screen
            unit), so that noise does not fill the plot. model: shown only beside a model.
        readings: quantities shown large above it.
    """

    key: str
    title: str
    unit: ScreenUnit
    share: int
    least: float
    traces: tuple[LiveTrace, ...]
    readings: tuple[str, ...] = ()
    model: bool = False


PLOTS = (
    LivePlotSpec(
        "displacement",
        "Motor",
        DEGREE,
        10,
        4.0,
        (LiveTrace("motor_command", "floor"), LiveTrace("motor_position", "measured", wide=True)),
        ("motor_command", "motor_position", "motor_speed"),
    ),
    LivePlotSpec(
        "torque",
        "Torque",
        MILLI_NEWTON_METRE,
        10,
        10.0,
        (LiveTrace("motor_torque", "measured"), LiveTrace(MODELLED_TORQUE, "modelled", wide=True)),
        ("motor_torque", "motor_current"),
    ),
    LivePlotSpec(
        "torque_residual",
        "Residual",
        MILLI_NEWTON_METRE,
        5,
        5.0,
        (LiveTrace(TORQUE_RESIDUAL, "residual"),),
        model=True,
    ),
    LivePlotSpec(
        "angles",
        "Joints",
        DEGREE,
        6,
        4.0,
        (LiveTrace("mcp_angle", "measured"), LiveTrace("pip_angle", "candidate", wide=True)),
        ("mcp_angle", "pip_angle"),
    ),
    LivePlotSpec(
        "force",
        "Force",
        NEWTON,
        6,
        0.2,
        (LiveTrace("endpoint_force", "measured"), LiveTrace(MODELLED_FORCE, "modelled", wide=True)),
        ("endpoint_force",),
    ),
    LivePlotSpec(
        "force_residual", "Residual", NEWTON, 5, 0.1, (LiveTrace(FORCE_RESIDUAL, "residual"),), model=True
    ),
)

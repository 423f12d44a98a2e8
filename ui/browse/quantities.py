"""Which channels stand in which plot of the review, and how they are named and coloured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fingerlab.core.text import DEGREES, ScreenUnit, fixed

DEGREE = ScreenUnit("°", DEGREES)
MILLI_NEWTON_METRE = ScreenUnit("mN m", 1e3)
NEWTON = ScreenUnit("N", 1.0)


@dataclass(frozen=True)
class Shown:
    """A channel on the screen: its name, its unit, and the decimals of a value at a cursor."""

    title: str
    unit: ScreenUnit
    decimals: int
    symbol: str = ""

    def help(self) -> str:
        """Name, symbol and unit; of what is calculated the equation as well."""
        return f"{self.title}: {self.symbol} ({self.unit.symbol})"

    def text(self, value: float) -> str:
        """A value in SI with the unit of the screen."""
        return self.unit.after(fixed(value * self.unit.factor, self.decimals))


QUANTITIES: Mapping[str, Shown] = {
    "motor_command": Shown("motor command", DEGREE, 2, "θ_cmd"),
    "motor_position": Shown("motor position", DEGREE, 2, "θ_m"),
    "motor_torque": Shown("motor torque", MILLI_NEWTON_METRE, 2, "τ = k_t N i"),
    "load_torque": Shown("load torque", MILLI_NEWTON_METRE, 2, "τ_L"),
    "mcp_angle": Shown("MCP angle", DEGREE, 2, "θ₁"),
    "pip_angle": Shown("PIP angle", DEGREE, 2, "θ₂"),
    "endpoint_force": Shown("endpoint force", NEWTON, 3, "F"),
}
"""The motor current is left out: it is the torque but for a constant."""


@dataclass(frozen=True)
class PaneSpec:
    """One plot: channel -> role of its colour; ``share`` of the height; smallest range ``least`` (screen)."""

    title: str
    unit: ScreenUnit
    share: int
    least: float
    channels: Mapping[str, str]
    wide: frozenset[str] = field(default_factory=frozenset)


PANES = (
    PaneSpec(
        "Motor",
        DEGREE,
        10,
        0.1,
        {"motor_command": "floor", "motor_position": "measured"},
        frozenset({"motor_position"}),
    ),
    PaneSpec(
        "Torque",
        MILLI_NEWTON_METRE,
        10,
        0.1,
        {"motor_torque": "measured", "load_torque": "candidate"},
        frozenset({"load_torque"}),
    ),
    PaneSpec(
        "Joints",
        DEGREE,
        8,
        0.1,
        {"mcp_angle": "measured", "pip_angle": "candidate"},
        frozenset({"pip_angle"}),
    ),
    PaneSpec("Force", NEWTON, 7, 0.01, {"endpoint_force": "measured"}),
)

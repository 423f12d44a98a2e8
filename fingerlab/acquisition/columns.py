"""What one row of the ring holds: one cycle of the control loop, every value a double, SI units."""

from __future__ import annotations

from enum import IntFlag

from fingerlab.devices.protocol import LINES, RAW_CHANNELS

COLUMNS = (
    "index",
    "motor_command",
    "motor_position",
    "motor_speed",
    "current_command",
    "motor_current",
    "motor_torque",
    "mcp_angle",
    "pip_angle",
    "endpoint_force",
    "lateness",
    "cycle_time",
    "mode",
    "flags",
    "run",
    *(f"raw/{name}" for name in (*RAW_CHANNELS, *LINES)),
)
"""Columns in their order."""

UNITS = {
    "index": "",
    "motor_command": "rad",
    "motor_position": "rad",
    "motor_speed": "rad/s",
    "current_command": "A",
    "motor_current": "A",
    "motor_torque": "N m",
    "mcp_angle": "rad",
    "pip_angle": "rad",
    "endpoint_force": "N",
    "lateness": "s",
    "cycle_time": "s",
    "mode": "",
    "flags": "",
    "run": "",
    **{f"raw/{name}": "count" if name.endswith("counts") else "V" for name in RAW_CHANNELS},
    **{f"raw/{name}": "" for name in LINES},
}
"""Unit of each column; the empty unit is a plain number."""

COLUMN = {name: number for number, name in enumerate(COLUMNS)}
"""Column name -> number."""


class RowFlag(IntFlag):
    """Bits of the column ``flags``."""

    ENABLED = 1
    LATCHED = 2
    LATE = 4
    LOST_BEFORE = 8

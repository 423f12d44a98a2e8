"""Where a fit starts: moment arms from a straight regression, as no rig file gives them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.features import Layout
from fingerlab.diagnosis.groups import Group
from fingerlab.diagnosis.model import CABLE_NAMES
from fingerlab.diagnosis.shifts import NO_SHIFT
from fingerlab.diagnosis.sums import Sums
from fingerlab.effects.base import Row


def starting_arms(layout: Layout, groups: Sequence[Group]) -> dict[str, float]:
    """Moment arms (m) of each routing from a straight regression of tension on joint torque."""
    arms: dict[str, float] = {}
    for group in sorted(groups, key=lambda g: g.in_contact):
        routing = CABLE_NAMES[group.cable_sign]
        if group.on_bench or f"arm_mcp@{routing}" in arms:
            continue
        for row, name in ((Row.MCP, "arm_mcp"), (Row.PIP, "arm_pip")):
            slope = _tension_over_torque(layout, group.whole, row, group.cable_sign)
            arms[f"{name}@{routing}"] = float(np.clip(1.0 / slope if slope > 1e-9 else 0.01, 0.003, 0.035))
    return arms


def _tension_over_torque(layout: Layout, sums: Sums, row: Row, cable_sign: int) -> float:
    """How the cable's tension goes with a joint's torque, 1/m."""

    def pick(wanted: set[str], shift: int | None = None) -> list[int]:
        return [
            i
            for i in layout.base
            if (f := layout.features[i]).row == row and f.parameter in wanted and f.shift == shift
        ]

    torque = pick({"proximal_mass", "distal_mass", "mcp_stiffness", "pip_stiffness", "force_gain"})
    loss = pick({"loss_mcp", "loss_pip"})
    pull = pick({"torque_gain"}, shift=NO_SHIFT)
    inertia = pick({"rotor_inertia"}, shift=NO_SHIFT)
    # One line for each feature that takes part: what it adds to torque, loss and tension.
    parts = [
        *((i, (cable_sign, 0.0, 0.0)) for i in torque),
        *((i, (0.0, 1.0, 0.0)) for i in loss),
        *((i, (0.0, 0.0, 1.0)) for i in pull),
        *((i, (0.0, 0.0, -layout.features[i].constant)) for i in inertia),
    ]
    share = np.array([line for _, line in parts], dtype=float)
    products = share.T @ sums.of(layout.every[np.array([i for i, _ in parts])]) @ share
    return float(np.linalg.lstsq(products[:2, :2], products[:2, 2], rcond=None)[0][0])

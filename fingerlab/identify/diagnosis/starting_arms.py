"""Where a fit starts: moment arms from a straight regression, as no rig file gives them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.identify.diagnosis.features import Layout
from fingerlab.identify.diagnosis.groups import Group
from fingerlab.identify.diagnosis.model import CABLE_NAMES
from fingerlab.identify.diagnosis.shifts import NO_SHIFT
from fingerlab.physics.effects.base import Row
from fingerlab.sessions.model import Array


def starting_arms(layout: Layout, groups: Sequence[Group]) -> dict[str, float]:
    """Moment arms (m) of each routing from a straight regression of tension on joint torque."""
    arms: dict[str, float] = {}
    for group in sorted(groups, key=lambda g: g.in_contact):
        routing = CABLE_NAMES[group.cable_sign]
        if group.on_bench or f"arm_mcp@{routing}" in arms:
            continue
        gram = group.whole.of(layout.every)
        for row, name in ((Row.MCP, "arm_mcp"), (Row.PIP, "arm_pip")):
            slope = _tension_over_torque(layout, gram, row, group.cable_sign)
            arms[f"{name}@{routing}"] = float(np.clip(1.0 / slope if slope > 1e-9 else 0.01, 0.003, 0.035))
    return arms


def _tension_over_torque(layout: Layout, gram: Array, row: Row, cable_sign: int) -> float:
    """How the cable's tension goes with a joint's torque, 1/m; ``gram`` of all features, (k, k)."""

    def pick(wanted: set[str], shift: int | None = None) -> list[int]:
        return [
            i
            for i, f in enumerate(layout.features)
            if f.owner is None and f.row == row and f.parameter in wanted and f.shift == shift
        ]

    torque = pick({"proximal_mass", "distal_mass", "mcp_stiffness", "pip_stiffness", "force_gain"})
    loss = pick({"loss_mcp", "loss_pip"})
    pull = pick({"torque_gain"}, shift=NO_SHIFT)
    inertia = pick({"rotor_inertia"}, shift=NO_SHIFT)
    size = len(layout.features)
    left = np.zeros((size, 2))
    left[torque, 0] = cable_sign
    left[loss, 1] = 1.0
    right = np.zeros(size)
    right[pull] = 1.0
    right[inertia] = -layout.features[inertia[0]].constant
    return float(np.linalg.lstsq(left.T @ gram @ left, left.T @ gram @ right, rcond=None)[0][0])

"""What is known before a fit: moment arms to start with, and how strange a model's constants are.

No rig file gives the moment arms; a straight regression does. What the constants in the joints' equations
cost: every joint has a constant loss of its own for each routing, so a constant torque of the motor could be
four losses just as well, and no misfit tells. But it would be a strange chance if four losses had the sizes
and the signs that one torque through four moment arms gives them. How strange follows from the losses' own
scatter. The motor alone has no joint to hide behind: there a constant torque is the friction's or the
current's zero, and how far that may be off is known.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from fingerlab.diagnosis.equations.coefficients import NO_SHIFT
from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.equations.parameters import ARMS, LOSSES, TORQUE_ZERO
from fingerlab.diagnosis.gram.sums import Group, Sums
from fingerlab.diagnosis.settings import FIRST_ARM_M, FIRST_ARMS_M, SIMPLER_FIRST, USUAL_LOSS_NM
from fingerlab.effects.base import Row
from fingerlab.sessions.model import CABLE_NAMES, Array


def starting_arms(layout: Layout, groups: Sequence[Group]) -> dict[str, float]:
    """Moment arms (m) of each routing from a straight regression of tension on joint torque."""
    arms: dict[str, float] = {}
    for group in sorted(groups, key=lambda g: g.in_contact):
        routing = CABLE_NAMES[group.cable_sign]
        if group.on_bench or f"arm_mcp@{routing}" in arms:
            continue
        for row, name in zip((Row.MCP, Row.PIP), ARMS, strict=True):
            slope = _tension_over_torque(layout, group.whole, row, group.cable_sign)
            arm = 1.0 / slope if slope > 1e-9 else FIRST_ARM_M
            arms[f"{name}@{routing}"] = float(np.clip(arm, *FIRST_ARMS_M))
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
    loss = pick({*LOSSES})
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


def prior_penalty(
    model: Model, values: Array, radius: float, routings: Collection[str], zero_spread: float | None = None
) -> float:
    """Minus twice the log density of a model's losses, their unknown scatter integrated out.

    A gain in ``offsets`` of an effect pays for its freedom: the share of its range that the losses leave it.

    Args:
        values: of the model's unknowns, (p,). radius: of the pulley, m. routings: those with free motion; in
            contact, what a loss seems to be may be the tip's friction as well.
        zero_spread: of the current's zero, N m, where a run of the motor alone is to be counted on.
    """
    known = list(zip(model.unknowns, map(float, values), strict=True))

    def free(names: Collection[str]) -> Array:
        return np.array([v for u, v in known if u.name in names and not u.effect and u.cable in routings])

    zeros = [(value, u.parameter.typical) for u, value in known if u.key == TORQUE_ZERO]
    spreads = [spread for _, spread in zeros]
    spreads += [] if zero_spread is None or zeros else [zero_spread]
    losses = free(LOSSES)
    if len(losses) == 0:  # a bench, whose own offset could be the difference with no chance involved
        return sum(SIMPLER_FIRST * len(c.effect.offsets) for c in model.choices)
    variance = np.mean(losses**2) + USUAL_LOSS_NM**2
    result = len(losses) * np.log(variance / USUAL_LOSS_NM**2)
    result += sum((zero / spread) ** 2 for zero, spread in zeros)
    levers = free(ARMS) / radius
    information = levers @ levers / variance + sum(1.0 / spread**2 for spread in spreads)
    for choice in model.choices:
        for name in choice.effect.offsets:
            # Friction opposes the motion in either direction, so that the difference stays within the mean.
            mean = values[model.index[f"{choice.effect.id}.{choice.effect.excess[name]}"]]
            width = max(2.0 * float(mean), 1e-12)
            result += max(2.0 * np.log(width * np.sqrt(information / (2 * np.pi))), SIMPLER_FIRST)
    return float(result)

"""What the constants in the joints' equations tell.

Every joint has a constant loss of its own for each routing, so a constant torque of the motor could be four
losses just as well: no misfit tells. But it would be a strange chance if four losses had the sizes and the
signs that one torque through four moment arms gives them. How strange follows from the losses' own scatter.
The motor alone has no joint to hide behind: there a constant torque is the friction's or the current's zero,
and how far that may be off is known.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from fingerlab.diagnosis.features import TORQUE_ZERO
from fingerlab.diagnosis.model import Model
from fingerlab.sessions.model import Array

USUAL_LOSS_NM = 2e-4
"""Scatter of losses that count as none, N m; assumed: 0.2 degrees of a joint's zero on 60 mN m/rad."""
SIMPLER_FIRST = 2.0
"""What a gain costs of which the data tell nothing: the simpler effect comes first, both are in the set."""


def surprise(
    model: Model, values: Array, radius: float, routings: Collection[str], zero_spread: float | None = None
) -> float:
    """Minus twice the log density of a model's losses, their unknown scatter integrated out.

    A gain in ``offsets`` of an effect pays for its freedom: the share of its range that the losses leave it.

    Args:
        values: of the model's unknowns, (p,). radius: of the pulley, m. routings: those with free motion; in
            contact, what a loss seems to be may be the tip's friction as well.
        zero_spread: of the current's zero, N m, where a run of the motor alone is to be counted on.
    """
    known = {u.key: float(v) for u, v in zip(model.unknowns, values, strict=True)}

    def free(name: str) -> Array:
        return np.array(
            [v for key, v in known.items() if key.startswith(name) and key.split("@")[-1] in routings]
        )

    zeros = {u.key: u.gain.typical for u in model.unknowns if u.key == TORQUE_ZERO}
    spreads = [*zeros.values(), *([] if zero_spread is None or zeros else [zero_spread])]
    losses = free("loss_")
    if len(losses) == 0:  # a bench, whose own offset could be the difference with no chance involved
        return sum(SIMPLER_FIRST * len(c.effect.offsets) for c in model.choices)
    variance = np.mean(losses**2) + USUAL_LOSS_NM**2
    result = len(losses) * np.log(variance / USUAL_LOSS_NM**2)
    result += sum((known[key] / spread) ** 2 for key, spread in zeros.items())
    levers = free("arm_") / radius
    told = levers @ levers / variance + sum(1.0 / spread**2 for spread in spreads)
    for choice in model.choices:
        for _ in choice.effect.offsets:
            # Friction opposes the motion in either direction, so that the difference stays within the mean.
            width = max(2.0 * known[f"{choice.effect.id}.coulomb"], 1e-12)
            result += max(2.0 * np.log(width * np.sqrt(told / (2 * np.pi))), SIMPLER_FIRST)
    return float(result)

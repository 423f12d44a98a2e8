"""Whether channels have the sense that the session format gives them; a turned one fits no law.

A joint follows its cable, a cable pulls, and no finger joint turns by more than half a turn. What a recording
says otherwise in every free run is a matter of its file, not of physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array, Run

NO_TORQUE = 1e-9
"""A torque that changes by less is a constant, N m: rounding."""
MOVED_DEG = 3.0
"""A joint that moves by less says little of its sense, degrees; assumed."""
AGAINST = -0.7
"""Correlation with what its cable does below which a joint turns against it; assumed."""
PUSHES_N = -0.5
"""A mean tension below it is no zero of the current, N; assumed."""
ALWAYS = 0.9
"""Share of a run in which a cable would have to push to be called turned; assumed."""


@dataclass(frozen=True)
class Senses:
    """What a free stretch says: ``follows`` its cable, -1 to 1, for MCP and PIP (NaN: hardly moves).

    ``tension`` is its mean, N, and ``pushes`` the share of the time at which it is negative.
    """

    run: str
    cable: str
    follows: tuple[float, float]
    tension: float
    pushes: float


def senses(run: Run, motion: Motion) -> Senses | None:
    """Of a stretch of a run; None where the finger is not free.

    Raises:
        UserError: a joint turns further than any does, or the torque is one number.
    """
    if motion.joints is None:
        return None
    for name, angle in (("mcp_angle", motion.joints.mcp), ("pip_angle", motion.joints.pip)):
        most = float(np.max(np.abs(angle)))
        if most > np.pi:
            raise UserError(
                f"Run {run.name}, channel '{name}' goes to {most:.3g} rad, more than half a turn; write "
                "it in rad, not in degrees."
            )
    if float(np.ptp(motion.torque)) < NO_TORQUE:
        raise UserError(
            f"Run {run.name}, channel 'motor_torque' never changes; a current that is not connected reads so."
        )
    if motion.force is not None or motion.cable_sign == 0:
        return None
    follows = tuple(_follows(motion, angle) for angle in (motion.joints.mcp, motion.joints.pip))
    pull = motion.tension[motion.lead :]
    return Senses(run.name, run.cable, (follows[0], follows[1]), float(pull.mean()), float(np.mean(pull < 0)))


def _follows(motion: Motion, angle: Array) -> float:
    mine, wound = angle[motion.lead :], motion.position[motion.lead :]
    if np.ptp(mine) < np.radians(MOVED_DEG) or not np.ptp(wound) > 0:
        return float("nan")
    return motion.cable_sign * float(np.corrcoef(mine, wound)[0, 1])


def check_senses(seen: Sequence[Senses]) -> None:
    """Refuse recordings in which every free run says that a channel's sense is turned.

    Raises:
        UserError: with the channel, and what would be right.
    """
    if not seen:
        return
    first = seen[0]
    turned = [_turned([one.follows[k] for one in seen]) for k in (0, 1)]
    cable = f"the {first.cable} cable" if len({one.cable for one in seen}) == 1 else "the cable"
    if all(turned):
        raise UserError(
            f"Both joints turn against {cable} in every free run (run {first.run}, for one); name the other "
            "cable, or turn the sign of motor_position or of both angles."
        )
    if any(turned):
        joint = "MCP" if turned[0] else "PIP"
        raise UserError(
            f"The {joint} angle turns against {cable} in every free run (run {first.run}, for one) while the "
            "other joint follows it; turn its sign, flexion is positive."
        )
    if all(one.tension < PUSHES_N and one.pushes > ALWAYS for one in seen):
        raise UserError(
            f"The motor's torque would push the cable in every free run (run {first.run}: "
            f"{first.tension:.3g} N on average), which no cable can; turn the sign of motor_torque."
        )


def _turned(follows: Sequence[float]) -> bool:
    """Whether a joint turns against its cable wherever it moves."""
    known = [one for one in follows if np.isfinite(one)]
    return bool(known) and max(known) < AGAINST

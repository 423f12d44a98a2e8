"""The checks that keep to the limits of the bench, independent of any window.

A check sees one cycle at a time and answers with None or with one sentence for the operator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fingerlab.acquisition.checks import (
    Check,
    EncoderJump,
    EncoderStuck,
    FollowingError,
    Late,
    Range,
    Ranges,
    Reading,
    Rise,
    Stuck,
)
from fingerlab.rig.daq import Limits


@dataclass
class Safety:
    """The checks of one experiment, in the order in which they are asked."""

    checks: Sequence[Check]

    def reset(self) -> None:
        """Forget the past; called when the amplifier is enabled."""
        for check in self.checks:
            check.reset()

    def fault(self, reading: Reading) -> str | None:
        """The first check's sentence, or None."""
        for check in self.checks:
            sentence = check.fault(reading)
            if sentence is not None:
                return sentence
        return None


def safety_checks(limits: Limits, rate_hz: float, *, cable: bool, finger: bool, force: bool) -> Safety:
    """The checks for an experiment.

    Args:
        rate_hz: control loop's rate, Hz.
        cable: whether a cable is on the pulley. Without one there is no tension: what the motor's torque
            would make of it is then its own acceleration, which is limited by torque, current and speed.
        finger: whether a finger is on the cable, so that its angle sensors are read.
        force: whether the load cell is read.
    """

    def samples(seconds: float) -> int:
        return max(1, round(seconds * rate_hz))

    period = 1.0 / rate_hz
    checks: list[Check] = [
        EncoderJump(limits.encoder_jump),
        Ranges(
            (
                Range("position", limits.position_low, limits.position_high, "motor position", "rad"),
                Range("speed", -limits.speed, limits.speed, "motor speed", "rad/s"),
                Range("current", -limits.current, limits.current, "motor current", "A"),
                Range("torque", -limits.torque, limits.torque, "motor torque", "N m"),
            )
        ),
        *([Rise("tension", limits.tension_rise, period, "cable tension", "N/s")] if cable else []),
        EncoderStuck(
            limits.encoder_stuck_current, limits.encoder_stuck_change, samples(limits.encoder_stuck_time)
        ),
        FollowingError(limits.following_error, samples(limits.following_time)),
        Late(limits.late_time, round(limits.late_cycles), period),
    ]
    stuck = samples(limits.stuck_time)
    if finger:
        checks += [
            Ranges(
                (
                    Range("mcp", limits.mcp_low, limits.mcp_high, "MCP angle", "rad"),
                    Range("pip", limits.pip_low, limits.pip_high, "PIP angle", "rad"),
                )
            ),
            Stuck(1, "position", limits.stuck_travel, stuck, "MCP sensor"),
            Stuck(2, "position", limits.stuck_travel, stuck, "PIP sensor"),
        ]
    if force:
        checks += [
            Range("force", -limits.force, limits.force, "endpoint force", "N"),
            Stuck(0, "torque", limits.stuck_torque, stuck, "load cell"),
        ]
    return Safety(tuple(checks))

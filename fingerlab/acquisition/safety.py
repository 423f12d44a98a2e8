"""Limits of the bench and the checks that keep to them, independent of any window.

A check sees one cycle at a time and answers with None or with one sentence for the operator.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

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
from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import Limits as RigLimits

_RIG = RigLimits()


def _limit(default: float, unit: str, source: str) -> Any:
    return field(default=default, metadata={"unit": unit, "source": source})


@dataclass(frozen=True)
class Limits:
    """What may not be exceeded while the amplifier is enabled. SI units; angles at the gearbox output.

    The first eleven are the rig file's own section ``[limits]``; the others are the control loop's. Unit and
    source of each are in the field's metadata (:func:`limits_table`).
    """

    current: float = _limit(_RIG.current, "A", "rig file")
    torque: float = _limit(_RIG.torque, "N m", "rig file")
    position_low: float = _limit(_RIG.position_low, "rad", "rig file")
    position_high: float = _limit(_RIG.position_high, "rad", "rig file")
    speed: float = _limit(_RIG.speed, "rad/s", "rig file")
    tension_rise: float = _limit(_RIG.tension_rise, "N/s", "rig file")
    mcp_low: float = _limit(_RIG.mcp_low, "rad", "rig file")
    mcp_high: float = _limit(_RIG.mcp_high, "rad", "rig file")
    pip_low: float = _limit(_RIG.pip_low, "rad", "rig file")
    pip_high: float = _limit(_RIG.pip_high, "rad", "rig file")
    force: float = _limit(_RIG.force, "N", "rig file")
    following_error: float = _limit(math.radians(25.0), "rad", "assumed")
    following_time: float = _limit(0.1, "s", "assumed")
    encoder_jump: float = _limit(0.1, "rad", "assumed: a sample at 100 rad/s, half of the no-load speed")
    encoder_stuck_current: float = _limit(1.5, "A", "assumed: ten times the no-load current")
    encoder_stuck_change: float = _limit(
        0.5, "A", "assumed: turning under load, dry friction held a motor still for at most 0.12 A"
    )
    encoder_stuck_time: float = _limit(0.03, "s", "assumed: free, the pulley turns 0.5 degrees in it")
    stuck_time: float = _limit(0.5, "s", "assumed")
    stuck_travel: float = _limit(math.radians(10.0), "rad", "assumed: more than the cable's dead travel")
    stuck_torque: float = _limit(0.15, "N m", "assumed: presses the load cell with newtons")
    late_time: float = _limit(0.02, "s", "assumed: the motor may not run 20 ms without the loop")
    late_cycles: float = _limit(50, "cycles", "assumed: one after the other")
    window_time: float = _limit(0.5, "s", "assumed: a frozen window, not a long frame")
    recorder_time: float = _limit(1.0, "s", "assumed: a stalled disk, not a long flush")

    def __post_init__(self) -> None:
        for low, high in (
            ("position_low", "position_high"),
            ("mcp_low", "mcp_high"),
            ("pip_low", "pip_high"),
        ):
            if not getattr(self, low) < getattr(self, high):
                raise UserError(
                    f"[limits] has {low} = {getattr(self, low):g} and {high} = {getattr(self, high):g}; "
                    "the first should be the smaller."
                )

    @classmethod
    def from_rig(cls, rig: Rig) -> Limits:
        """The rig's own limits, and the defaults of those that a rig file does not know.

        Raises:
            UserError: the rig holds an impossible one.
        """
        own = rig.limits
        known = {spec.name for spec in fields(cls)}
        return cls(**{s.name: getattr(own, s.name) for s in fields(own) if s.name in known})

    @classmethod
    def from_mapping(cls, data: Mapping[str, Any] | None, where: str = "the rig file") -> Limits:
        """Limits from a section ``[limits]``; those that it does not name keep their default.

        Args:
            data: name -> number in SI, or a table with ``value`` and perhaps ``unit`` and ``source``.
                A name with ``_deg`` at its end is an angle in degrees.

        Raises:
            UserError: a limit is unknown or is not a finite number, or one of a size is not positive.
        """
        values: dict[str, float] = {}
        known = {spec.name for spec in fields(cls)}
        for key, entry in (data or {}).items():
            number = entry.get("value") if isinstance(entry, Mapping) else entry
            degrees = key.endswith("_deg")
            name = key.removesuffix("_deg") if degrees else key
            if name not in known:
                raise UserError(
                    f"{where}: [limits] holds the unknown '{key}'; it knows {', '.join(sorted(known))}."
                )
            if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                raise UserError(f"{where}: [limits] {key} is {number!r}; it should be a finite number.")
            if isinstance(entry, Mapping) and entry.get("unit") == "deg":
                degrees = True
            if number <= 0 and not name.endswith(("_low", "_high")):
                raise UserError(f"{where}: [limits] {key} is {number:g}; it should be greater than zero.")
            values[name] = math.radians(number) if degrees else float(number)
        return cls(**values)


@dataclass(frozen=True)
class LimitRow:
    """One limit as it is shown: name, value, unit (SI), where it comes from."""

    name: str
    value: float
    unit: str
    source: str


def limits_table(limits: Limits) -> tuple[LimitRow, ...]:
    """All limits with unit and source, for the window, the check of a rig and the documentation."""
    return tuple(
        LimitRow(s.name, getattr(limits, s.name), s.metadata["unit"], s.metadata["source"])
        for s in fields(limits)
    )


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

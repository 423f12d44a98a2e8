"""The limits that a bench must keep: each with its unit and where it comes from.

A rig carries them as plain JSON under the key ``limits``; what it leaves out has the defaults of the bench.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import Mismatch, structured

T = TypeVar("T")
RIG_FILE = "rig file"
"""Source of a limit that is the bench's and not the loop's."""


def _limit(default: float, unit: str, source: str = RIG_FILE) -> Any:
    return field(default=default, metadata={"unit": unit, "source": source})


@dataclass(frozen=True)
class Limits:
    """What may not be exceeded while the amplifier is enabled, SI; angles at the gearbox output.

    Unit and source of each are in the field's metadata (:func:`limits_table`). The first eleven are the
    bench's, and a rig file that has a section ``[limits]`` states every one of them; the others are the
    control loop's, and stand in a rig file only where a bench needs another value.

    Attributes:
        current: either direction. torque: either direction. position_low, position_high: after initialising.
        tension_rise: of the cable. force: at the load cell. mcp_..., pip_...: joint angles.
        sources: where the values of a rig file come from, by name.
    """

    current: float = _limit(3.0, "A")
    torque: float = _limit(0.4, "N m")
    position_low: float = _limit(math.radians(-20.0), "rad")
    position_high: float = _limit(math.radians(160.0), "rad")
    speed: float = _limit(20.0, "rad/s")
    tension_rise: float = _limit(500.0, "N/s")
    mcp_low: float = _limit(math.radians(-60.0), "rad")
    mcp_high: float = _limit(math.radians(95.0), "rad")
    pip_low: float = _limit(math.radians(-70.0), "rad")
    pip_high: float = _limit(math.radians(95.0), "rad")
    force: float = _limit(10.0, "N")
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
    pull: float = _limit(1.0, "N", "assumed: a fingertip presses a load cell and cannot pull at it")
    tare: float = _limit(
        1.5, "N", "FC2231 data sheet: 0.05 V at no load, 0.6 N, and a plate of less than 100 g (assumed)"
    )
    reference_shift: float = _limit(
        math.radians(60.0), "rad", "assumed: a sensor mounted further off ends within the joint's range"
    )
    follow_travel: float = _limit(
        math.radians(25.0), "rad", "assumed: twice the dead travel of a cable that is hung in by hand"
    )
    joint_jump: float = _limit(
        0.1, "rad", "assumed: a sample at 100 rad/s, twice what the pulley can give it"
    )
    drift_angle: float = _limit(
        math.radians(15.0), "rad", "assumed: rubbing joints come to rest within 9 degrees of where they were"
    )
    drift_force: float = _limit(0.5, "N", "assumed: ten times what the load cell reads otherwise at rest")
    late_time: float = _limit(0.02, "s", "assumed: the motor may not run 20 ms without the loop")
    late_cycles: float = _limit(50.0, "cycles", "assumed: one after the other")
    window_time: float = _limit(0.5, "s", "assumed: a frozen window, not a long frame")
    recorder_time: float = _limit(1.0, "s", "assumed: a stalled disk, not a long flush")
    sources: Mapping[str, str] = field(default_factory=dict)


LIMIT_UNITS = {spec.name: spec.metadata["unit"] for spec in fields(Limits) if spec.metadata}
"""SI unit of each limit."""
BENCH_LIMITS = tuple(spec.name for spec in fields(Limits) if spec.metadata.get("source") == RIG_FILE)
"""Names of the limits that are the bench's own: a rig file states them and ``check-rig`` asks for each."""


@dataclass(frozen=True)
class LimitRow:
    """One limit as it is shown: name, value, unit (SI), where it comes from."""

    name: str
    value: float
    unit: str
    source: str


def limits_table(limits: Limits) -> tuple[LimitRow, ...]:
    """All limits with unit and source, for the documentation."""
    return tuple(
        LimitRow(s.name, getattr(limits, s.name), s.metadata["unit"], s.metadata["source"])
        for s in fields(limits)
        if s.metadata
    )


def read_limits(data: Any, where: str) -> Limits:
    """The limits from plain JSON; what is missing has the bench's default.

    Raises:
        UserError: an entry is unknown, no finite number, or leaves no room.
    """
    limits = section_of(Limits, data, where)
    for name in LIMIT_UNITS:
        if not name.endswith(("_low", "_high")) and getattr(limits, name) <= 0:
            raise UserError(f"{where} {name} is {getattr(limits, name):g}; it should be above zero.")
    for name in ("position", "mcp", "pip"):
        if getattr(limits, f"{name}_low") >= getattr(limits, f"{name}_high"):
            raise UserError(f"{where} {name}_low is not below {name}_high; nothing could move.")
    return limits


def section_of(kind: type[T], data: Any, where: str) -> T:
    try:
        return structured(kind, data, refuse_unknown=True)
    except Mismatch as error:
        raise UserError(f"{where} {error}.") from None

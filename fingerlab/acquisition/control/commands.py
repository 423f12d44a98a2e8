"""What may be asked of the control loop: small frozen objects that travel to its process."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig


@dataclass(frozen=True)
class Initialise:
    """Take the motor's present place as ``position`` (rad); with ``mcp`` or ``pip`` (rad), the joints' too.

    An angle that is None keeps its calibrated zero.
    """

    position: float = 0.0
    mcp: float | None = None
    pip: float | None = None


@dataclass(frozen=True)
class Tare:
    """Take the load cell's present reading as no force."""


@dataclass(frozen=True)
class SetUp:
    """What is on the bench: phase and cable of the session format, known load of a motor bench (N m).

    ``intervention``: JSON text of a known change of the machine (``rig.intervention``); empty without one.
    """

    phase: str = "on_air"
    cable: str = "extension"
    load_torque: float = 0.0
    intervention: str = ""


@dataclass(frozen=True)
class Enable:
    """Raise the amplifier's enable line.

    Without ``line`` all but that: checks, limits and guardian watch, set values go out, and a bench whose
    enable line does what it should stands still. Only the check of a rig asks for it.
    """

    line: bool = True


@dataclass(frozen=True)
class Disable:
    """Current to zero, then drop the enable line; the sensors keep their reference."""


@dataclass(frozen=True)
class Start:
    """Run a trajectory, or go over to it from the one that runs.

    ``endless`` keeps going after the trajectory's duration, until ``Finish``.
    """

    trajectory: Mapping[str, Any]
    endless: bool = False


@dataclass(frozen=True)
class Approach:
    """Wind slowly until the load cell shows ``force`` (N), and stay there; at most to ``limit`` (rad)."""

    force: float
    speed: float
    limit: float


@dataclass(frozen=True)
class TakeUp:
    """Wind slowly with little current until the joints move by ``moved`` (rad, both together); stay there."""

    moved: float = math.radians(1.0)
    speed: float = math.radians(10.0)
    limit: float = math.radians(60.0)
    current: float = 0.3


@dataclass(frozen=True)
class Jog:
    """Turn at ``speed`` (rad/s) until the next jog, at most to the position's limits; 0 holds."""

    speed: float


@dataclass(frozen=True)
class Finish:
    """Bring the motor to rest softly; the amplifier stays enabled."""


@dataclass(frozen=True)
class SetGains:
    """Gains of the position loop from now on, A/rad, A/(rad s), A s/rad; the current makes no jump."""

    proportional: float
    integral: float
    derivative: float


@dataclass(frozen=True)
class Release:
    """Open the latch of a stop."""


@dataclass(frozen=True)
class Reset:
    """Acknowledge a fault."""


@dataclass(frozen=True)
class MoveByHand:
    """What the operator of a simulated rig does with a hand from now on; on a real one they do it themselves.

    ``channel``: ``load_cell`` (N), ``mcp``, ``pip`` or ``encoder`` (rad), moved by ``amount``; or a digital
    input (1 or 0).
    """

    channel: str
    amount: float


@dataclass(frozen=True)
class TryOutput:
    """With the amplifier's power off: leave ``volts`` at a card's output, stop its clock, look, then stop."""

    volts: float


@dataclass(frozen=True)
class HoldDeadMan:
    """Invert the dead-man's line no more until the next ``Enable``, as if the loop hung; it goes on."""


@dataclass(frozen=True)
class Quit:
    """End the loop: zero output, enable low, device given back."""


AtRest = MoveByHand | TryOutput
"""What is only done with the amplifier off, for the check of a rig."""

Winding = Approach | TakeUp | Jog
"""Slow motions that end where something is reached, or where they are told to."""

Drive = Enable | Disable | Start | Winding | Finish | HoldDeadMan
"""What lets current flow, or takes it away."""

Command = Initialise | Tare | SetUp | Drive | SetGains | Release | Reset | AtRest | Quit


NAMES = {"position_deg": "position", "mcp_deg": "mcp", "pip_deg": "pip"}
LARGEST_DEG = 360.0


def initial_of(rig: Rig) -> Initialise:
    """The predefined values of a rig; the pulley at 0 and the joints as calibrated where it names none.

    Raises:
        UserError: the section is no section, or an entry is unknown or no possible angle.
    """
    section = rig.extra.get("initial", {})
    if not isinstance(section, Mapping):
        raise UserError(f"The rig, [initial], is not a section; it should hold {', '.join(NAMES)}.")
    values: dict[str, float] = {}
    for name, value in section.items():
        if name not in NAMES:
            raise UserError(f"The rig, [initial], holds the unknown '{name}'; it knows {', '.join(NAMES)}.")
        good = isinstance(value, int | float) and not isinstance(value, bool)
        if not good or not abs(value) <= LARGEST_DEG:
            raise UserError(
                f"The rig, [initial] {name}, is {value!r}; it should be an angle of at most "
                f"{LARGEST_DEG:g} degrees."
            )
        values[NAMES[name]] = math.radians(value)
    return Initialise(**values)

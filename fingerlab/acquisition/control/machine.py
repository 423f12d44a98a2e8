"""What may be asked of the control loop, and the state machine that decides whether the motor may be driven.

A machine is a mode and a latch. The control loop feeds it events and obeys its two outputs: whether a
current command may leave (``command_allowed``), and whether the amplifier's enable line may be high
(``enable_allowed``).

=============  ==============  ==============================  =======================================
mode           command, line   leaves by                       meaning
=============  ==============  ==============================  =======================================
idle           zero, low       initialise                      sensors have no reference yet
initialised    zero, low       enable (only without latch)     sensors set, amplifier off
enabled        zero, high      run, disable                    amplifier on, no current asked for
running        loop, high      run, finish, disable            a trajectory; ``run`` changes it
stopping       loop, high      rest, disable                   soft stop on the way to rest
fault          zero, low       reset                           a check, the device or a process failed
=============  ==============  ==============================  =======================================

From every mode ``fault`` leads to fault; ``stop``, which sets the latch, and ``reset`` lead to initialised
where the sensors still have their references, else to idle. ``forget`` takes the references: the encoder was
not counted on, or cannot be believed.
The bench's digital inputs are part of it: ``press`` (the emergency stop) leads to fault from every mode,
which is not left before ``let_go``; ``unready`` (the amplifier) leads to fault where the amplifier is
enabled, and holds ``enable`` back where it is not, until ``ready``.
A latched machine refuses ``enable`` until ``release``. After a fault the operator resets and enables by hand:
no event leads from fault to a mode with current in fewer than three steps, or four without references.
An event that a mode does not know changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from fingerlab.acquisition.control.safety import Reading
from fingerlab.core.errors import UserError
from fingerlab.rig.daq import SafetyLines
from fingerlab.rig.file import Rig


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

    ``intervention``: JSON text of a known change of the machine (``Intervention``); empty without one.
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
    """Wind slowly with little current until the cable pulls; stay there.

    It pulls where the joints have moved by ``moved`` (rad, both together), in contact also where
    the load cell shows ``pressed`` (N) more, and with ``or_held`` where ``current`` (A) turns it no further.
    ``limit`` (rad): at most so far. ``speed``: rad/s.
    """

    moved: float = math.radians(1.0)
    speed: float = math.radians(10.0)
    limit: float = math.radians(60.0)
    current: float = 0.3
    pressed: float = 0.15
    or_held: bool = False


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


class Mode(IntEnum):
    """Modes, with the numbers under which they stand in shared memory and in recordings."""

    IDLE = 0
    INITIALISED = 1
    ENABLED = 2
    RUNNING = 3
    STOPPING = 4
    FAULT = 5


class Event(IntEnum):
    """What can happen to the machine."""

    INITIALISE = 0
    ENABLE = 1
    DISABLE = 2
    RUN = 3
    FINISH = 4
    REST = 5
    STOP = 6
    RELEASE = 7
    FAULT = 8
    RESET = 9
    PRESS = 10
    LET_GO = 11
    READY = 12
    UNREADY = 13
    FORGET = 14


_I, _S, _E, _R, _P, _F = (Mode.IDLE, Mode.INITIALISED, Mode.ENABLED, Mode.RUNNING, Mode.STOPPING, Mode.FAULT)

TRANSITIONS: dict[tuple[Mode, Event], Mode] = {
    (_I, Event.INITIALISE): _S,
    (_S, Event.INITIALISE): _S,
    (_S, Event.ENABLE): _E,
    (_E, Event.DISABLE): _S,
    (_E, Event.RUN): _R,
    (_R, Event.RUN): _R,
    (_R, Event.FINISH): _P,
    (_R, Event.DISABLE): _S,
    (_P, Event.REST): _E,
    (_P, Event.DISABLE): _S,
    (_F, Event.RESET): _I,
    (_I, Event.RELEASE): _I,
    (_S, Event.RELEASE): _S,
    (_F, Event.RELEASE): _F,
    **{(mode, Event.STOP): mode if mode in (_I, _F) else _S for mode in Mode},
    (_S, Event.FORGET): _I,
    (_I, Event.FORGET): _I,
    (_F, Event.FORGET): _F,
    **{(mode, event): _F for mode in Mode for event in (Event.FAULT, Event.PRESS)},
    **{(mode, event): mode for mode in Mode for event in (Event.LET_GO, Event.READY)},
    **{(mode, Event.UNREADY): mode if mode in (_I, _S, _F) else _F for mode in Mode},
}
"""The whole table: (mode, event) -> mode. Pairs that are not in it change nothing."""


@dataclass(frozen=True, slots=True)
class Machine:
    """Mode and latch; a stop sets the latch, only ``release`` opens it.

    Attributes:
        referenced: the sensors have their references, whatever the mode.
        pressed: the emergency stop is. unready: the amplifier says that it is not ready.
    """

    mode: Mode = Mode.IDLE
    latched: bool = False
    pressed: bool = False
    unready: bool = False
    referenced: bool = False

    @property
    def command_allowed(self) -> bool:
        """Whether a current command other than zero may leave."""
        return self.mode is _R or self.mode is _P  # asked several times a cycle: a set would hash names

    @property
    def enable_allowed(self) -> bool:
        """Whether the amplifier's enable line may be high."""
        return self.mode is _E or self.mode is _R or self.mode is _P

    def allows(self, event: Event) -> bool:
        """Whether the event is known in this mode and held back neither by the latch nor by an input."""
        if event is Event.ENABLE and (self.latched or self.pressed or self.unready):
            return False
        if event is Event.RESET and self.pressed:
            return False
        return (self.mode, event) in TRANSITIONS

    def after(self, event: Event) -> Machine:
        """The machine after the event; itself where the event is not allowed."""
        if not self.allows(event):
            return self
        latched, pressed, unready, referenced = self.latched, self.pressed, self.unready, self.referenced
        mode = TRANSITIONS[self.mode, event]
        if event is Event.STOP or event is Event.RELEASE:
            latched = event is Event.STOP
        elif event is Event.PRESS or event is Event.LET_GO:
            pressed = event is Event.PRESS
        elif event is Event.UNREADY or event is Event.READY:
            unready = event is Event.UNREADY
        elif event is Event.INITIALISE or event is Event.FORGET:
            referenced = event is Event.INITIALISE
        elif event is Event.RESET and referenced:
            mode = _S
        return Machine(mode, latched, pressed, unready, referenced)

    def refusal(self, event: Event) -> str:
        """Why the event is not allowed, and what to do, as one sentence; empty where it is allowed."""
        if self.allows(event):
            return ""
        if event in (Event.ENABLE, Event.RESET) and self.pressed:
            return "The emergency stop is pressed; release it at its button first, then reset."
        if event is Event.ENABLE and self.latched:
            return "The stop is latched; release it first, then enable."
        if event is Event.ENABLE and self.unready and (self.mode, event) in TRANSITIONS:
            return "The amplifier is not ready; look at its supply and its fault light, then enable."
        return _REFUSALS[event].format(mode=MODE_WORDS[self.mode])

    @property
    def tare_refusal(self) -> str:
        """Why the load cell cannot be reset now, as one sentence; empty where it can."""
        if self.command_allowed:
            return "The motor is running; reset the load cell at rest, with nothing on it."
        return "The bench is in fault; reset that first, then the load cell." if self.mode is _F else ""


MODE_WORDS = {
    Mode.IDLE: "idle",
    Mode.INITIALISED: "initialised",
    Mode.ENABLED: "enabled",
    Mode.RUNNING: "running",
    Mode.STOPPING: "stopping",
    Mode.FAULT: "in fault",
}
"""Modes as they are shown."""

_REFUSALS = {
    Event.INITIALISE: "The bench is {mode}; sensors are initialised with the amplifier off and no fault.",
    Event.ENABLE: "The bench is {mode}; the amplifier is enabled after initialising, and after a reset where "
    "there was a fault.",
    Event.DISABLE: "The bench is {mode}; there is nothing to disable.",
    Event.RUN: "The bench is {mode}; a trajectory runs when the amplifier is enabled and at rest.",
    Event.FINISH: "The bench is {mode}; only a running trajectory can be brought to rest.",
    Event.REST: "The bench is {mode}; only a soft stop ends at rest.",
    Event.RELEASE: "The bench is {mode}; the stop is released with the amplifier off.",
    Event.RESET: "The bench is {mode}; there is no fault to reset.",
    Event.FORGET: "The bench is {mode}; references are kept while the amplifier is enabled.",
    **dict.fromkeys((Event.STOP, Event.FAULT, Event.PRESS, Event.LET_GO, Event.READY, Event.UNREADY), ""),
}


CHARGE_COMMANDS = 4
"""Commands after enable until the charge pump of a dead-man is full: two edges that feed it (assumed)."""

PRESSED = "The emergency stop was pressed; release it at its button, then reset and enable."
NOT_READY = (
    "The amplifier is no longer ready; look at its supply, its fault light and the emergency stop, then "
    "reset."
)
NEVER_READY = (
    "The amplifier was not ready {ms:.3g} ms after it was enabled; look at its supply, its fault light and "
    "the dead-man, then reset."
)


class Interlock:
    """Follows the digital inputs of a bench.

    Args:
        lines: which it has. period: of a sample, s. hold: samples for which the device holds a set value.

    Attributes:
        settling: the amplifier was enabled and need not be ready yet; no motion begins.
    """

    def __init__(self, lines: SafetyLines, period: float, hold: int) -> None:
        self._ready_line = lines.amplifier_ready
        self._charge = CHARGE_COMMANDS * hold if lines.dead_man.terminal else 0
        self._patience = max(round(lines.amplifier_ready.settling_time / period), self._charge)
        self._pressed = self._unready = self.settling = False
        self._enabled_at = 0

    def enabled(self, index: int) -> None:
        """The enable line went up at sample ``index``."""
        self._enabled_at = index
        self.settling = bool(self._charge or self._ready_line.terminal)

    def look(self, reading: Reading, enabled: bool) -> tuple[Event, str] | None:
        """What has changed at the inputs, with why the motor may not go on, or an empty text.

        Args:
            enabled: whether the enable line is up.
        """
        stop, ready = reading.lines
        if (stop == 1.0) is not self._pressed:
            self._pressed = not self._pressed
            return (Event.PRESS, PRESSED) if self._pressed else (Event.LET_GO, "")
        if enabled:
            return self._driving(ready == 0.0, reading.index - self._enabled_at)
        self.settling = False
        # Where only an enabled amplifier tells, "not ready" means nothing here.
        return self._readiness(ready == 0.0 and not self._ready_line.needs_enable, "")

    def _driving(self, unready: bool, since: int) -> tuple[Event, str] | None:
        if not self.settling:
            return self._readiness(unready, NOT_READY)
        if unready and since >= self._patience:
            return self._readiness(True, NEVER_READY.format(ms=1e3 * self._ready_line.settling_time))
        if not unready and since >= self._charge:
            self.settling = False
        return None

    def _readiness(self, unready: bool, sentence: str) -> tuple[Event, str] | None:
        if unready is self._unready:
            return None
        self._unready = unready
        return (Event.UNREADY, sentence) if unready else (Event.READY, "")

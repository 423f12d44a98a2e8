"""Whether sensors can be believed: their volts, that they follow the motor, that they come back with it.

``safety.py`` keeps to the limits of the bench by what the sensors say; here is asked whether they say it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple, Protocol

from fingerlab.acquisition.control.machine import SetUp
from fingerlab.acquisition.control.safety import (
    Check,
    EncoderFault,
    EncoderJump,
    EncoderStuck,
    FollowingError,
    Late,
    Range,
    Ranges,
    Reading,
    Rise,
    Safety,
    Stuck,
)
from fingerlab.acquisition.control.units import BenchUnits, Line
from fingerlab.rig.limits import Limits
from fingerlab.sessions.model import CABLE_SIGN

SENSORS = ("load cell", "MCP sensor", "PIP sensor", "current monitor")
"""In the order of the raw values."""

BLOCK_S = 0.05
"""What is slow is judged by means over so long: noise falls to a seventh of itself."""

STILL = math.radians(0.5)
"""A joint that changed by less did not move: twenty times the noise of such a mean (assumed)."""

STILL_FORCE = 0.15
"""N; the same for the load cell (assumed)."""

BLOCKED = math.radians(2.0)
"""A finger whose joints change by less stands against something (assumed)."""

PULL = 0.1
"""N m by which the motor pulls more at a fingertip that is held: more than springs, joints, sheath and
motor take up by rubbing (assumed); a load cell in its way shows about a newton."""

PRESSED = 0.5
"""N; where the load cell shows so much, it is pressed."""

FARTHER = math.radians(1.0)
"""So much farther wound, and pulled as hard, it is pressed again (assumed)."""

AGAINST = math.radians(5.0)
"""A joint that goes so far the wrong way has a wrong sign, or another cable (assumed)."""

SHARE = 0.1
"""Both joints together turn by at least this share of what the pulley turned: the moment arms are half of
its radius and more (assumed)."""

SENSE_TRAVEL = math.radians(1.0)
"""Within this travel encoder and current have to agree in sense."""

SENSE_CURRENT = 0.15
"""A; below it, nothing is said of the sense (assumed: a cable that is stretched pulls the motor so much)."""

CURRENT_OFFSET, CURRENT_SHARE = 0.2, 0.3
"""A, and share of the command, by which current and command may differ (assumed: offset of the monitor,
"about 0.8 V/A")."""

STILL_CURRENT = 0.08
"""A; a monitor that changed by less shows nothing of a command that changed by more than ``CURRENT_OFFSET``
(assumed: 20 mA of noise, less in a mean)."""

CURRENT_BLOCKS = 2
"""For so many means in a row."""

HOME = math.radians(1.0)
"""The motor is back where it was enabled (assumed: as the mean that sets its reference)."""

HOME_BLOCKS = 8
"""For so many means in a row: the finger has come to rest (assumed: 0.4 s of its oscillation)."""


def window_fault(name: str, line: Line | None, volts: float) -> str:
    """Why a sensor's volts are no measurement, as one sentence; empty where they may be one."""
    if line is None or line.low <= volts <= line.high:
        return ""
    if volts != volts:
        return f"The {name} gives no number; check its cable."
    return (
        f"The {name} gives {volts:.3f} V, outside of the {line.low:.3g} to {line.high:.3g} V that it can "
        "give; check its supply and its cable."
    )


def sensors_of(set_up: SetUp) -> tuple[int, ...]:
    """Which raw values a set-up relies on: of finger and load cell only where they are in use."""
    finger = (1, 2) if set_up.phase in ("on_air", "contact") else ()
    return (*((0,) if set_up.phase == "contact" else ()), *finger, 3)


SECTIONS = ("load_cell", "mcp", "pip", "current_monitor")
"""Of the rig file's [daq], in the same order."""


def lacking(sensors: Sequence[int], units: BenchUnits) -> str:
    """The sentence on a sensor that is relied on and that the rig file does not name; empty for none."""
    for k in sensors:
        if units.inputs[k] is None:
            without = "without one no motor is driven" if k == 3 else "what is on the bench needs one"
            return (
                f"The rig file names no terminal for [daq.{SECTIONS[k]}], and {without}; connect the "
                f"{SENSORS[k]}."
            )
    return ""


class Windows:
    """Volts outside of what a sensor that is well can give are no measurement."""

    def __init__(self, units: BenchUnits, sensors: Sequence[int]) -> None:
        self._lines = [(k, line.low, line.high) for k in sensors if (line := units.inputs[k]) is not None]
        self._inputs = units.inputs

    def reset(self) -> None:
        """Nothing is remembered."""

    def fault(self, reading: Reading) -> str | None:
        raw = reading.raw
        for k, low, high in self._lines:
            if raw[k] < low or raw[k] > high:
                return window_fault(SENSORS[k], self._inputs[k], raw[k])
        return None


class JointJump:
    """A joint may not change between two samples by more than the motor could turn it."""

    def __init__(self, attribute: str, limit: float, words: str) -> None:
        self.limit, self.words = limit, words
        self._get = attrgetter(attribute)
        self.reset()

    def reset(self) -> None:
        self._last = math.nan

    def fault(self, reading: Reading) -> str | None:
        value = self._get(reading)
        step, self._last = abs(value - self._last), value
        if not step > self.limit * (1 + reading.lost):
            return None
        return (
            f"The {self.words} jumped by {math.degrees(step):.3g}° between two samples, more than the finger "
            "can move; check its supply and its cable."
        )


class EncoderSense:
    """The first degree of a motion goes with the current: otherwise the loop would drive the motor away."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._agreed = False
        self._sign, self._from = 0.0, math.nan
        self._work, self._last = 0.0, math.nan

    def fault(self, reading: Reading) -> str | None:
        if self._agreed:
            return None
        current = reading.commanded
        sign = math.copysign(1.0, current) if abs(current) >= SENSE_CURRENT else 0.0
        if sign != self._sign:
            self._sign, self._from = sign, reading.position
        moved = sign * (reading.position - self._from)
        work = current * (reading.position - self._last)
        self._work += work if work == work else 0.0
        self._last = reading.position
        # A soft start may never need that much current on its way there, and brakes with it on its way back.
        if moved >= SENSE_TRAVEL or self._work >= SENSE_CURRENT * SENSE_TRAVEL:
            self._agreed = True
            return None
        if not moved <= -SENSE_TRAVEL:
            return None
        return EncoderFault(
            f"The encoder counts against the current of {current:.2g} A; the sign of [daq.encoder] or of "
            "[daq.command] in the rig file is wrong, or two of the encoder's wires are swapped."
        )


class Mean(NamedTuple):
    """Means over a block, SI; ``taking_up``: share of it."""

    position: float
    mcp: float
    pip: float
    force: float
    torque: float
    current: float
    commanded: float
    taking_up: float


class Slow(Protocol):
    """A check of means, one after the other."""

    def reset(self) -> None: ...

    def judge(self, mean: Mean) -> str | None: ...


class Means:
    """Takes the means of the readings and lets others judge them."""

    def __init__(self, samples: int, checks: Sequence[Slow]) -> None:
        self._samples, self._checks = samples, checks
        self._get = attrgetter(*Mean._fields)
        self.reset()

    def reset(self) -> None:
        self._sums, self._count = [0.0] * len(Mean._fields), 0
        for check in self._checks:
            check.reset()

    def fault(self, reading: Reading) -> str | None:
        self._sums = [a + b for a, b in zip(self._sums, self._get(reading), strict=True)]
        self._count += 1
        if self._count < self._samples:
            return None
        mean = Mean(*(total / self._count for total in self._sums))
        self._sums, self._count = [0.0] * len(Mean._fields), 0
        return next(filter(None, (check.judge(mean) for check in self._checks)), None)


class FingerFollows:
    """Where the motor turns far enough one way, both joints turn with it, the way that the cable pulls.

    Nothing is said while slack is taken up: that has little current, and a way of its own that it ends after.

    Args:
        sense: +1 where winding flexes, -1 where it extends. travel: rad that the motor turns meanwhile.
        blocked: N m; a torque that changed by so much has found something that stands in the finger's way,
            as has a load cell that answers.
        load_cell: there is one in the finger's way.
    """

    def __init__(self, sense: int, travel: float, blocked: float, load_cell: bool) -> None:
        self._sense, self._travel, self._blocked, self._load_cell = sense, travel, blocked, load_cell
        self.reset()

    def reset(self) -> None:
        self._from: Mean | None = None
        self._to: Mean | None = None

    def judge(self, mean: Mean) -> str | None:
        if self._from is None or self._to is None or mean.taking_up:
            self._from = self._to = mean
            return None
        way = self._to.position - self._from.position
        beyond = mean.position - self._to.position
        if way * beyond >= 0.0:
            self._to = mean
        elif abs(beyond) > BLOCKED:  # it has turned around
            self._from, self._to = self._to, mean
        turned = self._to.position - self._from.position
        if abs(turned) < self._travel:
            return None
        before, after = self._from, self._to
        self._from = self._to
        pressed = self._load_cell and abs(after.force - before.force) > STILL_FORCE
        if pressed or abs(after.torque - before.torque) >= self._blocked:
            return None
        return self._judged(before, after, self._sense * math.copysign(1.0, turned))

    def _judged(self, before: Mean, after: Mean, sense: float) -> str | None:
        moved = {"MCP": after.mcp - before.mcp, "PIP": after.pip - before.pip}
        turned = f"the motor turned by {math.degrees(abs(after.position - before.position)):.0f}°"
        for joint, by in moved.items():
            if sense * by < -AGAINST:
                return (
                    f"The {joint} angle changed by {math.degrees(by):.3g}° against the cable's pull while "
                    f"{turned}; the sensor's sign is wrong, or another cable is on than was said."
                )
        if abs(sum(moved.values())) < SHARE * self._travel:
            return (
                f"The finger does not follow the motor: {turned}, both joints together by "
                f"{math.degrees(abs(sum(moved.values()))):.2g}°; look for a slack cable or one that is off, "
                "and for sensors without supply."
            )
        for joint, by in moved.items():
            if abs(by) < STILL:
                return (
                    f"The {joint} sensor shows no more than noise while {turned} and the other joint moved; "
                    "check its supply, its cable and its magnet."
                )
        return None


class EncoderAnswers:
    """A finger that is pulled along takes the encoder with it."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._from: Mean | None = None

    def judge(self, mean: Mean) -> str | None:
        start = self._from
        if start is None or abs(mean.position - start.position) > 2.0 * EncoderStuck.DITHER:
            self._from = mean
            return None
        moved = max(abs(mean.mcp - start.mcp), abs(mean.pip - start.pip))
        if moved < 2.0 * AGAINST or not abs(mean.commanded) >= SENSE_CURRENT:
            return None
        return EncoderFault(
            f"The finger moved by {math.degrees(moved):.2g}° while the encoder stood still; the encoder is "
            "unplugged, or one of its wires is off."
        )


def _stands(mcp: float, pip: float) -> bool:
    """Whether something holds the fingertip, by the changes (rad) of both joints while the motor pulls more.

    One cable turns both joints of a free finger the same way. Where the tip is held, neither turns, or the
    chain gives way between motor and tip: one joint goes on and pushes the other back.
    """
    return max(abs(mcp), abs(pip)) <= BLOCKED or mcp * pip < -(STILL**2)


class LoadCellAnswers:
    """A fingertip that is held although the motor pulls stands against the load cell, which shows it.

    It also shows it where the finger has pressed before.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._from: Mean | None = None
        self._pressed: Mean | None = None

    def judge(self, mean: Mean) -> str | None:
        before = self._pressed
        if before is None:
            self._pressed = mean if mean.force >= PRESSED else None
        elif (
            mean.force < STILL_FORCE
            and mean.torque >= before.torque
            and mean.position >= before.position + FARTHER
        ):
            return (
                f"The load cell shows {mean.force:.2g} N where the finger has pressed it before; check its "
                "supply, its cable and its place."
            )
        start = self._from
        if start is None or not _stands(mean.mcp - start.mcp, mean.pip - start.pip):
            self._from = mean
            return None
        if abs(mean.force - start.force) > STILL_FORCE or abs(mean.torque) < abs(start.torque):
            self._from = mean
            return None
        rise = abs(mean.torque) - abs(start.torque)
        if rise < PULL:
            return None
        return (
            f"The load cell shows no more than noise although the motor pulls by {1e3 * rise:.0f} mN m more "
            "at a fingertip that is held; check the load cell's supply, its cable and its place."
        )


class CurrentAgrees:
    """The amplifier makes the current that it is told, and the monitor shows it."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._count = 0
        self._still = self._low = self._high = math.nan

    def judge(self, mean: Mean) -> str | None:
        commanded = mean.commanded
        if not abs(mean.current - self._still) <= STILL_CURRENT or commanded != commanded:
            self._still, self._low, self._high = mean.current, commanded, commanded
        self._low, self._high = min(self._low, commanded), max(self._high, commanded)
        # NaN: nothing was told
        apart = abs(mean.current - commanded) > CURRENT_OFFSET + CURRENT_SHARE * abs(commanded)
        self._count = self._count + 1 if apart else 0
        if self._count < CURRENT_BLOCKS and not self._high - self._low > CURRENT_OFFSET:
            return None
        return (
            f"The current monitor shows {mean.current:.2g} A where {commanded:.2g} A were asked for; "
            "check its cable, the amplifier's supply and fault light, and signs and gains in [daq]."
        )


class ComesBack:
    """With the motor back where it was enabled, joints and load cell read what they read there."""

    def __init__(self, angle: float, force: float, finger: bool, load_cell: bool) -> None:
        checked = (("mcp", angle, finger), ("pip", angle, finger), ("force", force, load_cell))
        self._checked = [(name, limit) for name, limit, used in checked if used]
        self.reset()

    def reset(self) -> None:
        self._home: Mean | None = None
        self._count = 0

    def judge(self, mean: Mean) -> str | None:
        if self._home is None:
            self._home = mean
            return None
        self._count = self._count + 1 if abs(mean.position - self._home.position) < HOME else 0
        if self._count < HOME_BLOCKS:
            return None
        for name, limit in self._checked:
            by = getattr(mean, name) - getattr(self._home, name)
            if abs(by) > limit:
                return _drifted(name, by)
        return None


def _drifted(name: str, by: float) -> str:
    words, shown = f"{name.upper()} sensor", f"{math.degrees(by):.3g}°"
    if name == "force":
        words, shown = "load cell", f"{by:.3g} N"
    return (
        f"The {words} reads {shown} beside what it read when the amplifier was enabled, with the motor back "
        "at the same place; it drifts, or the cable has slipped: initialise again, and calibrate if it stays."
    )


def safety_checks(
    limits: Limits,
    rate_hz: float,
    units: BenchUnits,
    set_up: SetUp,
    *,
    proves_drive: bool = False,
    most: float = math.inf,
) -> Safety:
    """The checks for an experiment.

    Args:
        rate_hz: control loop's rate, Hz.
        set_up: what is on the bench. Without a cable there is no tension: what the motor's torque would make
            of it is then its own acceleration, which is limited by torque, current and speed.
        proves_drive: signs and gains of the drive are what is being found out, and not taken for granted.
        most: A, what is sent at most to a bench that nobody has checked.
    """

    def samples(seconds: float) -> int:
        return max(1, round(seconds * rate_hz))

    period = 1.0 / rate_hz
    sensors = sensors_of(set_up)
    finger, force = 1 in sensors, 0 in sensors
    sense = CABLE_SIGN.get(set_up.cable, 0)
    stuck = samples(limits.stuck_time)
    checks: list[Check] = [
        Windows(units, sensors),
        EncoderJump(limits.encoder_jump),
        Ranges(
            (
                Range("position", limits.position_low, limits.position_high, "motor position", "rad"),
                Range("speed", -limits.speed, limits.speed, "motor speed", "rad/s"),
                Range("current", -limits.current, limits.current, "motor current", "A"),
                Range("torque", -limits.torque, limits.torque, "motor torque", "N m"),
            )
        ),
        *([Rise("tension", limits.tension_rise, period, "cable tension", "N/s")] if sense else []),
        EncoderStuck(
            limits.encoder_stuck_current,
            limits.encoder_stuck_change,
            samples(limits.encoder_stuck_time),
            load_cell=force,
        ),
        *([] if proves_drive else [EncoderSense()]),
        FollowingError(limits.following_error, samples(limits.following_time), most),
        Late(limits.late_time, round(limits.late_cycles), period),
    ]
    slow: list[Slow] = [] if proves_drive else [CurrentAgrees()]
    if finger:
        checks += [
            JointJump("mcp", limits.joint_jump, "MCP angle"),
            JointJump("pip", limits.joint_jump, "PIP angle"),
            Ranges(
                (
                    Range("mcp", limits.mcp_low, limits.mcp_high, "MCP angle", "rad"),
                    Range("pip", limits.pip_low, limits.pip_high, "PIP angle", "rad"),
                )
            ),
            Stuck(1, "position", limits.stuck_travel, stuck, "MCP sensor"),
            Stuck(2, "position", limits.stuck_travel, stuck, "PIP sensor"),
        ]
    if finger and sense:
        slow.append(EncoderAnswers())
        slow.append(FingerFollows(sense, limits.follow_travel, limits.stuck_torque, force))
    if force:
        checks += [
            Range("force", -limits.pull, limits.force, "endpoint force", "N"),
            Stuck(0, "torque", limits.stuck_torque, stuck, "load cell"),
        ]
        slow.append(LoadCellAnswers())
    if finger and sense:
        slow.append(ComesBack(limits.drift_angle, limits.drift_force, finger, force))
    return Safety((*checks, Means(samples(BLOCK_S), slow)))

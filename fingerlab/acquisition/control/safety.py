"""The checks that keep to the limits of the bench, independent of any window.

Each is a small object with its quantity, limit, unit and sentence. It sees one cycle at a time, holds no
clock but counts samples, and answers with None or with one sentence for the operator.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Protocol


class Reading:
    """One cycle in SI units, as the checks and the recorder see it. Filled anew each cycle by the loop.

    Attributes:
        index: sample clock. lost: cycles lost before this one. lateness: s. cycle_time: s, measured.
        position, speed, reference: rad, rad/s, rad. torque, tension: N m, N. current: A.
        commanded: A that the amplifier was told to make; NaN where it was told nothing.
        taking_up: slack is being taken up: the motor turns without the finger, with little current.
        mcp, pip: rad. force: N. raw, lines: as the device gave them.
    """

    __slots__ = (
        "commanded",
        "current",
        "cycle_time",
        "force",
        "index",
        "lateness",
        "lines",
        "lost",
        "mcp",
        "pip",
        "position",
        "raw",
        "reference",
        "speed",
        "taking_up",
        "tension",
        "torque",
    )

    def __init__(self) -> None:
        self.index = -1
        self.lost = 0
        self.lateness = self.reference = self.commanded = self.cycle_time = math.nan
        self.position = self.speed = self.current = self.torque = self.tension = math.nan
        self.mcp = self.pip = self.force = math.nan
        self.raw: tuple[float, ...] = ()
        self.lines: tuple[float, float] = (math.nan, math.nan)
        self.taking_up = False


class EncoderFault(str):
    """A sentence after which the encoder's count says no longer where the motor is."""


class Check(Protocol):
    """One check. ``fault`` is called once a cycle while the amplifier is enabled, ``reset`` before."""

    def fault(self, reading: Reading) -> str | None: ...

    def reset(self) -> None: ...


class Range:
    """A quantity has to stay within two bounds; NaN is outside."""

    def __init__(self, attribute: str, low: float, high: float, words: str, unit: str) -> None:
        self.attribute, self.low, self.high, self.words, self.unit = attribute, low, high, words, unit

    def reset(self) -> None:
        """Nothing is remembered."""

    def fault(self, reading: Reading) -> str | None:
        value = getattr(reading, self.attribute)
        if self.low <= value <= self.high:
            return None
        if value != value:
            return f"The {self.words} is not a number; check its sensor and cable."
        limit = self.high if value > self.high else self.low
        return (
            f"The {self.words} of {_show(value, self.unit)} is beyond its limit of "
            f"{_show(limit, self.unit)}; find the cause, or change [limits] in the rig file."
        )


class Ranges:
    """Two or more ranges in one look, which takes a third of the time of as many looks."""

    def __init__(self, ranges: Sequence[Range]) -> None:
        self._ranges = ranges
        self._get = attrgetter(*(one.attribute for one in ranges))
        self._bounds = [(one.low, one.high) for one in ranges]

    def reset(self) -> None:
        """Nothing is remembered."""

    def fault(self, reading: Reading) -> str | None:
        for value, (low, high) in zip(self._get(reading), self._bounds):  # noqa: B905 (strict costs time)
            if not low <= value <= high:
                return next(filter(None, (one.fault(reading) for one in self._ranges)))
        return None


class Rise:
    """A quantity may not rise faster than a limit over a short window of samples."""

    WINDOW = 10

    def __init__(self, attribute: str, limit: float, period: float, words: str, unit: str) -> None:
        self.attribute, self.limit, self.words, self.unit = attribute, limit, words, unit
        self._period = period
        self.reset()

    def reset(self) -> None:
        self._past: list[float] = []
        self._when: list[int] = []
        self._next = self._cycle = 0

    def fault(self, reading: Reading) -> str | None:
        value = abs(getattr(reading, self.attribute))
        self._cycle += 1 + reading.lost
        if len(self._past) < self.WINDOW:
            self._past.append(value)
            self._when.append(self._cycle)
            return None
        slot = self._next
        rise = (value - self._past[slot]) / ((self._cycle - self._when[slot]) * self._period)
        self._past[slot], self._when[slot] = value, self._cycle
        self._next = (slot + 1) % self.WINDOW
        if rise <= self.limit:
            return None
        return (
            f"The {self.words} rises by {rise:.4g} {self.unit}, more than {self.limit:.4g} {self.unit}; "
            "look for a caught cable or a finger against a stop."
        )


class EncoderJump:
    """The encoder may not jump between two samples by more than the motor could turn."""

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self._last = math.nan

    def reset(self) -> None:
        self._last = math.nan

    def fault(self, reading: Reading) -> str | None:
        step = abs(reading.position - self._last)
        self._last = reading.position
        if not step > self.limit * (1 + reading.lost):
            return None
        return EncoderFault(
            f"The encoder jumped by {math.degrees(step):.4g}° between two samples, more than the motor can "
            "turn; check its cable, then initialise again."
        )


class EncoderStuck:
    """A motor that is neither blocked nor blind moves its encoder by some counts when its current changes.

    Under a steady current it may stand: against the load cell, or where friction holds it at a turning point.
    An encoder with one of its two wires off counts to and fro by one. Where the fingertip presses, gearbox
    and sheath hold back a share of what the motor pulls, and the current may change by that share before it
    turns: it is believed while the load cell, which an unseen turn would change, stays where it was.

    Args:
        current, change: A. samples: in a row. load_cell: there is one in the finger's way.
    """

    DITHER = math.radians(0.1)
    """rad; two counts of the bench's encoder."""

    HELD_SHARE = 0.8
    """Of the larger current; no dry friction holds more: 1 - exp(-2 0.7) = 0.75 is that of a sheath with a
    friction of 0.2 over 200 degrees of bends (assumed, as the widest ``capstan_friction``)."""

    TOUCH = 0.15
    """N; the fingertip presses where it shows more, ten times the load cell's noise (assumed)."""

    UNSEEN = 0.3
    """N; within ``DITHER`` a held motor lets the load cell change by up to 0.19 N on the simulated rig, one
    that turns by half a newton with ``encoder_stuck_change``."""

    def __init__(self, current: float, change: float, samples: int, load_cell: bool = False) -> None:
        self.current, self.change, self.samples, self._load_cell = current, change, samples, load_cell
        self.reset()

    def reset(self) -> None:
        self._last, self._count, self._from, self._force = math.nan, 0, math.nan, math.nan

    def fault(self, reading: Reading) -> str | None:
        if not abs(reading.position - self._last) <= self.DITHER:
            self._last, self._count, self._from = reading.position, 0, reading.current
            self._force = reading.force
            return None
        self._count += 1 + reading.lost
        still = self._count < self.samples or abs(reading.current) < self.current
        change = abs(reading.current - self._from)
        if still or change < self.change or self._held(reading, change):
            return None
        return EncoderFault(
            f"The encoder stands still under {reading.current:.3g} A; the encoder is unplugged or the motor "
            "is blocked."
        )

    def _held(self, reading: Reading, change: float) -> bool:
        """Whether friction explains it: the fingertip presses as before, and the change is no larger."""
        presses = self._load_cell and min(reading.force, self._force) > self.TOUCH
        most = self.HELD_SHARE * max(abs(reading.current), abs(self._from))
        return presses and abs(reading.force - self._force) < self.UNSEEN and change < most


class Stuck:
    """A raw value that stays the same to the last bit while what moves it moves is no measurement."""

    def __init__(self, raw: int, mover: str, travel: float, samples: int, words: str) -> None:
        self.raw, self.mover, self.travel, self.samples, self.words = raw, mover, travel, samples, words
        self.reset()

    def reset(self) -> None:
        self._value, self._count = math.nan, 0
        self._low, self._high = math.inf, -math.inf

    def fault(self, reading: Reading) -> str | None:
        value, mover = reading.raw[self.raw], getattr(reading, self.mover)
        if value != self._value:
            self._value, self._count = value, 0
            self._low = self._high = mover
            return None
        self._count += 1 + reading.lost
        if mover < self._low:
            self._low = mover
        elif mover > self._high:
            self._high = mover
        if self._count < self.samples or self._high - self._low < self.travel:
            return None
        return f"The {self.words} has not changed at all while the motor moved; check its supply and cable."


class Bounds:
    """What a torque trajectory may make of the bench at most: it ends on the first doubt, before the limits.

    Args:
        force: at the load cell, N. position: of the motor, rad. samples: in a row that are beyond.
    """

    def __init__(self, force: float, position: float, samples: int) -> None:
        self.force, self.position, self.samples = force, position, samples
        self._count = 0

    def reset(self) -> None:
        self._count = 0

    def fault(self, reading: Reading) -> str | None:
        if reading.force <= self.force and reading.position <= self.position:
            self._count = 0
            return None
        self._count += 1 + reading.lost
        if self._count < self.samples:
            return None
        if not reading.force <= self.force:
            return (
                f"The fingertip presses with {reading.force:.3g} N, and this run was to stay below "
                f"{self.force:.3g} N; the model does not fit the bench as it stands."
            )
        return (
            f"The motor stands at {_show(reading.position, 'rad')}, and this run was to stay below "
            f"{_show(self.position, 'rad')}; the finger has slipped off the load cell, or the cable gave way."
        )


class FollowingError:
    """The motor has to follow its reference within a band, but for a moment.

    Args:
        limit: rad. samples: in a row. most: A, the little that a bench gets which nobody has checked.
    """

    NEAR = 0.9
    """Of the most current: with so much asked for, it is what the motion lacks (assumed)."""

    def __init__(self, limit: float, samples: int, most: float = math.inf) -> None:
        self.limit, self.samples, self.most = limit, samples, most
        self._count = 0

    def reset(self) -> None:
        self._count = 0

    def fault(self, reading: Reading) -> str | None:
        error = abs(reading.reference - reading.position)
        if not error > self.limit:
            self._count = 0
            return None
        self._count += 1 + reading.lost
        if self._count < self.samples:
            return None
        away = f"The motor is {math.degrees(error):.3g}° away from its command"
        if abs(reading.commanded) >= self.NEAR * self.most:
            return (
                f"{away}; the current stays below {self.most:.2g} A until a check confirms the bench: choose "
                "a motion that needs less, or check the rig."
            )
        return f"{away}; look for a blocked finger, a broken cable or a lost encoder."


class Late:
    """The loop may neither lose many cycles at once nor stay late."""

    def __init__(self, limit: float, cycles: int, period: float) -> None:
        self.limit, self.cycles, self.period = limit, cycles, period
        self._count = 0

    def reset(self) -> None:
        self._count = 0

    def fault(self, reading: Reading) -> str | None:
        lost = reading.lost * self.period
        late = max(lost, reading.lateness) if reading.lateness == reading.lateness else lost
        if late > self.limit:
            return (
                f"The control loop was away for {1e3 * late:.3g} ms, more than {1e3 * self.limit:.3g} ms; "
                "close other programs and start again."
            )
        self._count = self._count + 1 if late > self.period else 0
        if self._count < self.cycles:
            return None
        return (
            f"The control loop was late {self._count} times in a row; close other programs and start again."
        )


class Watchdog:
    """Another process has to move its counter; judged by the loop's own count of samples."""

    def __init__(self, words: str, samples: int) -> None:
        self.words, self.samples = words, samples
        self._counter, self._since = -1, 0

    def reset(self) -> None:
        self._counter = -1

    def fault(self, counter: int, index: int) -> str | None:
        """One sentence where the counter has stood still for too many samples."""
        if counter != self._counter:
            self._counter, self._since = counter, index
            return None
        if index - self._since <= self.samples:
            return None
        return f"The {self.words} has not answered for {index - self._since} samples; the motor was stopped."


def _show(value: float, unit: str) -> str:
    if unit.startswith("rad"):
        return f"{math.degrees(value):.4g}{' °' if unit[3:] else '°'}{unit[3:]}"
    return f"{value:.4g} {unit}"


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

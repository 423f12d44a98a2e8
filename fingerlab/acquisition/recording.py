"""What a recording is told, what begins it, which channels its runs have, and the run under way."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.ring import COLUMN, UNITS, Array, RingReader, RowFlag
from fingerlab.acquisition.status import SharedStatus, Text
from fingerlab.core.errors import UserError
from fingerlab.core.files import own_data
from fingerlab.devices.protocol import LINES, RAW_CHANNELS
from fingerlab.rig.limits import Limits
from fingerlab.sessions.model import MAY_BE_NAN, REQUIRED_CHANNELS
from fingerlab.sessions.recording_files import PartWriter, is_held, recording_folder

TRIGGER_HELP = (
    "such as 'endpoint_force>0.5', 'motor_position<-10deg' or 'motor_speed>90deg/s', in N, A, N m, rad and "
    "rad/s where it says no deg"
)

_WRITTEN = re.compile(r"\s*([a-z_/]+)\s*([<>])\s*([-+0-9.eE]+)\s*(deg|deg/s)?\s*")


@dataclass(frozen=True)
class Level:
    """``level`` of a column of the ring, in its unit (SI), crossed upwards (``rising``) or downwards."""

    column: str
    level: float
    rising: bool = True

    @property
    def words(self) -> str:
        """As an operator reads it."""
        unit, level = UNITS[self.column], self.level
        if unit.startswith("rad"):
            unit, level = unit.replace("rad", "°"), math.degrees(level)
        way = "above" if self.rising else "below"
        return f"{self.column.replace('_', ' ')} {way} {level:g} {unit}"


def read_level(text: str) -> Level:
    """A level as it is written on the command line.

    Raises:
        UserError: it names no quantity, no number, or the wrong unit.
    """
    matched = _WRITTEN.fullmatch(text)
    known = [name for name, unit in UNITS.items() if unit]
    if matched is None or matched[1] not in known:
        raise UserError(
            f"The trigger is {text!r}; it should be {TRIGGER_HELP}, of one of {', '.join(known)}."
        )
    column, way, number, unit = matched.groups()
    try:
        level = float(number)
    except ValueError:
        raise UserError(f"The trigger {text!r} has no number; it should be {TRIGGER_HELP}.") from None
    if unit:
        if unit != UNITS[column].replace("rad", "deg"):
            raise UserError(f"The trigger {text!r} is in {unit}; {column} is in {UNITS[column]}.")
        level = math.radians(level)
    return Level(column, level, way == ">")


def refuse_beyond(level: Level, limits: Limits) -> None:
    """Refuse a level that no run within the limits crosses.

    Raises:
        UserError: it is beyond.
    """
    bounds = {
        "motor_position": (limits.position_low, limits.position_high),
        "motor_command": (limits.position_low, limits.position_high),
        "motor_speed": (-limits.speed, limits.speed),
        "mcp_angle": (limits.mcp_low, limits.mcp_high),
        "pip_angle": (limits.pip_low, limits.pip_high),
        "current_command": (-limits.current, limits.current),
        "motor_current": (-limits.current, limits.current),
        "motor_torque": (-limits.torque, limits.torque),
        "endpoint_force": (-limits.force, limits.force),
    }
    low, high = bounds.get(level.column, (-math.inf, math.inf))
    if low <= level.level <= high:
        return
    unit, factor = UNITS[level.column], 1.0
    if unit.startswith("rad"):
        unit, factor = unit.replace("rad", "deg"), math.degrees(1.0)
    degrees = "; an angle without 'deg' is in rad" if unit.startswith("deg") else ""
    raise UserError(
        f"The trigger is {level.column} at {level.level * factor:.4g} {unit}; it should be within the "
        f"limits, {low * factor:.4g} to {high * factor:.4g} {unit}{degrees}."
    )


def crossings(values: Array, level: float, rising: bool) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Positions in ``values``, shape (n,), of the first samples beyond the level after one before it."""
    beyond = values >= level if rising else values <= level
    known = np.isfinite(values)
    return np.flatnonzero(beyond[1:] & ~beyond[:-1] & known[:-1]) + 1


class Lookout:
    """Looks through the ring for the first crossing at or after a sample."""

    def __init__(self, reader: RingReader, level: Level, start: int) -> None:
        self._reader, self._level, self._start = reader, level, start
        self._before = math.nan

    def look(self) -> int | None:
        """Index of the sample that crossed, as soon as it is there."""
        while True:
            rows = self._reader.read().rows
            rows = rows[rows[:, COLUMN["index"]] >= self._start]
            if not len(rows):
                return None
            values = np.concatenate(([self._before], rows[:, COLUMN[self._level.column]]))
            self._before = float(values[-1])
            found = crossings(values, self._level.level, self._level.rising)
            if len(found):
                return int(rows[found[0] - 1, COLUMN["index"]])


FINGER = ("mcp_angle", "pip_angle", "endpoint_force")
ALWAYS = ("motor_command", "motor_position", "motor_current", "motor_torque")
BESIDE = ("motor_speed", "current_command", "lateness", "cycle_time")
RAW = tuple(f"raw/{name}" for name in RAW_CHANNELS)

LEAST_FREE_BYTES = 32 << 20
"""With less room than this the recording ends by itself, while the end can still be written (assumed)."""


@dataclass(frozen=True)
class SessionInfo:
    """A session to come: its place, the rig's JSON text, title, time, and further root attributes."""

    path: Path
    rig: str
    title: str
    created: str
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RunInfo:
    """A run to come.

    Attributes:
        phase, cable, sample_rate_hz, trajectory: as in the session format.
        start: index of the first sample; one in the past is taken from the ring (pre-trigger).
        stop: index after the last one; None until ``end``.
        load_torque: N m. attributes: further ones of the run.
    """

    phase: str
    cable: str
    sample_rate_hz: float
    trajectory: Mapping[str, Any]
    start: int
    stop: int | None = None
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)


def rescue_folder() -> Path:
    """Where a recording is saved whose own folder has vanished: among the user's data."""
    return own_data("rescued")


@dataclass(frozen=True)
class Saved:
    """What is left of a session whose window ended while it was recorded.

    Attributes:
        path: to be opened. whole: whether it is a file already, or becomes one when it is opened.
        sentence: where it is. held: whether some program still writes it.
    """

    path: Path
    whole: bool
    sentence: str
    held: bool = False


def what_was_saved(session: Path) -> Saved | None:
    """Look for it at its place, and where it was rescued to; None where nothing had been recorded."""
    folder, name = recording_folder(session), session.name
    if folder.is_dir() and is_held(folder):
        return Saved(session, False, f"{session} is being recorded or written at this moment.", held=True)
    ended = f"FingerLab ended while {name} was being recorded."
    if session.exists():
        return Saved(session, True, f"{ended} It was saved as far as it went: {session}")
    if folder.is_dir():
        kept = f"What it had is kept in {folder} and becomes the file when you open it."
        return Saved(session, False, f"{ended} {kept}")
    rescued = rescue_folder() / name
    if rescued.exists():
        return Saved(rescued, True, f"{ended} Its folder had vanished; it was saved as {rescued}")
    return None


def wired_lines(rig: Mapping[str, Any]) -> tuple[str, ...]:
    """Channels of the digital inputs that a rig (as a session holds it) has: 1 for yes, 0 for no."""
    daq = rig.get("daq", {})
    return tuple(f"raw/{name}" for name in LINES if daq.get(name, {}).get("terminal"))


def channel_units(phase: str, lines: Sequence[str] = ()) -> dict[str, str]:
    """All channels of a run of this phase, with their units; ``time`` is the first.

    Args:
        lines: channels of the digital inputs.
    """
    names = ["time", *ALWAYS]
    if phase in ("on_air", "contact"):
        names += FINGER
    units = {"time": "s", **{name: UNITS[name] for name in names if name != "time"}}
    if phase == "motor_bench":
        units["load_torque"] = "N m"
    return units | {name: UNITS[name] for name in (*BESIDE, *RAW, *lines)}


def seconds_of_room(free_bytes: int, rate_hz: float) -> float:
    """How long a recording with all channels may go on, s: doubles, and once more for the whole file."""
    a_second = 2 * 8 * len(channel_units("contact")) * rate_hz
    return max(free_bytes - LEAST_FREE_BYTES, 0) / a_second


def certain_columns(phase: str) -> list[str]:
    """Columns without which a sample is none."""
    needed = {*ALWAYS, *REQUIRED_CHANNELS[phase]} - MAY_BE_NAN - {"time"}
    return [name for name in COLUMN if name in needed]


def channels_of(info: RunInfo, rows: Array, lines: Sequence[str] = ()) -> dict[str, Any]:
    """Channels of a run from rows of the ring, shape (n, columns)."""
    time_s = (rows[:, COLUMN["index"]] - info.start) / info.sample_rate_hz
    channels: dict[str, Any] = {}
    for name in channel_units(info.phase, lines):
        if name == "load_torque":
            channels[name] = np.full(len(rows), info.load_torque)
        elif name != "time":
            channels[name] = rows[:, COLUMN[name]]
    channels["time"] = time_s  # last: a finite time says that all else is there
    return channels


USABLE_S = 4.0
"""A piece between two gaps counts from this length on: the diagnosis lets friction and creep find their state
for 2 s behind a gap, and takes no stretch that is shorter than 2 s."""

WHOLE_S = 3.0
"""A run without a gap counts from this length on: of a short one the diagnosis leaves out a third, its start,
and takes no stretch that is shorter than 2 s."""


@dataclass
class OpenRun:
    """One run, its file, and how far it is.

    Attributes:
        stop: index after the last sample; None until that is known. next: index of the next one.
        late: cycles that were late. dropped: samples that are missing in between; not_numbers: those of them
            that were left out because a channel was none. waiting: samples since the last flush.
        gaps: how many. piece, longest: samples since the last gap, and of the longest piece.
    """

    info: RunInfo
    writer: PartWriter
    reader: RingReader
    stop: int | None
    next: int
    paused: bool = False
    late: int = 0
    dropped: int = 0
    waiting: int = 0
    not_numbers: int = 0
    gaps: int = 0
    piece: int = 0
    longest: int = 0

    def count(self, index: Array) -> None:
        """Take account of samples that are about to be written, by their indices."""
        missing = np.diff(index, prepend=self.next - 1) - 1
        breaks = np.flatnonzero(missing)
        self.dropped += int(missing.sum())
        self.gaps += len(breaks)
        pieces = np.diff([-self.piece, *breaks, len(index)])
        self.longest, self.piece = max(self.longest, int(pieces.max())), int(pieces[-1])
        self.next = int(index[-1]) + 1

    def inside(self, index: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Which samples belong to the run and are not yet written."""
        inside = index >= self.next
        return inside if self.stop is None else inside & (index < self.stop)

    def end_with_motion(self, rows: Array, board: SharedStatus) -> str:
        """End a run against a known load with its motion: afterwards the load hangs on its support again.

        Args:
            rows: of the ring, those of the run. board: says why the bench stopped.

        Returns:
            Why the run was cut, empty where its motion ended in order or goes on.
        """
        modes = rows[:, COLUMN["mode"]]
        ended = np.flatnonzero(modes != Mode.RUNNING)
        if not len(ended):
            return ""
        first, mode = ended[0], Mode(int(modes[ended[0]]))
        # The row that begins a soft stop still holds the last sample of the motion.
        stop = int(rows[first, COLUMN["index"]]) + (mode is Mode.STOPPING)
        self.stop = stop if self.stop is None else min(self.stop, stop)
        if mode is Mode.FAULT:
            return board.text(Text.FAULT)
        latched = int(rows[first, COLUMN["flags"]]) & RowFlag.LATCHED
        return "The bench was stopped by the operator." if latched else ""

    @property
    def usable(self) -> bool:
        """Whether the run, or a piece between two of its gaps, is long enough."""
        least = USABLE_S if self.gaps else WHOLE_S
        return self.longest >= least * self.info.sample_rate_hz

    def verdict(self, number: int) -> str:
        """What was recorded is worth, as one sentence."""
        rate = self.info.sample_rate_hz
        text = f"Run {number}: {self.writer.length / rate:.1f} s"
        if not self.gaps and self.usable:
            return f"{text}, nothing missing; usable."
        if not self.gaps:
            return f"{text}, nothing missing; not usable: too short, a run takes {WHOLE_S:g} s."
        gaps = "1 gap" if self.gaps == 1 else f"{self.gaps} gaps"
        text += f", {gaps} with {self.dropped} {'sample' if self.dropped == 1 else 'samples'} missing"
        if self.usable:
            return f"{text}; usable, piece by piece between them (the longest {self.longest / rate:.1f} s)."
        return (
            f"{text}; not usable: no piece between them lasts {USABLE_S:g} s, close other programs and take "
            "the run again."
        )

    @property
    def lossy_note(self) -> str:
        """What is missing in between; empty where nothing is."""
        if not self.dropped:
            return ""
        why = f", {self.not_numbers} of them were no numbers" if self.not_numbers else ""
        lost = "1 sample was" if self.dropped == 1 else f"{self.dropped} samples were"
        return f"{lost} lost in gaps{why}."

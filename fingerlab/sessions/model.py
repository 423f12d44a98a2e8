"""What a session is: names, units and rules of its format, version 1, and its objects apart from any file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.rig.file import INTERVENTION, Rig

FORMAT_NAME = "fingerlab-session"
FORMAT_VERSION = "1"
FORMAT_MAJOR = 1

PHASES = ("on_air", "contact", "motor_bench", "free")
CABLE_SIGN = {"extension": -1, "flexion": 1}
"""s of ``docs/theory.md`` by the cable that is hung in; without one it is 0."""
CABLE_NAMES = {0: "none"} | {sign: cable for cable, sign in CABLE_SIGN.items()}
CABLES = (*CABLE_SIGN, "none")

CHANNEL_UNITS = {
    "time": "s",
    "motor_command": "rad",
    "motor_position": "rad",
    "motor_current": "A",
    "motor_torque": "N m",
    "mcp_angle": "rad",
    "pip_angle": "rad",
    "endpoint_force": "N",
    "load_torque": "N m",
}
"""Channels of the contract with their unit, in the contract's order."""

LEFT_OUT = "left_out"
"""Attribute of an imported run: which rows of its table it was made without, and why, in words."""
MAY_BE_NAN = frozenset({"endpoint_force"})
"""Channels of the contract in which NaN means "not read"."""

_MOTOR_ONLY = ("time", "motor_position", "motor_torque")
_FINGER = (
    "time",
    "motor_command",
    "motor_position",
    "motor_current",
    "motor_torque",
    "mcp_angle",
    "pip_angle",
)
REQUIRED_CHANNELS = {"on_air": _FINGER, "contact": _FINGER, "motor_bench": _MOTOR_ONLY, "free": _MOTOR_ONLY}
"""Channels without which a run of a phase says nothing; recordings of other machines have no more."""

FINGER_PHASES = frozenset({"on_air", "contact"})
"""Phases in which the rig must know its finger."""

OWN_ROOT_ATTRIBUTES = ("format", "format_version", "created", "title", "rig", "software")
"""Root attributes that whoever writes a session sets itself; all others travel with the runs."""
REQUIRED_ROOT_ATTRIBUTES = ("created", "title", "rig")
REQUIRED_RUN_ATTRIBUTES = ("phase", "cable", "sample_rate_hz", "trajectory")

LEAST_RATE, MOST_RATE = 1e-3, 1e8
"""Hz: no bench is sampled slower than in a quarter of an hour, or faster than any card."""

RATE_TOLERANCE = 0.5
"""A step of time within this share of 1 / sample_rate_hz is regular; a longer one is a gap.

Half a sample: less cannot be a lost sample, more cannot be jitter of a hardware-timed task. Assumed.
"""


def plain(value: Any) -> Any:
    """An HDF5 attribute as a plain Python value: bytes become text, arrays of one element a scalar.

    MATLAB writes text as bytes and numbers as arrays of one element; h5py gives numpy scalars.
    """
    if isinstance(value, np.ndarray):
        if value.size != 1:
            return [plain(item) for item in value.ravel()]
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if isinstance(value, np.generic):
        return plain(value.item())
    return value


def as_stored(name: str, values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Samples as a session stores them: counts are whole numbers, which single precision would round."""
    return np.rint(values).astype(np.int64) if name.endswith("_counts") else values


Array = np.ndarray[Any, np.dtype[np.float64]]
IntArray = np.ndarray[Any, np.dtype[np.int64]]
BoolArray = np.ndarray[Any, np.dtype[np.bool_]]


class ChannelReader(Protocol):
    """Where the samples of a run come from. Picklable, so that worker processes can have it."""

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Samples ``start:stop`` of several channels as float64, shape (n,) each."""


@dataclass(frozen=True)
class Run:
    """One recording on a bench set-up. Channels are read when asked for, never before.

    Attributes:
        name: group name in the file, such as ``"001"``.
        phase: ``on_air``, ``contact``, ``motor_bench`` or ``free``.
        cable: ``extension``, ``flexion`` or ``none``.
        sample_rate_hz: sampling rate, Hz.
        trajectory: what the motor was told to do (``kind``, ``amplitude_deg``, ``frequency_hz``, ...).
        length: number of samples.
        units: unit of each channel, by channel name; its keys are the channels present. Volts and
            counts as read are named ``raw/...``.
        reader: gives samples ``start:stop`` of channels, several at once.
        attributes: the run's other attributes as stored.
    """

    name: str
    phase: str
    cable: str
    sample_rate_hz: float
    trajectory: Mapping[str, Any]
    length: int
    units: Mapping[str, str]
    reader: ChannelReader = field(repr=False, compare=False)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def has(self, channel: str) -> bool:
        """Whether the channel is in the run."""
        return channel in self.units

    def channel(self, name: str, start: int = 0, stop: int | None = None) -> Array:
        """Samples ``start:stop`` of a channel as float64, shape (n,), in the unit ``units[name]``.

        Raises:
            UserError: the run has no such channel, the file can no longer be read, or the samples
                break the format (time that runs backwards, NaN where none may be).
        """
        return self.load([name], start, stop)[name]

    def load(
        self, channels: Iterable[str] | None = None, start: int = 0, stop: int | None = None
    ) -> dict[str, Array]:
        """Samples ``start:stop`` of several channels (all of them for None), the file opened once.

        Returns:
            Channel name -> float64 array of shape (n,), in the unit ``units[name]``.

        Raises:
            UserError: as :meth:`channel`.
        """
        names = list(self.units if channels is None else channels)
        for name in names:
            if name not in self.units:
                raise UserError(
                    f"Run {self.name} has no channel '{name}'; it holds {', '.join(self.units) or 'none'}."
                )
        return self.reader.load(names, start, self.length if stop is None else min(stop, self.length))

    @property
    def cable_sign(self) -> int:
        """s of ``docs/theory.md``: +1 for a flexion cable, -1 for an extension cable, 0 without one."""
        return CABLE_SIGN.get(self.cable, 0)

    @property
    def complete(self) -> bool:
        """Whether its trajectory came to its end; one that says nothing of it did."""
        return str(self.attributes.get("complete", 1)).lower() not in ("0", "0.0", "false")

    @property
    def changed(self) -> bool:
        """Whether the machine was changed on purpose for this run (``rig.file.Intervention``)."""
        return INTERVENTION in self.attributes

    def counted(self, name: str) -> float:
        """A count that the recording kept of itself, such as ``dropped_samples``; 0 where it kept none."""
        count = self.attributes.get(name)
        return count if isinstance(count, (int, float)) and count > 0 else 0

    @property
    def seconds(self) -> float:
        """Nominal length of the run, s."""
        return self.length / self.sample_rate_hz

    @classmethod
    def from_arrays(
        cls,
        channels: Mapping[str, Any],
        *,
        name: str = "001",
        phase: str = "on_air",
        cable: str = "extension",
        sample_rate_hz: float = 1000.0,
        trajectory: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
        attributes: Mapping[str, Any] | None = None,
    ) -> Run:
        """A run that lives in memory, for simulations and tests.

        Args:
            channels: name -> values of shape (n,), SI; ``time`` is counted from 0 where it is absent.
            units: unit of channels that the session format does not name.

        Raises:
            UserError: the channels are not one-dimensional and of one length.
        """
        arrays = {key: np.asarray(values, dtype=np.float64) for key, values in channels.items()}
        shapes = {values.shape for values in arrays.values()}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            raise UserError(
                f"Run {name} holds channels of shapes {sorted(shapes)}; all should be one-dimensional "
                "and of one length."
            )
        length = next(iter(shapes))[0]
        arrays.setdefault("time", np.arange(length) / sample_rate_hz)
        known = {key: (units or {}).get(key, CHANNEL_UNITS.get(key, "")) for key in arrays}
        return cls(
            name,
            phase,
            cable,
            float(sample_rate_hz),
            dict(trajectory or {}),
            length,
            known,
            ArrayReader(arrays),
            dict(attributes or {}),
        )


@dataclass(frozen=True)
class ArrayReader:
    """Channels that are in memory already."""

    arrays: Mapping[str, Array]

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Copies of the samples."""
        return {name: self.arrays[name][start:stop].copy() for name in names}


@dataclass(frozen=True)
class Session:
    """All runs taken on one bench set-up.

    Attributes:
        path: the file it was read from.
        title, created: as stored; ``created`` is ISO 8601 with offset.
        rig: bench constants.
        runs: in the order taken.
        attributes: the root's other attributes as stored.
    """

    path: Path
    title: str
    created: str
    rig: Rig
    runs: tuple[Run, ...]
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def contact_runs(self) -> tuple[Run, ...]:
        """Runs in contact with a cable, of the machine as it is, in the order taken; may be empty."""
        return tuple(r for r in self.runs if r.phase == "contact" and r.cable_sign != 0 and not r.changed)


def whole_pieces(time: Array, rate: float) -> list[slice]:
    """The pieces of a recording between its gaps, in order; one that is whole is one piece.

    Args:
        time: s, shape (n,). rate: samples a second.
    """
    gaps = np.flatnonzero(np.diff(time) > (1.0 + RATE_TOLERANCE) / rate) + 1
    return [slice(first, last) for first, last in pairwise([0, *gaps.tolist(), len(time)])]

"""What a session is, apart from the file that it lives in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.rig import Rig

Array = np.ndarray[Any, np.dtype[np.float64]]
ChannelReader = Callable[[str, int, int], Array]


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
        units: unit of each channel, by channel name; its keys are the channels present.
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
            UserError: the run has no such channel, or the file can no longer be read.
        """
        return self.reader(name, start, self.length if stop is None else min(stop, self.length))

    @property
    def cable_sign(self) -> int:
        """s of ``physics.md``: +1 for a flexion cable, -1 for an extension cable, 0 without one."""
        return {"flexion": 1, "extension": -1}.get(self.cable, 0)


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

"""Writing a session: whole or not at all, never over another file, its runs whole or piece by piece."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.files import claim, move_into_place
from fingerlab.rig.file import Rig
from fingerlab.sessions.disk_files import TargetFile
from fingerlab.sessions.hdf5 import sample_fault, write_attributes, writing_to
from fingerlab.sessions.model import (
    CABLES,
    CHANNEL_UNITS,
    FORMAT_NAME,
    FORMAT_VERSION,
    PHASES,
    REQUIRED_CHANNELS,
)

CHUNK_SAMPLES = 16384
"""Samples a chunk: 16 s at 1 kHz, so that a screenful reads little and a whole run reads fast."""


@dataclass(frozen=True)
class RunLayout:
    """Where and how a run is stored; ``real`` is the type of its channels (time is always double)."""

    path: Path
    target: TargetFile
    name: str
    phase: str
    sample_rate_hz: float
    real: type[np.floating[Any]]
    compression_level: int
    chunk_samples: int


class RunWriter:
    """Takes a run's samples in pieces, in the order of time. Made by ``SessionWriter.begin_run``."""

    def __init__(
        self, group: h5py.Group, layout: RunLayout, units: Mapping[str, str], derived: Mapping[str, str]
    ) -> None:
        self.name = layout.name
        self.length = 0
        self._group = group
        self._layout = layout
        self._units = units
        self._derived = derived
        self._datasets: dict[str, h5py.Dataset] = {}
        self._last_time: float | None = None

    def append(self, channels: Mapping[str, Any]) -> None:
        """Write the next samples of every channel.

        Args:
            channels: name -> values of shape (n,), the same names each time; ``time`` (s) is counted
                from the sampling rate where it is absent; ``raw/NAME`` goes to the group ``raw``.

        Raises:
            UserError: a channel is missing or new, shapes differ, time does not increase, NaN where none
                may be, or the place is full.
        """
        arrays = {key: np.asarray(values) for key, values in channels.items()}
        count = self._check_shapes(arrays)
        if "time" not in arrays:
            arrays["time"] = np.arange(self.length, self.length + count) / self._layout.sample_rate_hz
        self._check_names(arrays)
        if count == 0:
            return
        self._check_samples(arrays)
        if not self._datasets:
            with writing_to(self._layout.path, self._layout.target):
                self._create(arrays)
        for key, values in arrays.items():
            with writing_to(self._layout.path, self._layout.target):
                dataset = self._datasets[key]
                dataset.resize((self.length + count,))
                dataset[self.length :] = values
        self.length += count
        self._last_time = float(arrays["time"][-1])

    def finish(self, attributes: Mapping[str, Any] | None = None) -> None:
        """Close the run.

        Args:
            attributes: further ones, that are known at its end.

        Raises:
            UserError: no sample was written.
        """
        if self.length == 0:
            raise UserError(
                f"{self._layout.path}: run {self.name} is empty (no samples); a run has at least one."
            )
        if attributes:
            with writing_to(self._layout.path, self._layout.target):
                write_attributes(self._group, attributes)

    def _check_shapes(self, arrays: Mapping[str, np.ndarray[Any, Any]]) -> int:
        shapes = {values.shape for values in arrays.values()}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            described = ", ".join(f"{key} {values.shape}" for key, values in arrays.items()) or "none"
            raise UserError(
                f"Run {self.name} holds channels of different shapes ({described}); all should be "
                "one-dimensional and of one length."
            )
        wrong = [key for key, values in arrays.items() if values.dtype.kind not in "fiu"]
        if wrong:
            raise UserError(f"Run {self.name}, channel '{wrong[0]}' holds something else than numbers.")
        return int(next(iter(shapes))[0])

    def _check_names(self, arrays: Mapping[str, Any]) -> None:
        for channel in REQUIRED_CHANNELS[self._layout.phase]:
            if channel not in arrays:
                raise UserError(
                    f"Run {self.name} lacks the channel '{channel}'; a run of phase "
                    f"'{self._layout.phase}' has it."
                )
        if self._datasets and set(arrays) != set(self._datasets):
            changed = ", ".join(sorted(set(arrays) ^ set(self._datasets)))
            raise UserError(f"Run {self.name} changed its channels while it was written ({changed}).")

    def _check_samples(self, arrays: Mapping[str, np.ndarray[Any, Any]]) -> None:
        start = self.length
        for key, values in arrays.items():
            samples, first = values, start
            if key == "time" and self._last_time is not None:
                samples, first = np.concatenate(([self._last_time], values)), start - 1
            fault = sample_fault(key, samples, first)
            if fault:
                raise UserError(f"{self._layout.path}: run {self.name}, {fault}")

    def _create(self, arrays: Mapping[str, np.ndarray[Any, Any]]) -> None:
        time = self._dataset("time", np.dtype(np.float64))
        time.make_scale("time")
        for key, values in arrays.items():
            if key == "time":
                continue
            kind = np.dtype(self._layout.real) if values.dtype.kind == "f" else values.dtype
            self._dataset(key, kind).dims[0].attach_scale(time)

    def _dataset(self, key: str, kind: np.dtype[Any]) -> h5py.Dataset:
        dataset = self._group.create_dataset(
            key,
            shape=(0,),
            maxshape=(None,),
            dtype=kind,
            chunks=(self._layout.chunk_samples,),
            compression="gzip",
            compression_opts=self._layout.compression_level,
            shuffle=True,
        )
        bare = key.removeprefix("raw/")
        unit = CHANNEL_UNITS.get(key) or self._units.get(key) or self._units.get(bare, "")
        write_attributes(dataset, {"units": unit, "derived": self._derived.get(key)})
        self._datasets[key] = dataset
        return dataset


CACHE_BYTES = 2 * 8 * CHUNK_SAMPLES
"""Room of each channel for chunks that are not yet compressed: two. With HDF5's own megabyte most of the work
waited until the file was closed, a minute without a word for a recording of ten hours."""


class SessionWriter:
    """Writes a session beside its place as ``NAME.part`` and moves it there when all went well.

    Use as a context manager. Where the body raises, nothing is left behind::

        with SessionWriter("finger.h5", rig, "first try") as writer:
            writer.add_run("on_air", "extension", 1000.0, {"kind": "sine"}, channels)

    Raises:
        UserError: the place exists already, cannot be written to or is full, or a run breaks the format.
    """

    def __init__(
        self,
        path: str | Path,
        rig: Rig | str,
        title: str,
        *,
        created: str | None = None,
        attributes: Mapping[str, Any] | None = None,
        float32: bool = False,
        compression_level: int = 4,
    ) -> None:
        """Open the file for writing.

        Args:
            rig: the bench constants, or their JSON text where a file's own text is to be kept.
            created: ISO 8601 with offset; now where absent.
            attributes: further root attributes, such as ``operator``, ``notes`` and ``tags``.
            float32: store channels in single precision (time stays double), as recordings are.
            compression_level: gzip level, 1 to 9.
        """
        self.path = Path(path)
        self._float = np.float32 if float32 else np.float64
        self._level = compression_level
        self._count = 0
        root = {
            "format": FORMAT_NAME,
            "format_version": FORMAT_VERSION,
            "created": created or datetime.now().astimezone().isoformat(timespec="seconds"),
            "title": title,
            "rig": rig if isinstance(rig, str) else rig.to_json(),
            "software": f"FingerLab {fingerlab.__version__}",
        }
        self._part = claim(self.path)
        try:
            with writing_to(self.path):
                self._target = TargetFile(self._part)
                self._file = h5py.File(self._target, "w", rdcc_nbytes=CACHE_BYTES)
                write_attributes(self._file, {**(attributes or {}), **root})
                self._file.create_group("runs")
        except BaseException:
            self._discard()
            raise

    def __enter__(self) -> SessionWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._discard()
            return
        if self._count == 0:
            self._discard()
            raise UserError(f"{self.path} would hold no runs and is not written; add at least one run.")
        try:
            with writing_to(self.path, self._target):
                self._file.close()
                self._target.close()
        except UserError:
            self._discard()
            raise
        move_into_place(self._part, self.path)

    @property
    def failed(self) -> bool:
        """Whether the place did not take what was written; otherwise it was no good."""
        return self._target.failure is not None

    def add_run(
        self,
        phase: str,
        cable: str,
        sample_rate_hz: float,
        trajectory: Mapping[str, Any],
        channels: Mapping[str, Any],
        attributes: Mapping[str, Any] | None = None,
        *,
        units: Mapping[str, str] | None = None,
        raw: Mapping[str, Any] | None = None,
        name: str | None = None,
    ) -> str:
        """Write one run that is in memory as a whole.

        Args:
            phase, cable, sample_rate_hz, trajectory: as in the session format.
            channels: name -> values of shape (n,) in the contract's SI units; ``time`` (s) is counted
                from 0 where it is absent; ``raw/NAME`` goes to the run's group ``raw``.
            attributes: further attributes of the run, such as ``started``, ``complete``; mappings and
                lists are stored as JSON text, None is left out.
            units: unit of channels that the contract does not name.
            raw: the volts and counts as read, by name; their units in ``units`` under the same name.
            name: group name; the next number where absent.

        Returns:
            The run's group name.

        Raises:
            UserError: the run breaks the session format.
        """
        pieces = {**channels, **{f"raw/{key}": values for key, values in (raw or {}).items()}}
        length = max((np.size(values) for values in pieces.values()), default=0)
        run = self.begin_run(
            phase, cable, sample_rate_hz, trajectory, attributes, units=units, name=name, length=length
        )
        run.append(pieces)
        run.finish()
        return run.name

    def begin_run(
        self,
        phase: str,
        cable: str,
        sample_rate_hz: float,
        trajectory: Mapping[str, Any],
        attributes: Mapping[str, Any] | None = None,
        *,
        units: Mapping[str, str] | None = None,
        derived: Mapping[str, str] | None = None,
        name: str | None = None,
        length: int | None = None,
    ) -> RunWriter:
        """Begin a run that comes in pieces; arguments as in :meth:`add_run`.

        Args:
            derived: for channels that were not recorded, by name, how they were calculated.
            length: how many samples will come, where that is known; a short run is stored smaller then.

        Raises:
            UserError: phase, cable or rate break the session format, or the place is full.
        """
        name = name or f"{self._count + 1:03d}"
        _check_header(name, phase, cable, sample_rate_hz)
        header = {
            "phase": phase,
            "cable": cable,
            "sample_rate_hz": float(sample_rate_hz),
            "trajectory": dict(trajectory),
        }
        with writing_to(self.path, self._target):
            group = self._file["runs"].create_group(name)
            write_attributes(group, {**(attributes or {}), **header})
        self._count += 1
        chunk = max(1, min(length or CHUNK_SAMPLES, CHUNK_SAMPLES))
        layout = RunLayout(
            self.path, self._target, name, phase, float(sample_rate_hz), self._float, self._level, chunk
        )
        return RunWriter(group, layout, units or {}, derived or {})

    def _discard(self) -> None:
        # The file is thrown away, so its last words do not matter; either may not be there yet.
        for name in ("_file", "_target"):
            with suppress(Exception):
                getattr(self, name).close()
        with suppress(OSError):
            self._part.unlink(missing_ok=True)


def _check_header(name: str, phase: str, cable: str, rate: float) -> None:
    if phase not in PHASES:
        raise UserError(f"Run {name} has the phase {phase!r}; it should be one of {', '.join(PHASES)}.")
    if cable not in CABLES:
        raise UserError(f"Run {name} has the cable {cable!r}; it should be one of {', '.join(CABLES)}.")
    if not (math.isfinite(rate) and rate > 0):
        raise UserError(f"Run {name} has the sample rate {rate!r}; it should be a positive number in Hz.")

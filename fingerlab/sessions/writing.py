"""Writing a session: whole or not at all, and never over another file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig
from fingerlab.sessions.format import CABLES, FORMAT_NAME, FORMAT_VERSION, PHASES
from fingerlab.sessions.place import claim, move_into_place
from fingerlab.sessions.run_writing import (
    CHUNK_SAMPLES,
    RunLayout,
    RunWriter,
    write_attributes,
    writing_to,
)
from fingerlab.sessions.target_file import TargetFile

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

"""Writing a session: whole or not at all, and never over another file."""

from __future__ import annotations

import json
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
from fingerlab.errors import UserError
from fingerlab.rig import Rig
from fingerlab.sessions.format import (
    CABLES,
    CHANNEL_UNITS,
    FORMAT_NAME,
    FORMAT_VERSION,
    PHASES,
    REQUIRED_CHANNELS,
)
from fingerlab.sessions.place import claim, move_into_place
from fingerlab.sessions.samples import sample_fault

CHUNK_SAMPLES = 16384
"""Samples a chunk: 16 s at 1 kHz, so that a screenful reads little and a whole run reads fast."""

_TEXT = h5py.string_dtype("utf-8")


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
        self._part = claim(self.path)
        try:
            self._file = h5py.File(self._part, "w")
            root = {
                "format": FORMAT_NAME,
                "format_version": FORMAT_VERSION,
                "created": created or datetime.now().astimezone().isoformat(timespec="seconds"),
                "title": title,
                "rig": rig if isinstance(rig, str) else rig.to_json(),
                "software": f"FingerLab {fingerlab.__version__}",
            }
            write_attributes(self._file, {**(attributes or {}), **root})
            self._file.create_group("runs")
        except (OSError, RuntimeError) as error:
            self._discard()
            raise _full(self.path, error) from None

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
            self._file.close()
        except (OSError, RuntimeError) as failure:
            self._discard()
            raise _full(self.path, failure) from None
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
        """Write one run.

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
        name = name or f"{self._count + 1:03d}"
        arrays = {key: np.asarray(values) for key, values in channels.items()}
        arrays |= {f"raw/{key}": np.asarray(values) for key, values in (raw or {}).items()}
        length = _check_run(name, phase, cable, sample_rate_hz, arrays)
        if "time" not in arrays:
            arrays["time"] = np.arange(length) / sample_rate_hz
        for key, values in arrays.items():
            fault = sample_fault(key, values) if key in CHANNEL_UNITS else None
            if fault:
                raise UserError(f"{self.path}: run {name}, {fault}")
        header = {
            "phase": phase,
            "cable": cable,
            "sample_rate_hz": float(sample_rate_hz),
            "trajectory": dict(trajectory),
        }
        try:
            group = self._file["runs"].create_group(name)
            write_attributes(group, {**(attributes or {}), **header})
            self._write_channels(group, arrays, units or {})
        except (OSError, RuntimeError) as error:
            raise _full(self.path, error) from None
        self._count += 1
        return name

    def _write_channels(
        self, group: h5py.Group, arrays: Mapping[str, np.ndarray[Any, Any]], units: Mapping[str, str]
    ) -> None:
        time = self._dataset(group, "time", arrays["time"].astype(np.float64), "s")
        time.make_scale("time")
        for key, values in arrays.items():
            if key == "time":
                continue
            if values.dtype.kind == "f":
                values = values.astype(self._float)
            unit = CHANNEL_UNITS.get(key) or units.get(key) or units.get(key.removeprefix("raw/"), "")
            self._dataset(group, key, values, unit).dims[0].attach_scale(time)

    def _dataset(self, group: h5py.Group, name: str, values: np.ndarray[Any, Any], unit: str) -> h5py.Dataset:
        dataset = group.create_dataset(
            name,
            data=values,
            chunks=(min(len(values), CHUNK_SAMPLES),),
            compression="gzip",
            compression_opts=self._level,
            shuffle=True,
        )
        write_attributes(dataset, {"units": unit})
        return dataset

    def _discard(self) -> None:
        # A full disk makes closing fail as well; the file is thrown away, so its last words do not matter.
        with suppress(Exception):
            self._file.close()
        with suppress(OSError):
            self._part.unlink(missing_ok=True)


def write_attributes(target: h5py.HLObject, attributes: Mapping[str, Any]) -> None:
    """Store attributes as MATLAB, xarray and HDFView read them: UTF-8 text and plain numbers.

    Mappings and lists become JSON text, truth values 0 or 1; None is left out.
    """
    for key, value in attributes.items():
        if value is None:
            continue
        if isinstance(value, (dict, list, tuple, Mapping)):
            value = json.dumps(value if not isinstance(value, Mapping) else dict(value), ensure_ascii=False)
        if isinstance(value, (bool, np.bool_)):
            value = int(value)
        if isinstance(value, str):
            target.attrs.create(key, value, dtype=_TEXT)
        else:
            target.attrs[key] = value


def _check_run(
    name: str, phase: str, cable: str, rate: float, arrays: Mapping[str, np.ndarray[Any, Any]]
) -> int:
    """The run's length, once everything that the format asks of it holds."""
    if phase not in PHASES:
        raise UserError(f"Run {name} has the phase {phase!r}; it should be one of {', '.join(PHASES)}.")
    if cable not in CABLES:
        raise UserError(f"Run {name} has the cable {cable!r}; it should be one of {', '.join(CABLES)}.")
    if not (math.isfinite(rate) and rate > 0):
        raise UserError(f"Run {name} has the sample rate {rate!r}; it should be a positive number in Hz.")
    for channel in REQUIRED_CHANNELS[phase]:
        if channel not in arrays and channel != "time":
            raise UserError(f"Run {name} lacks the channel '{channel}'; a run of phase '{phase}' has it.")
    shapes = {values.shape for values in arrays.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        described = ", ".join(f"{key} {values.shape}" for key, values in arrays.items())
        raise UserError(
            f"Run {name} holds channels of different shapes ({described}); all should be one-dimensional "
            "and of one length."
        )
    length = next(iter(shapes))[0]
    if length == 0:
        raise UserError(f"Run {name} is empty (no samples); a run has at least one.")
    return int(length)


def _full(path: Path, error: Exception) -> UserError:
    text = getattr(error, "strerror", None) or " ".join(str(error).split())
    return UserError(f"{path} cannot be written ({text}); choose a place with room and write access.")

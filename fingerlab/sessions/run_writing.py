"""Writing one run, whole or piece by piece."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.format import CHANNEL_UNITS, REQUIRED_CHANNELS
from fingerlab.sessions.samples import sample_fault
from fingerlab.sessions.target_file import TargetFile

CHUNK_SAMPLES = 16384
"""Samples a chunk: 16 s at 1 kHz, so that a screenful reads little and a whole run reads fast."""

_TEXT = h5py.string_dtype("utf-8")


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

    def finish(self) -> None:
        """Close the run.

        Raises:
            UserError: no sample was written.
        """
        if self.length == 0:
            raise UserError(
                f"{self._layout.path}: run {self.name} is empty (no samples); a run has at least one."
            )

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


def write_attributes(target: h5py.HLObject, attributes: Mapping[str, Any]) -> None:
    """Store attributes as MATLAB, xarray and HDFView read them: UTF-8 text and plain numbers.

    Mappings and lists become JSON text, truth values 0 or 1; None is left out.
    """
    for key, value in attributes.items():
        if value is None:
            continue
        if isinstance(value, Mapping):
            value = json.dumps(dict(value), ensure_ascii=False)
        elif isinstance(value, (list, tuple)):
            value = json.dumps(value, ensure_ascii=False)
        elif isinstance(value, (bool, np.bool_)):
            value = int(value)
        if isinstance(value, str):
            target.attrs.create(key, value, dtype=_TEXT)
        else:
            target.attrs[key] = value


@contextmanager
def writing_to(path: Path, target: TargetFile | None = None) -> Iterator[None]:
    """Turn what HDF5 and the system say of a full or unreachable place into one sentence.

    Args:
        path: the place as the user named it.
        target: the file that HDF5 writes to; its failures are looked for at the end.

    Raises:
        UserError: writing failed.
    """
    try:
        yield
        if target is not None:
            target.raise_failure()
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise UserError(
            f"{path} cannot be written ({reason}); choose a place with room and write access."
        ) from None

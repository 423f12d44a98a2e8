"""A recording while it grows: its folder ``NAME.h5.recording``, who holds it, and the file of each run in it.

Each run is a file of its own there (``001.h5part``), written so that what was flushed survives its writer.
The session gets its name only when it is whole and has been read back. A folder that nobody holds is what is
left of a recording that was cut.

A run's file is HDF5 in single-writer mode: only that promises that what was flushed can be read after the
writer was killed. It allows no new object and no new attribute, hence everything is made beforehand: the
attributes that tell how the run ended say "truncated" from the start, and are overwritten in place. Samples
that were announced but never reached the file read as NaN; ``time`` is flushed last, so that a finite time
stands for a whole sample.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np
from h5py import h5s

from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken, seen_as
from fingerlab.sessions.hdf5 import write_attributes
from fingerlab.sessions.model import CHANNEL_UNITS, FORMAT_NAME, FORMAT_VERSION

SUFFIX = ".recording"
PART_SUFFIX = ".h5part"
WHOLE = "whole.h5part"
ASSEMBLING = "assembling.h5part"
WRITTEN = "written.h5part"
"""The session, put off when it was written to its end and not yet read back."""
LOCK = "lock"
CLOSED = "closed"
"""Is there once the recording was closed, with the words why that was before its time."""
DAMAGED = ".damaged"
WRITING, VERIFYING = "writing", "verifying"
"""What is being done when a recording becomes a session."""


def recording_folder(path: Path) -> Path:
    """Where the recording of ``path`` grows."""
    return path.with_name(path.name + SUFFIX)


ENDINGS = (".h5", ".hdf5")
"""Of the names of session files."""


def session_files(folder: Path, unfinished: bool = False) -> list[tuple[Path, str]]:
    """Session files below a folder with their relative names (forward slashes), by name.

    Hidden folders are left out, links to folders are not followed.

    Args:
        unfinished: whether recordings that were cut and not yet made whole are listed, too, by the session
            that they will become.

    Raises:
        UserError: there is no such folder.
    """
    if seen_as(folder) != "folder":
        raise UserError(f"{folder} is not a folder; choose the folder that holds the sessions.")
    found: list[Path] = []
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".") and not name.endswith(SUFFIX)]
        found += [Path(place) / name for name in names if Path(name).suffix.lower() in ENDINGS]
        if unfinished:
            found += cut_recordings(Path(place))
    return sorted(((path, path.relative_to(folder).as_posix()) for path in found), key=lambda item: item[1])


def cut_recordings(folder: Path) -> list[Path]:
    """Sessions in a folder that were cut and not yet repaired; ``open_session`` repairs each."""
    found = []
    for place in sorted(folder.glob("*" + SUFFIX)):
        session = place.with_name(place.name.removesuffix(SUFFIX))
        if place.is_dir() and not session.exists() and not is_held(place):
            found.append(session)
    return found


class RecordingPlace:
    """A recording's folder, held by this process; the system lets go of it when the process ends."""

    def __init__(self, path: Path, lock: IO[bytes]) -> None:
        self.path = path
        self.folder = recording_folder(path)
        self._lock = lock

    @classmethod
    def claim(cls, path: Path) -> RecordingPlace:
        """Make the folder for a new recording.

        Raises:
            UserError: the session or the folder exists, or the place cannot be written to.
        """
        refuse_taken(path)
        folder = recording_folder(path)
        try:
            folder.mkdir()
        except FileExistsError:
            raise UserError(
                f"{folder} is there already, from a recording that is under way or was cut; open {path} to "
                "repair it, or choose another name."
            ) from None
        except OSError as error:
            raise UserError(
                f"{path} cannot be written ({error.strerror}); choose a place with room and write access."
            ) from None
        return cls.hold(path)

    @classmethod
    def hold(cls, path: Path) -> RecordingPlace:
        """Take hold of a folder that exists.

        Raises:
            UserError: another program holds it, or it cannot be written to.
        """
        folder = recording_folder(path)
        try:
            lock = (folder / LOCK).open("a+b")
        except OSError as error:
            raise UserError(
                f"{folder} cannot be written ({error.strerror}); copy it to where it can be."
            ) from None
        if not _lock(lock):
            lock.close()
            raise UserError(f"{path} is being recorded at this moment; open it when the recording has ended.")
        return cls(path, lock)

    def parts(self) -> list[Path]:
        """The runs' files in the order taken."""
        return sorted(p for p in self.folder.glob("*" + PART_SUFFIX) if p.stem.isdecimal())

    def remove(self) -> None:
        """Remove the folder with all that is in it; what is damaged is kept beside the session."""
        self.release()
        with suppress(OSError):
            for file in self.folder.iterdir():
                if file.name.endswith(DAMAGED):
                    file.replace(self.path.with_name(f"{self.path.name}.{file.name}"))
                else:
                    file.unlink()
            self.folder.rmdir()

    def release(self) -> None:
        """Let go of the folder and leave it."""
        with suppress(OSError):
            self._lock.close()


def put_aside(part: Path) -> None:
    """A run's file that cannot be read: kept, but no longer one of the runs."""
    with suppress(OSError):
        part.replace(part.with_name(part.name + DAMAGED))


def is_held(folder: Path) -> bool:
    """Whether some program is recording into the folder."""
    try:
        with (folder / LOCK).open("a+b") as lock:
            return not _lock(lock)
    except OSError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> bool:
        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _lock(file: IO[bytes]) -> bool:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


def give_name(whole: Path, path: Path) -> Path:
    """Give a finished file its name, or the next free one where somebody took it meanwhile."""
    target, number = path, 2
    while target.exists():
        target = path.with_name(f"{path.stem} ({number}){path.suffix}")
        number += 1
    whole.replace(target)
    return target


CHUNK = 4096
"""Samples a chunk: 4 s at 1 kHz. Chunks are not compressed, so that each is written in its place."""

RESERVE_SUFFIX = ".reserve"
RESERVE_BYTES = 1 << 20
"""Room that is set aside: what HDF5 may still hold when the disk is full, twenty chunks and their index."""

LEAST_BYTES = 4 * CHUNK
"""A run's file with a flushed sample is larger: chunks are written whole."""
RUN = "001"
CLEAN, TRUNCATED, LOSSY = "clean", "truncated", "lossy"
"""How a recording ended: as asked, cut off, or as asked but with samples lost in between."""

FEED_FORWARD = "feed_forward"
"""Attribute of a run: slope of the position loop's feed-forward at its end, A/rad, where the loop has one."""

_ENDED_BYTES = 16
_NOTE_BYTES = 400


@dataclass(frozen=True)
class PartHeader:
    """What a run's file says from its first moment: attributes of the root and of the run."""

    root: Mapping[str, Any]
    run: Mapping[str, Any]


class PartWriter:
    """Takes a run's samples in pieces. Every method raises OSError where the disk does not take them."""

    def __init__(self, path: Path, header: PartHeader, units: Mapping[str, str]) -> None:
        """Make the file.

        Args:
            units: channel -> unit, all channels to come; ``time`` is among them.
        """
        self.path, self.length = path, 0
        self._reserve = path.with_suffix(RESERVE_SUFFIX)
        self._reserve.write_bytes(bytes(RESERVE_BYTES))
        # A chunk is written once, from its beginning to its end: a cache of one is enough, and does not grow.
        self._file = h5py.File(path, "x", libver="latest", rdcc_nbytes=8 * CHUNK)
        root = {"format": FORMAT_NAME, "format_version": FORMAT_VERSION, **header.root}
        write_attributes(self._file, root)
        self._group = self._file.create_group(f"runs/{RUN}")
        write_attributes(self._group, header.run)
        for key, size in (("ended", _ENDED_BYTES), ("ended_note", _NOTE_BYTES)):
            self._group.attrs.create(key, np.bytes_(TRUNCATED if key == "ended" else ""), dtype=f"S{size}")
        for key in ("complete", "dropped_samples", "late_cycles"):
            self._group.attrs.create(key, 0, dtype=np.int64)
        self._datasets = {name: self._make(name, unit) for name, unit in units.items()}
        self._kinds = {name: dataset.dtype for name, dataset in self._datasets.items()}
        self._counts = 0, 0
        self._file.swmr_mode = True

    def _make(self, name: str, unit: str) -> h5py.Dataset:
        kind = np.float64 if name in ("time", "raw/encoder_counts") else np.float32
        dataset = self._group.create_dataset(
            name, (0,), maxshape=(None,), chunks=(CHUNK,), dtype=kind, fillvalue=np.nan
        )
        write_attributes(dataset, {"units": CHANNEL_UNITS.get(name, unit)})
        return dataset

    def append(self, channels: Mapping[str, Any]) -> None:
        """The next samples of every channel, arrays of one length."""
        try:
            # HDF5's own calls: h5py's indexing costs ten times as much, and this is done ten times a second.
            count = len(channels["time"])
            memory = h5s.create_simple((count,))
            for name, dataset in self._datasets.items():
                dataset.id.set_extent((self.length + count,))
                place = dataset.id.get_space()
                place.select_hyperslab((self.length,), (count,))
                dataset.id.write(memory, place, np.ascontiguousarray(channels[name], dtype=self._kinds[name]))
            self.length += count
        except (OSError, RuntimeError):
            self._spend_reserve()
            raise

    def _spend_reserve(self) -> None:
        """Give HDF5 the room to write what it still holds: it crashes where it cannot."""
        self._reserve.unlink(missing_ok=True)

    def flush(self) -> None:
        """Hand everything to the system; from here on it survives the death of this process."""
        try:
            for name, dataset in self._datasets.items():
                if name != "time":
                    dataset.flush()
            self._datasets["time"].flush()
        except (OSError, RuntimeError):
            self._spend_reserve()
            raise

    def set_counts(self, dropped: int, late: int) -> None:
        """Samples lost and cycles late so far."""
        if (dropped, late) == self._counts:
            return
        self._counts = dropped, late
        self._group.attrs.modify("dropped_samples", np.int64(dropped))
        self._group.attrs.modify("late_cycles", np.int64(late))

    def set_feed_forward(self, slope: float) -> None:
        """What the position loop's feed-forward has learned, A/rad; of a run whose header speaks of it."""
        if FEED_FORWARD in self._group.attrs:
            self._group.attrs.modify(FEED_FORWARD, np.float64(slope))

    def finish(self, ended: str, note: str, complete: bool) -> None:
        """Say how the run ended, and close the file."""
        self._group.attrs.modify("ended", np.bytes_(ended))
        self._group.attrs.modify("ended_note", np.bytes_(note.encode("utf-8")[:_NOTE_BYTES]))
        self._group.attrs.modify("complete", np.int64(complete))
        self.flush()
        self.close()

    @property
    def file(self) -> h5py.File:
        """The open file, readable even where its name is gone."""
        return self._file

    def close(self) -> None:
        """Close the file as it is."""
        self._file.close()
        self._reserve.unlink(missing_ok=True)

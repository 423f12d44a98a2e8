"""From the files of single runs to the session: at the end of a recording, and after one that was cut.

Both take the same way: the runs are copied into one file as every session is written, it is read back and
compared with what was recorded, and only then gets its name. The session says how it ended: ``clean``,
``truncated`` (cut, with a note why) or ``lossy`` (whole, with samples lost in gaps).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.progress import Progress
from fingerlab.sessions.format import (
    FORMAT_NAME,
    MAY_BE_NAN,
    OWN_ROOT_ATTRIBUTES,
    REQUIRED_CHANNELS,
    as_stored,
    plain,
)
from fingerlab.sessions.recording_files import (
    ASSEMBLING,
    CLEAN,
    LOSSY,
    RUN,
    TRUNCATED,
    VERIFYING,
    WHOLE,
    WRITING,
    WRITTEN,
    RecordingPlace,
    give_name,
    recording_folder,
)
from fingerlab.sessions.writing import SessionWriter

PIECE = 1 << 15
"""Samples copied and compared at a time: with all channels some 0.1 s of work, after which the recorder shows
that it lives; two of a session's chunks."""
WRITING_SHARE = 0.63
"""Of the time until a session is whole, what writing takes; reading back takes the rest (measured)."""
MARKERS_SUFFIX = ".markers"
_OWN_RUN = ("phase", "cable", "sample_rate_hz", "trajectory")
_WRITE_FLAGS = 0x05  # superblock version 3: open for writing, open in single-writer mode
_CUT_NOTE = "The recording was cut off; what had been flushed is here."

PartRun = tuple[Path, h5py.File, int]
"""Path of a run's file, the file, and how many samples are whole."""


def repaired(path: Path, progress: Progress | None = None) -> Path:
    """The path to open: ``path`` itself, after a recording that was cut or put off has been made whole.

    A good session costs this function a look at twelve bytes.

    Args:
        progress: called with the share done and what is being done; may raise ``Cancelled``, which leaves
            everything as it was.

    Raises:
        UserError: it is being recorded at this moment, holds no sample, or the place cannot be written to.
    """
    if not path.exists() and recording_folder(path).is_dir():
        return finish_recording(RecordingPlace.hold(path), progress)
    if was_cut(path):
        return _repair_single(path, progress)
    return path


def finish_recording(place: RecordingPlace, progress: Progress | None = None) -> Path:
    """Turn a recording's folder into the session, verified, and remove the folder.

    Raises:
        UserError: no run has a sample, or the place is full; the folder then stays as it is.
        Cancelled: raised by ``progress``; the folder stays, too, and may be finished at any time.
    """
    whole = place.folder / WHOLE
    try:
        if progress:
            progress(0.0, VERIFYING if (place.folder / WRITTEN).exists() else WRITING)
        if not whole.exists():
            _assembled(place, progress).replace(whole)
        target = give_name(whole, place.path)
    except OSError as error:
        place.release()
        raise UserError(
            f"{place.path} cannot be written ({error.strerror}); make room and open it again, the recording "
            f"is kept in {place.folder}."
        ) from None
    except (Cancelled, UserError):
        place.release()
        raise
    place.remove()
    return target


def _assembled(place: RecordingPlace, progress: Progress | None) -> Path:
    """The session in its folder, every sample read back.

    What was written to its end before it was put off is not written again. It is read back from its first
    sample all the same, and written anew where anything of it is not as recorded.
    """
    assembling, written = place.folder / ASSEMBLING, place.folder / WRITTEN
    for left in (assembling, assembling.with_name(assembling.name + ".part")):
        left.unlink(missing_ok=True)
    with _opened(place.parts()) as files:
        if written.exists():
            try:
                _read_back(_with_samples(files, place.path), written, place.path, progress, 0.0)
                return written
            except (UserError, OSError, RuntimeError, KeyError, ValueError):
                written.unlink()  # what is left of the time before is no good
        try:
            assemble_files(files, assembling, place.path, progress)
        except Cancelled:
            if assembling.exists():  # it has this name only when it is whole
                assembling.replace(written)
            raise
    return assembling


def assemble(parts: Sequence[Path], target: Path, name: Path, progress: Progress | None = None) -> None:
    """Write the runs of ``parts`` as one session ``target``, read it back, and compare.

    Args:
        name: of the session, for sentences.

    Raises:
        UserError: no part has a sample, or what was read back differs.
    """
    with _opened(parts) as files:
        assemble_files(files, target, name, progress)


def assemble_files(
    files: Sequence[tuple[Path, h5py.File]], target: Path, name: Path, progress: Progress | None = None
) -> None:
    """As :func:`assemble`, from files that are open already, even where their names are gone."""
    runs = _with_samples(files, name)
    total, done = sum(length for _, _, length in runs), 0
    root = {key: plain(value) for key, value in runs[0][1].attrs.items()}
    extra = {key: value for key, value in root.items() if key not in OWN_ROOT_ATTRIBUTES}
    endings = [_ending(file) for _, file, _ in runs]
    worst = next((kind for kind in (TRUNCATED, LOSSY) if any(kind == ended for ended, _ in endings)), CLEAN)
    notes = " ".join(f"Run {k:03d}: {note}" for k, (_, note) in enumerate(endings, start=1) if note)
    extra |= {"ended": worst, "ended_note": notes or None}
    with SessionWriter(
        target, str(root["rig"]), str(root["title"]), created=root["created"], attributes=extra, float32=True
    ) as writer:
        for part, file, length in runs:
            for count in _copy_run(writer, part, file, length):
                done += count
                if progress:
                    progress(WRITING_SHARE * done / total, WRITING)
    _read_back(runs, target, name, progress, WRITING_SHARE)


def _with_samples(files: Sequence[tuple[Path, h5py.File]], name: Path) -> list[PartRun]:
    """The runs that hold a sample.

    Raises:
        UserError: none does.
    """
    found = [(part, file, _length(file)) for part, file in files if RUN in file.get("runs", ())]
    runs = [run for run in found if run[2] > 0]
    if not runs:
        raise UserError(f"{name} holds no samples: its recording was cut before the first was written.")
    return runs


def _read_back(
    runs: Sequence[PartRun], target: Path, name: Path, progress: Progress | None, before: float
) -> None:
    """Compare every sample of a session that is written with what was recorded.

    Args:
        before: share of the work that is done already.

    Raises:
        UserError: they differ.
    """
    total, done = sum(length for _, _, length in runs), 0
    with h5py.File(target, "r") as session:
        if len(session["runs"]) != len(runs):
            raise UserError(f"{name} has {len(session['runs'])} runs of {len(runs)} that were recorded.")
        for number, (_, file, length) in enumerate(runs, start=1):
            for count in _compare(session, f"{number:03d}", file, length, name):
                done += count
                if progress:
                    progress(before + (1.0 - before) * done / total, VERIFYING)


def _copy_run(writer: SessionWriter, part: Path, file: h5py.File, length: int) -> Iterator[int]:
    group = file[f"runs/{RUN}"]
    attributes = {key: plain(value) for key, value in group.attrs.items()}
    ended, note = _ending(file)
    own = {key: value for key, value in attributes.items() if key not in _OWN_RUN}
    own |= {"ended": ended, "ended_note": note or None, "markers": _markers(part) or None}
    names = _channels(group)
    run = writer.begin_run(
        attributes["phase"],
        attributes["cable"],
        float(attributes["sample_rate_hz"]),
        json.loads(attributes["trajectory"]),
        own,
        units={name: str(plain(group[name].attrs["units"])) for name in names},
        length=length,
    )
    for start in range(0, length, PIECE):
        stop = min(start + PIECE, length)
        run.append({name: as_stored(name, group[name][start:stop]) for name in names})
        yield stop - start
    run.finish()


def _compare(session: h5py.File, run: str, file: h5py.File, length: int, name: Path) -> Iterator[int]:
    source, written = file[f"runs/{RUN}"], session[f"runs/{run}"]
    for start in range(0, length, PIECE):
        stop = min(start + PIECE, length)
        for channel in _channels(source):
            wanted, found = as_stored(channel, source[channel][start:stop]), written[channel][start:stop]
            if len(written[channel]) != length or not np.array_equal(wanted, found, equal_nan=True):
                raise UserError(
                    f"{name} read back differs from what was recorded in run {run}, '{channel}'; the "
                    "disk is not to be trusted, save elsewhere."
                )
        yield stop - start


def _channels(group: h5py.Group) -> list[str]:
    names: list[str] = []
    group.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return names


def _length(file: h5py.File) -> int:
    """Samples that are whole in every channel."""
    group = file[f"runs/{RUN}"]
    names = _channels(group)
    length = min(len(group[name]) for name in names)
    phase = str(plain(group.attrs["phase"]))
    certain = [n for n in REQUIRED_CHANNELS[phase] if n in names and n not in MAY_BE_NAN]
    while length:
        start = max(0, length - PIECE)
        good = np.logical_and.reduce([np.isfinite(group[name][start:length]) for name in certain])
        if good[-1]:
            return length
        length = start + (int(np.flatnonzero(good)[-1]) + 1 if good.any() else 0)
    return 0


def _ending(file: h5py.File) -> tuple[str, str]:
    attributes = file[f"runs/{RUN}"].attrs
    ended = str(plain(attributes.get("ended", TRUNCATED)))
    note = str(plain(attributes.get("ended_note", "")))
    return ended, note or (_CUT_NOTE if ended == TRUNCATED else "")


def _markers(part: Path) -> list[Mapping[str, Any]]:
    """Markers stand beside the run, one line of JSON each; the last line may be half a line."""
    found = []
    with suppress(OSError):
        for line in part.with_suffix(MARKERS_SUFFIX).read_text(encoding="utf-8").splitlines():
            with suppress(ValueError):
                found.append(json.loads(line))
    return found


@contextmanager
def _opened(parts: Sequence[Path]) -> Iterator[list[tuple[Path, h5py.File]]]:
    files: list[tuple[Path, h5py.File]] = []
    try:
        for part in parts:
            with suppress(OSError):  # killed before it was in single-writer mode: it holds no sample
                files.append((part, h5py.File(part, "r", swmr=True)))
        yield files
    finally:
        for _, file in files:
            file.close()


def was_cut(path: Path) -> bool:
    """Whether an HDF5 file still says that a writer has it open."""
    try:
        with path.open("rb") as file:
            head = file.read(12)
    except OSError:
        return False
    return (
        head.startswith(b"\x89HDF\r\n\x1a\n")
        and len(head) == 12
        and head[8] >= 3
        and bool(head[11] & _WRITE_FLAGS)
    )


def _repair_single(path: Path, progress: Progress | None) -> Path:
    """A run's file that somebody took out of its folder: make it whole and keep the cut one beside it."""
    try:
        with h5py.File(path, "r", swmr=True) as file:
            if plain(file.attrs.get("format")) != FORMAT_NAME or RUN not in file.get("runs", ()):
                return path
    except (OSError, RuntimeError):
        return path  # the reader says what is wrong with it
    fixed = path.with_name(path.name + ".repaired")
    fixed.unlink(missing_ok=True)
    try:
        assemble([path], fixed, path, progress)
    except BaseException:
        fixed.unlink(missing_ok=True)
        raise
    path.replace(path.with_name(path.name + ".cut"))
    return give_name(fixed, path)

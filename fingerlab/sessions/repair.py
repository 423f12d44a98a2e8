"""From the files of single runs to the session: at the end of a recording, and after one that was cut.

Both take the same way: the runs are copied into one file as every session is written, it is read back and
compared with what was recorded, and only then gets its name. The session says how it ended: ``clean``,
``truncated`` (cut, with a note why) or ``lossy`` (whole, with samples lost in gaps).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.files import seen_as
from fingerlab.core.plain_data import MOST_REASON, parsed
from fingerlab.core.progress import Progress
from fingerlab.core.text import shown
from fingerlab.sessions.disk_files import was_cut
from fingerlab.sessions.hdf5 import FILE_TROUBLE, attributes_of, opened_file
from fingerlab.sessions.model import (
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
    CLOSED,
    DAMAGED,
    LEAST_BYTES,
    LOSSY,
    RUN,
    TRUNCATED,
    VERIFYING,
    WHOLE,
    WRITING,
    WRITTEN,
    RecordingPlace,
    give_name,
    put_aside,
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
_CUT_NOTE = "The recording was cut off; what had been flushed is here."

_BETWEEN_NOTE = "The recording was cut off between two runs; those before it are whole."

PartRun = tuple[Path, h5py.File, int]
"""Path of a run's file, the file, and how many samples are whole."""


class _DamagedPart(Exception):
    """A run's file does not give back what it should hold."""

    def __init__(self, part: Path, reason: object) -> None:
        super().__init__(shown(" ".join(str(reason).split()), MOST_REASON))
        self.part = part


@contextmanager
def _reading(part: Path) -> Iterator[None]:
    try:
        yield
    except FILE_TROUBLE as error:
        raise _DamagedPart(part, error) from None


def repaired(path: Path, progress: Progress | None = None) -> Path:
    """The path to open: ``path`` itself, after a recording that was cut or put off has been made whole.

    A good session costs this function a look at twelve bytes.

    Args:
        progress: called with the share done and what is being done; may raise ``Cancelled``, which leaves
            everything as it was.

    Raises:
        UserError: it is being recorded at this moment, holds no sample, or the place cannot be written to.
    """
    if not seen_as(path) and seen_as(recording_folder(path)) == "folder":
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
    with _opened(place.parts()) as (files, words):
        if written.exists():
            try:
                _read_back(_with_samples(files, place.path), written, place.path, progress, 0.0)
                return written
            except (UserError, _DamagedPart, *FILE_TROUBLE):
                written.unlink()  # what is left of the time before is no good
        try:
            assemble_files(files, assembling, place.path, progress, [*_last_words(place), *words])
        except Cancelled:
            if assembling.exists():  # it has this name only when it is whole
                assembling.replace(written)
            raise
    return assembling


def _last_words(place: RecordingPlace) -> list[str]:
    """Why the recording itself was cut; nothing where it was closed in order."""
    try:
        words = (place.folder / CLOSED).read_text(encoding="utf-8")
    except (OSError, ValueError):
        words = _BETWEEN_NOTE
    return [words] if words else []


def assemble_files(
    files: Sequence[tuple[Path, h5py.File]],
    target: Path,
    name: Path,
    progress: Progress | None = None,
    last_words: Sequence[str] = (),
) -> None:
    """Write the runs in these files as one session ``target``, read it back, and compare.

    A run whose file is damaged is left out and told; its file is put aside as ``NUMBER.h5part.damaged``.

    Args:
        name: of the session, for sentences. last_words: sentences about what the runs do not tell.

    Raises:
        UserError: no file has a whole sample, or what was read back differs.
    """
    good = list(files)
    while True:
        try:
            _assemble(good, target, name, progress, last_words)
            return
        except _DamagedPart as error:
            part = error.part
            for file in (file for path, file in good if path == part):
                file.close()
            good = [(path, file) for path, file in good if path != part]
            put_aside(part)
            last_words = [*last_words, _damage_words(part, error)]
            if not good:
                raise UserError(f"{name} holds no run that can be read: {' '.join(last_words)}") from None


def _damage_words(part: Path, reason: object) -> str:
    return f"Run {part.stem} cannot be read ({reason}); its file is kept."


def _assemble(
    files: Sequence[tuple[Path, h5py.File]],
    target: Path,
    name: Path,
    progress: Progress | None,
    last_words: Sequence[str],
) -> None:
    runs = _with_samples(files, name)
    total, done = sum(length for _, _, length in runs), 0
    root = {key: plain(value) for key, value in runs[0][1].attrs.items()}
    extra = {key: value for key, value in root.items() if key not in OWN_ROOT_ATTRIBUTES}
    endings = [_ending(file) for _, file, _ in runs]
    kinds = {ended for ended, _ in endings}
    if TRUNCATED in kinds:  # the run says it
        last_words = [words for words in last_words if words != _BETWEEN_NOTE]
    worst = TRUNCATED if last_words else next((kind for kind in (TRUNCATED, LOSSY) if kind in kinds), CLEAN)
    words = [f"Run {_number(k, runs)}: {note}" for k, (_, note) in enumerate(endings) if note]
    extra |= {"ended": worst, "ended_note": " ".join([*words, *last_words]) or None}
    with SessionWriter(
        target, str(root["rig"]), str(root["title"]), created=root["created"], attributes=extra, float32=True
    ) as writer:
        for k, (part, file, length) in enumerate(runs):
            for count in _copy_run(writer, _number(k, runs), part, file, length):
                done += count
                if progress:
                    progress(WRITING_SHARE * done / total, WRITING)
    _read_back(runs, target, name, progress, WRITING_SHARE)


def _with_samples(files: Sequence[tuple[Path, h5py.File]], name: Path) -> list[PartRun]:
    """The runs that hold a sample.

    Raises:
        UserError: none does.
    """
    found = []
    for part, file in files:
        with _reading(part):
            if RUN in file.get("runs", ()):
                found.append((part, file, _length(file)))
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
        for k, (part, file, length) in enumerate(runs):
            for count in _compare(session, _number(k, runs), part, file, length, name):
                done += count
                if progress:
                    progress(before + (1.0 - before) * done / total, VERIFYING)


def _number(place: int, runs: Sequence[PartRun]) -> str:
    """The name of a run: its own number; where files were brought together, their order."""
    stem = runs[place][0].stem
    return stem if stem.isdecimal() and len(stem) < 6 else f"{place + 1:03d}"


def _copy_run(writer: SessionWriter, number: str, part: Path, file: h5py.File, length: int) -> Iterator[int]:
    with _reading(part):
        group = file[f"runs/{RUN}"]
        attributes = attributes_of(group)
        ended, note = _ending(file)
        own = {key: value for key, value in attributes.items() if key not in _OWN_RUN}
        own |= {"ended": ended, "ended_note": note or None, "markers": _markers(part) or None}
        names = _channels(group)
        units = {name: str(plain(group[name].attrs["units"])) for name in names}
        rate, trajectory = float(attributes["sample_rate_hz"]), parsed(attributes["trajectory"])
    try:
        run = writer.begin_run(
            attributes["phase"],
            attributes["cable"],
            rate,
            trajectory,
            own,
            units=units,
            name=number,
            length=length,
        )
        for start in range(0, length, PIECE):
            stop = min(start + PIECE, length)
            with _reading(part):
                piece = {name: as_stored(name, group[name][start:stop]) for name in names}
            run.append(piece)
            yield stop - start
        run.finish()
    except UserError as error:
        if writer.failed:
            raise
        raise _DamagedPart(part, str(error).partition(": run ")[2].rstrip(".") or error) from None


def _compare(
    session: h5py.File, run: str, part: Path, file: h5py.File, length: int, name: Path
) -> Iterator[int]:
    source, written = file[f"runs/{RUN}"], session[f"runs/{run}"]
    for start in range(0, length, PIECE):
        stop = min(start + PIECE, length)
        for channel in _channels(source):
            with _reading(part):
                wanted = as_stored(channel, source[channel][start:stop])
            found = written[channel][start:stop]
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
    with suppress(OSError, ValueError):
        for line in part.with_suffix(MARKERS_SUFFIX).read_text(encoding="utf-8").splitlines():
            with suppress(ValueError):
                found.append(parsed(line))
    return found


@contextmanager
def _opened(parts: Sequence[Path]) -> Iterator[tuple[list[tuple[Path, h5py.File]], list[str]]]:
    """The files that can be opened, and a sentence about each that should hold samples and cannot be."""
    files: list[tuple[Path, h5py.File]] = []
    words: list[str] = []
    try:
        for part in parts:
            try:
                files.append((part, opened_file(part, cut=was_cut(part))))
            except (UserError, *FILE_TROUBLE) as error:
                if part.stat().st_size > LEAST_BYTES:  # else killed before its first sample was flushed
                    put_aside(part)
                    words.append(_damage_words(part, _DamagedPart(part, error)))
        found = {part.stem for part, _ in files}
        here = found | {part.stem for part in parts if part.with_name(part.name + DAMAGED).exists()}
        before = range(1, max((int(stem) for stem in here if stem.isdecimal()), default=1))
        words += [f"Run {n:03d} is missing." for n in before if f"{n:03d}" not in here]
        yield files, words
    finally:
        for _, file in files:
            file.close()


def _repair_single(path: Path, progress: Progress | None) -> Path:
    """A run's file that somebody took out of its folder: make it whole and keep the cut one beside it."""
    try:
        with opened_file(path, cut=True) as file:
            if plain(file.attrs.get("format")) != FORMAT_NAME or RUN not in file.get("runs", ()):
                return path
    except FILE_TROUBLE:
        return path  # the reader says what is wrong with it
    fixed = path.with_name(path.name + ".repaired")
    fixed.unlink(missing_ok=True)
    try:
        with opened_file(path, cut=True) as file:
            _assemble([(path, file)], fixed, path, progress, ())
    except _DamagedPart as error:
        fixed.unlink(missing_ok=True)
        raise UserError(f"{path} was cut off while it was recorded and is damaged ({error}).") from None
    except BaseException:
        fixed.unlink(missing_ok=True)
        raise
    path.replace(path.with_name(path.name + ".cut"))
    return give_name(fixed, path)

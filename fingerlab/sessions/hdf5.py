"""HDF5 files as sessions need them: looked at, read, and written so that nothing is half believed.

A session of a thousand runs has ten thousand objects; h5py's own objects cost several times more than what
HDF5 itself needs to look at them, and opening is what every command does first: so groups are looked at with
as few calls as possible. A damaged chunk shows only when it is read, a full disk only when a file is closed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5l, h5o, h5t

from fingerlab.core.errors import UserError
from fingerlab.core.text import shown
from fingerlab.sessions.disk_files import ReadFile, TargetFile
from fingerlab.sessions.model import CHANNEL_UNITS, MAY_BE_NAN, Array, plain

MOST_LINKS = 100_000
"""Of a file: a session of a thousand runs has some ten thousand."""
MOST_LEVELS = 32
"""Groups in groups."""
MOST_NAME = 255
"""Letters of a run's, channel's or attribute's name, as of a file's."""
MOST_RUNS, MOST_CHANNELS, MOST_ATTRIBUTES = 5_000, 1_000, 1_000
MOST_ATTRIBUTE_BYTES = 1 << 20
MOST_TEXTS = 16
"""Texts of one attribute: each is found elsewhere in the file, so that many may share one long text."""
MOST_CHUNK_BYTES = 1 << 24
"""A chunk is unpacked whole for each sample of it that is read."""
FILE_TROUBLE = (
    *(ArithmeticError, LookupError, MemoryError, OSError, RuntimeError),
    *(SystemError, TypeError, ValueError),
)
"""What h5py raises while it reads a file that somebody else has made."""


@contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading and close it on the way out; whatever is wrong with it is one sentence.

    Nothing is kept open: on Windows an open reader keeps every writer from moving a file into place.

    Raises:
        UserError: the file is missing, is not HDF5, is cut off, cannot be read, or leads to other files.
    """
    try:
        with opened_file(path) as file:
            yield file
    except FILE_TROUBLE as error:
        # HDF5 reports a damaged chunk only when it is read, so the body's errors are caught here too.
        raise UserError(f"{path} cannot be read: {_reason(error)}") from None


def opened_file(path: Path, cut: bool = False) -> h5py.File:
    """The file open for reading, once it has been found to be no strange one.

    Args:
        cut: whether its writer may have been killed, so that it says of itself that it is still open.

    Raises:
        UserError, FILE_TROUBLE: it cannot be opened, or is not to be believed.
    """
    if path.is_dir():
        raise UserError(f"{path} is a folder; give the session file itself, such as session.h5.")
    if not path.exists():
        raise UserError(f"{path} does not exist; give the path of a session file (.h5).")
    if not path.is_file() or not h5py.is_hdf5(path):
        if path.suffix.lower() in TABLE_ENDINGS:
            raise UserError(
                f"{path} is not an HDF5 file; a session is one, and a table becomes one by 'fingerlab "
                "import' or by 'Import table' in Sessions."
            )
        raise UserError(
            f"{path} is not an HDF5 file; give a session (.h5), such as 'fingerlab record', 'simulate' or "
            "'import' writes."
        )
    stat = path.stat()
    state = (stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns)
    known = _FOUND_GOOD.get(path) == state
    if not (cut or known):  # HDF5 by itself asks whether another program is writing to it
        h5py.File(path, "r", locking="best-effort").close()
    file = h5py.File(ReadFile(path, cut), "r")
    try:
        if not known:
            _refuse_strange(file, path)
            _FOUND_GOOD[path] = state
    except BaseException:
        file.close()
        raise
    return file


TABLE_ENDINGS = (".txt", ".csv", ".tsv", ".dat", ".log", ".asc", ".mat")
"""Of files that are likely to be tables of numbers."""
_SIZES = (8, 8)
"""Bytes of addresses and of lengths in a file."""
_FOUND_GOOD: dict[Path, tuple[int, ...]] = {}


def _refuse_strange(file: h5py.File, path: Path) -> None:
    """A session is one file of bounded size: looked through before anything of it is read, once a change.

    Raises:
        UserError: it leads to another file, holds more than is ever recorded, or a name is no name.
    """
    if file.id.get_create_plist().get_sizes() != _SIZES:
        raise UserError(f"{path} counts its bytes as no program does; it should hold what was recorded.")
    looked: set[int] = set()
    links = 0

    def look(name: bytes, link: Any) -> str | None:
        nonlocal links
        links += 1
        last = name.rpartition(b"/")[2].decode("utf-8", errors="surrogateescape")
        where = f"/{shown(name.decode('utf-8', errors='replace'), MOST_NAME)}"
        if links > MOST_LINKS:
            return f"holds more than {MOST_LINKS} groups and datasets; it should hold what was recorded"
        if name.count(b"/") > MOST_LEVELS:
            return f"holds groups more than {MOST_LEVELS} deep; it should hold what was recorded"
        if len(last) > MOST_NAME or not last.isprintable():
            return f"holds {where}, which is no name; it should be of printable letters, at most {MOST_NAME}"
        if link.type == h5l.TYPE_EXTERNAL:
            return f"leads to another file at {where}; it should hold all of itself, so copy that into it"
        if link.type != h5l.TYPE_HARD or link.u in looked:
            return None
        looked.add(link.u)
        item = h5o.open(file.id, name)
        if not isinstance(item, h5d.DatasetID):
            return None
        storage = item.get_create_plist()
        layout = storage.get_layout()
        if layout == h5d.VIRTUAL or storage.get_external_count():
            return f"has the samples of {where} in other files; it should hold all of itself"
        if layout == h5d.CHUNKED:
            size = math.prod(storage.get_chunk()) * item.get_type().get_size()
            if size > MOST_CHUNK_BYTES:
                return f"stores {where} in chunks of more than {MOST_CHUNK_BYTES >> 20} MB; use smaller ones"
        return None

    fault = file.id.links.visit(look, info=True)
    if fault:
        raise UserError(f"{path} {fault}.")


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    if "truncated file" in text:
        return "it is cut off (copying or recording stopped early); copy it again from where it was recorded."
    if isinstance(error, PermissionError) or "Permission denied" in text:
        return "access is denied; ask for permission to read it."
    if isinstance(error, OSError) and error.filename is not None:  # the system itself, of the path
        return f"{error.strerror}; give the path of a session file (.h5)."
    if "unable to lock" in text:
        return "another program is writing to it; try again when that has finished."
    return f"it is damaged (HDF5 says: {shown(text)}); use another copy of it."


@dataclass(frozen=True)
class FileReader:
    """Samples of one run of one file. Small and picklable, so that worker processes can have it."""

    path: Path
    run: str

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Samples ``start:stop`` of several channels as float64, shape (n,), the file opened once.

        Raises:
            UserError: the file can no longer be read, or the samples break the format.
        """
        with open_hdf5(self.path) as file:
            group = file.get(f"runs/{self.run}")
            if group is None or any(name not in group for name in names):
                raise UserError(f"{self.path} has changed since it was opened; open it again.")
            result = {name: group[name].astype(np.float64)[start:stop] for name in names}
        for name, values in result.items():
            fault = sample_fault(name, values, start)
            if fault:
                raise UserError(f"{self.path}: run {self.run}, {fault}")
        return result


def sample_fault(name: str, values: Array, start: int = 0) -> str | None:
    """What is wrong with samples of a channel of the contract, as the end of a sentence, or None.

    Args:
        name: channel; others than those of the contract may hold anything.
        values: samples from index ``start`` on, shape (n,).
    """
    if name not in CHANNEL_UNITS:
        return None
    # A sum is NaN or infinite where any sample is: one pass and no temporary for the good case.
    with np.errstate(all="ignore"):
        suspicious = not np.isfinite(values.sum())
    if suspicious:
        bad = np.isinf(values) if name in MAY_BE_NAN else ~np.isfinite(values)
        if bad.any():
            index = int(np.argmax(bad))
            number = "NaN" if np.isnan(values[index]) else "an infinite number"
            return (
                f"channel '{name}' holds {number} at sample {start + index}; "
                "every sample should be a number (only endpoint_force may be NaN, where it was not read)."
            )
    if name == "time" and len(values) > 1:
        steps = np.diff(values)
        if steps.min() <= 0:
            index = int(np.argmax(steps <= 0))
            how = "stands still" if steps[index] == 0 else "runs backwards"
            before, after = values[index], values[index + 1]
            return (
                f"time {how} at sample {start + index + 1} ({before:g} s, then {after:g} s); "
                "it should increase strictly."
            )
    return None


@dataclass(frozen=True)
class DatasetFacts:
    """Shape, whether it holds numbers, and the attribute ``units`` (None where there is none)."""

    shape: tuple[int, ...]
    numeric: bool
    unit: str | None


def datasets_of(group: h5py.Group) -> dict[str, DatasetFacts]:
    """The datasets directly in a group, by name; links that lead nowhere are left out.

    Raises:
        ValueError: there are more than any machine has.
    """
    if len(group) > MOST_CHANNELS:
        raise ValueError(f"{group.name} holds {len(group)} channels")
    found = {}
    for name in group.id:
        try:
            item = h5o.open(group.id, name)
        except (KeyError, OSError, RuntimeError):
            continue
        if isinstance(item, h5d.DatasetID):
            kind = item.get_type().get_class()
            unit = _attribute(item, b"units")
            found[name.decode("utf-8", errors="replace")] = DatasetFacts(
                item.shape or (), kind in (h5t.FLOAT, h5t.INTEGER), None if unit is None else str(unit)
            )
    return found


def attributes_of(item: h5py.HLObject) -> dict[str, Any]:
    """Attributes as text, numbers, or lists of them; what is nothing of this is left out.

    Raises:
        ValueError: there are more, or larger ones, than anybody notes.
    """
    count = h5a.get_num_attrs(item.id)
    if count > MOST_ATTRIBUTES:
        raise ValueError(f"{item.name} has {count} attributes")
    found = {}
    for name in item.attrs:
        raw = name if isinstance(name, bytes) else name.encode("utf-8", errors="surrogateescape")
        value = _attribute(item.id, raw)
        if value is not None:
            found[str(name)] = value
    return found


def _attribute(item: h5d.DatasetID, name: bytes) -> Any:
    """One attribute as a plain value that is safe to show; None where there is none of text or numbers."""
    if not h5a.exists(item, name):
        return None
    attribute = h5a.open(item, name)
    if attribute.shape is None or 0 in attribute.shape:
        return None
    kind, count = attribute.get_type(), math.prod(attribute.shape)
    texts = isinstance(kind, h5t.TypeStringID) and kind.is_variable_str()
    if attribute.get_storage_size() > MOST_ATTRIBUTE_BYTES or (texts and count > MOST_TEXTS):
        raise ValueError(f"the attribute {shown(name.decode('utf-8', 'replace'))} is too large")
    if not isinstance(kind, _PLAIN_KINDS):
        return None
    value = np.empty(attribute.shape, dtype=attribute.dtype)
    attribute.read(value)
    value = plain(value)
    if isinstance(value, list):
        return [shown(item) if isinstance(item, str) else item for item in value]
    return shown(value) if isinstance(value, str) else value


_PLAIN_KINDS = (h5t.TypeStringID, h5t.TypeIntegerID, h5t.TypeFloatID, h5t.TypeEnumID)


_TEXT = h5py.string_dtype("utf-8")


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

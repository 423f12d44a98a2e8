"""Reading samples from a session file: opened, read and closed again, and never half believed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.format import CHANNEL_UNITS, MAY_BE_NAN
from fingerlab.sessions.model import Array


@contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading and close it on the way out.

    Nothing is kept open: on Windows an open reader keeps every writer from moving a file into place.

    Raises:
        UserError: the file is missing, is not HDF5, is cut off, or cannot be read.
    """
    try:
        file = _open(path)
        with file:
            yield file
    except (OSError, RuntimeError) as error:
        # HDF5 reports a damaged chunk only when it is read, so the body's errors are caught here too.
        raise UserError(f"{path} cannot be read: {_reason(error)}") from None


def _open(path: Path) -> h5py.File:
    if path.is_dir():
        raise UserError(f"{path} is a folder; give the session file itself, such as session.h5.")
    if not path.exists():
        raise UserError(f"{path} does not exist; give the path of a session file (.h5).")
    if not h5py.is_hdf5(path):
        raise UserError(
            f"{path} is not an HDF5 file; a session is one (text files become one by 'fingerlab import', "
            "or by 'Import text' in Sessions)."
        )
    return h5py.File(path, "r", locking="best-effort")


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    if "truncated file" in text:
        return "it is cut off (copying or recording stopped early); copy it again from where it was recorded."
    if isinstance(error, PermissionError) or "Permission denied" in text:
        return "access is denied; ask for permission to read it."
    if "unable to lock" in text:
        return "another program is writing to it; try again when that has finished."
    return f"it is damaged (HDF5 says: {text}); use another copy of it."


@dataclass(frozen=True)
class FileReader:
    """Samples of one run of one file. Small and picklable, so that worker processes can have it."""

    path: Path
    run: str

    def __call__(self, name: str, start: int, stop: int) -> Array:
        return self.load([name], start, stop)[name]

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

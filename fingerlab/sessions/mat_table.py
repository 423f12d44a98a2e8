"""Tables of numbers in MAT files: vectors of one length, or structs of them.

Version 5 (what MATLAB's ``save`` writes) is read by SciPy, version 7.3 is HDF5. Objects of MATLAB's own
classes (``timeseries``, ``timetable``) are not stored as numbers that other programs can read.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.hdf5 import open_hdf5
from fingerlab.sessions.model import Array, plain

MOST_VALUES = 200_000_000
"""Numbers in a file that are read, 1.6 GB: four channels at 10 kHz for more than an hour; assumed."""
MOST_COLUMNS = 64
"""A matrix of more columns is no table of channels but an image or a map; assumed."""
DEEPEST = 8
"""Structs within structs that are followed; assumed: logs nest two or three."""

_DAMAGE = (
    ValueError, TypeError, KeyError, IndexError, AttributeError, EOFError, NotImplementedError, OverflowError,
    OSError, MemoryError, RuntimeError, zlib.error,
)  # fmt: skip
"""What SciPy raises for files that are no MAT files of version 5, or damaged ones."""


@dataclass(frozen=True)
class MatTable:
    """The vectors of one length in a MAT file, or in one struct of it.

    Attributes:
        path: the file.
        name: of the struct; empty for the file's own variables.
        header: one name a column, with the unit where the file holds one.
        values: shape (rows, columns).
    """

    path: Path
    name: str
    header: tuple[str, ...]
    values: Array

    @property
    def columns(self) -> int:
        """How many columns there are."""
        return len(self.header)


def mat_tables(path: Path) -> list[MatTable]:
    """The tables of a MAT file: its variables, or where they are structs, one table a struct.

    Raises:
        UserError: the file cannot be read, or no two vectors in it are of one length.
    """
    if not path.is_file():
        raise UserError(f"{path} does not exist or is a folder; give a .mat file.")
    variables = dict(_version_73(path) if h5py.is_hdf5(path) else _version_5(path))
    own = _table(path, "", {name: v for name, v in variables.items() if not isinstance(v, Mapping)})
    if own is not None:
        return [own]
    structs = {name: v for name, v in variables.items() if isinstance(v, Mapping)}
    tables = [_table(path, name, dict(_flat(fields))) for name, fields in structs.items()]
    found = [table for table in tables if table is not None]
    if not found:
        raise UserError(
            f"{path} holds no two vectors of one length; a log should be vectors of numbers, or a struct of "
            "them (a timeseries or timetable is stored by MATLAB alone: save its Time and Data)."
        )
    return found


def _table(path: Path, name: str, variables: Mapping[str, Any]) -> MatTable | None:
    """The columns of the commonest length; None where there are not two of them."""
    columns = dict(_columns(variables))
    lengths = Counter(len(values) for values in columns.values() if len(values) > 1)
    if not lengths or lengths.most_common(1)[0][1] < 2:
        return None
    length = lengths.most_common(1)[0][0]
    units = {k.removeprefix("units."): v for k, v in variables.items() if k.startswith("units.")}
    kept = {key: values for key, values in columns.items() if len(values) == length}
    header = tuple(f"{key} ({unit})" if (unit := str(units.get(key, ""))) else key for key in kept)
    return MatTable(path, name, header, np.stack(list(kept.values()), axis=1))


def _columns(variables: Mapping[str, Any]) -> Iterator[tuple[str, Array]]:
    """Vectors by name; a matrix gives ``name_1``, ``name_2`` and so on."""
    for name, values in variables.items():
        if not isinstance(values, np.ndarray) or values.ndim > 2 or values.dtype.kind not in "fiub":
            continue
        if values.ndim < 2 or 1 in values.shape:
            yield name, np.asarray(values, dtype=np.float64).reshape(-1)
            continue
        upright = values if values.shape[0] >= values.shape[1] else values.T
        if upright.shape[1] <= MOST_COLUMNS:
            for k in range(upright.shape[1]):
                yield f"{name}_{k + 1}", np.asarray(upright[:, k], dtype=np.float64)


def _flat(fields: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Fields of structs within a struct by their names with dots."""
    for name, value in fields.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _refuse_huge(path: Path, values: float) -> None:
    if values > MOST_VALUES:
        raise UserError(
            f"{path} holds {values:.3g} numbers in one variable; a log of one axis should hold at most "
            f"{MOST_VALUES:.0e}: cut it, or thin it."
        )


def _version_5(path: Path) -> Iterator[tuple[str, Any]]:
    from scipy.io import loadmat, whosmat  # slow to import
    from scipy.io.matlab import MatReadError

    try:
        for _, shape, _ in whosmat(str(path)):
            _refuse_huge(path, float(np.prod([float(n) for n in shape])))
        content = loadmat(str(path), struct_as_record=True, squeeze_me=False)
    except (MatReadError, *_DAMAGE) as error:
        reason = " ".join(str(error).split())[:200]
        raise UserError(f"{path} is not a MAT file of version 5 or 7.3, or is damaged ({reason}).") from None
    for name, value in content.items():
        if not name.startswith("__"):
            yield from _plain_5(name, value, 0)


def _plain_5(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Structs as mappings, one for each element of an array of structs; text as text; numbers as they are."""
    if not isinstance(value, np.ndarray) or depth > DEEPEST:
        return
    if value.dtype.names is None:
        yield name, str(value.item()) if value.dtype.kind == "U" and value.size == 1 else value
        return
    for k, element in enumerate(value.reshape(-1)):
        fields: dict[str, Any] = {}
        for field in value.dtype.names:
            fields.update(_plain_5(field, element[field], depth + 1))
        yield (name if value.size == 1 else f"{name}_{k + 1}"), fields


def _version_73(path: Path) -> Iterator[tuple[str, Any]]:
    with open_hdf5(path) as file:
        found = {name: _plain_73(path, file, name, 0) for name in file if not name.startswith("#")}
    yield from ((name, value) for name, value in found.items() if value is not None)


def _plain_73(path: Path, group: h5py.Group, name: str, depth: int) -> Any:
    """A struct as a mapping, text as text, numbers the way MATLAB shows them; None: something else."""
    if depth > DEEPEST or not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return None
    item = group[name]
    if isinstance(item, h5py.Group):
        fields = {key: _plain_73(path, item, key, depth + 1) for key in item}
        return {key: value for key, value in fields.items() if value is not None}
    if not isinstance(item, h5py.Dataset) or item.is_virtual or item.external is not None:
        return None
    if item.dtype.kind not in "fiub" or "MATLAB_empty" in item.attrs:
        return None
    _refuse_huge(path, float(np.prod([float(n) for n in item.shape])))
    values = np.asarray(item[()]).T  # MATLAB counts columns first
    if plain(item.attrs.get("MATLAB_class", "")) == "char":
        return "".join(chr(int(code)) for code in values.reshape(-1)[:100])
    return values

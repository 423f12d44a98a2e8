"""Tables of numbers in foreign files: text, with its separator and header found out, and MAT files.

The bench's earlier program wrote tabs, sometimes a header row, sometimes decimal commas
(``docs/file-format.md``); other programs write semicolons, commas or spaces.

Version 5 (what MATLAB's ``save`` writes) is read by SciPy, version 7.3 is HDF5. Objects of MATLAB's own
classes (``timeseries``, ``timetable``) are not stored as numbers that other programs can read.
"""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import h5py
import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.text import FACTORS, shown
from fingerlab.sessions.hdf5 import open_hdf5
from fingerlab.sessions.model import Array, plain

BLOCK_LINES = 1 << 16
"""Lines read together: about 4 MB of text with seven columns."""

_SAMPLE_LINES = 200
MOST_LETTERS = 120
"""Of a column's title."""
_CANDIDATES = (("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), (None, "."), (None, ","))
"""Separators (None is any white space) and decimal signs, in the order in which they are preferred."""

_NUMBER = re.compile(r"[+-]?((\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|nan|inf)", re.IGNORECASE | re.ASCII)
_CLOCK = re.compile(r"((?P<date>\d{4}-\d\d-\d\d)[T ])?(?P<clock>\d{1,2}:\d\d:\d\d([.,]\d+)?)", re.ASCII)
"""A time of day, of a date or of any."""
_DAY_ZERO = date(1970, 1, 1).toordinal()
_UNITS = {"", "-", *(unit for table in FACTORS.values() for unit in table)}
SEPARATOR_WORDS = {"\t": "tab", ";": "semicolon", ",": "comma", None: "space"}


@dataclass(frozen=True)
class TextTable:
    """How a text file is laid out. Its numbers are read by :func:`read_blocks`.

    Attributes:
        path: the file.
        encoding: of its text.
        separator: between cells; None for any white space.
        decimal: ``"."`` or ``","``.
        header: one name a column, with its unit in brackets where a row of units stands below the names; None
            without a header row.
        columns: how many cells a row has.
        ahead: lines with text, comments not counted, that stand before the first row.
        clocks: columns of times of day, or dates with one; they are read as seconds.
    """

    path: Path
    encoding: str
    separator: str | None
    decimal: str
    header: tuple[str, ...] | None
    columns: int
    ahead: int = 0
    clocks: tuple[int, ...] = ()


def inspect_table(path: str | Path) -> TextTable:
    """Find out how a text file is laid out from its first lines.

    Raises:
        UserError: the file is missing, is no text, or has no table of numbers.
    """
    path = Path(path)
    encoding = _encoding(path)
    with _open(path, encoding) as file:
        lines = [line for _, line in islice(_rows(file), _SAMPLE_LINES)]
    if not lines:
        raise UserError(f"{path} is empty; it should hold a table of numbers, one row a sample.")
    separator, decimal = _separator(lines, path)
    rows = [_cells(line, separator) for line in lines]
    ahead = _ahead(rows, decimal)
    first = rows[ahead]
    clocks = tuple(k for k, cell in enumerate(first) if _CLOCK.fullmatch(cell.strip()))
    header = _header([[cell.strip().strip('"') for cell in row] for row in rows[:ahead]], len(first), clocks)
    return TextTable(path, encoding, separator, decimal, header, len(first), ahead, clocks)


def _ahead(rows: Sequence[Sequence[str]], decimal: str) -> int:
    """How many lines stand before the first row: all numbers, or mostly and as wide as the others."""
    numbers = [sum(_is_number(cell, decimal) for cell in row) for row in rows]
    whole = Counter(len(row) for row, n in zip(rows, numbers, strict=True) if n == len(row) > 1)
    width = whole.most_common(1)[0][0]
    return next(
        k
        for k, (row, n) in enumerate(zip(rows, numbers, strict=True))
        if n == len(row) > 1 or (len(row) == width and 2 * n > width)
    )


def _header(above: Sequence[Sequence[str]], columns: int, clocks: Sequence[int]) -> tuple[str, ...] | None:
    """The names right above the first row, with the units below them; what stands higher is of the file."""
    if not above or len(above[-1]) != columns:
        return None
    names = list(above[-1])
    units = [cell.strip("[]() ") for cell in names]
    if len(above) > 1 and len(above[-2]) == columns and all(u in _UNITS for u in units) and any(units):
        names = [f"{name} ({unit})" if unit else name for name, unit in zip(above[-2], units, strict=True)]
    for k in clocks:
        names[k] = names[k] if names[k].endswith((")", "]")) else f"{names[k]} (s)"
    return tuple(shown(name, MOST_LETTERS) for name in names)


def read_blocks(
    table: TextTable, block_lines: int = BLOCK_LINES, *, progress: Callable[[float], None] | None = None
) -> Iterator[Array]:
    """The table's numbers, a block of rows at a time, each of shape (rows, columns).

    Args:
        progress: called with the share of the file that is read (0 to 1) before each block is handed on.

    Raises:
        UserError: a row has more or fewer cells than the first, or a cell is not a number; the sentence
            names file and line.
    """
    with _open(table.path, table.encoding) as file:
        rows = _rows(file)
        for _ in range(table.ahead):
            next(rows)
        size = max(table.path.stat().st_size, 1)
        while block := list(islice(rows, block_lines)):
            if progress is not None:
                progress(file.buffer.tell() / size)
            yield _parse(block, table)


def _parse(block: Sequence[tuple[int, str]], table: TextTable) -> Array:
    lines = [line for _, line in block]
    if table.decimal == ",":
        if any("." in line for line in lines):
            raise _fault(block, table)
        lines = [line.replace(",", ".") for line in lines]
    if table.clocks:
        lines = [_without_clocks(line, table) for line in lines]
    try:
        values = np.loadtxt(lines, delimiter=table.separator, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        raise _fault(block, table) from None
    if values.shape != (len(block), table.columns):
        raise _fault(block, table)
    return np.asarray(values)


def _without_clocks(line: str, table: TextTable) -> str:
    """A row whose times of day are seconds: since midnight, or since 1970 where a date is told."""
    cells = _cells(line, table.separator)
    for k in table.clocks:
        match = _CLOCK.fullmatch(cells[k].strip()) if k < len(cells) else None
        if match is not None:
            day = date.fromisoformat(match["date"]).toordinal() - _DAY_ZERO if match["date"] else 0
            hours, minutes, seconds = match["clock"].replace(",", ".").split(":")
            cells[k] = repr(86400.0 * day + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds))
    return (table.separator or " ").join(cells)


def _fault(block: Sequence[tuple[int, str]], table: TextTable) -> UserError:
    """The sentence about the first row of a block that does not fit."""
    for number, line in block:
        cells = _cells(line, table.separator)
        if len(cells) != table.columns:
            return UserError(
                f"{table.path}, line {number} has {len(cells)} columns where the first row has "
                f"{table.columns}; every row should have the same number of columns."
            )
        for index, cell in enumerate(cells):
            if not _is_number(cell, table.decimal):
                word = "comma" if table.decimal == "," else "point"
                return UserError(
                    f"{table.path}, line {number}, column {index + 1} holds "
                    f"{shown(cell.strip(), MOST_LETTERS)!r}; "
                    f"it should be a number with a decimal {word}."
                )
    return UserError(f"{table.path} cannot be read as a table near line {block[0][0]}.")


def _separator(lines: Sequence[str], path: Path) -> tuple[str | None, str]:
    """The separator and decimal sign under which most lines are rows of the same number of numbers."""

    def score(candidate: tuple[str | None, str]) -> int:
        separator, decimal = candidate
        rows = (_cells(line, separator) for line in lines)
        widths = Counter(
            len(row) for row in rows if len(row) > 1 and all(_is_number(cell, decimal) for cell in row)
        )
        return max(widths.values(), default=0)

    scores = [score(candidate) for candidate in _CANDIDATES]
    best = max(scores)
    if best == 0:
        raise UserError(
            f"{path} holds no row of two numbers or more in its first {len(lines)} lines; it should be a "
            "table with tabs, semicolons, commas or spaces between the numbers."
        )
    return _CANDIDATES[scores.index(best)]


def _cells(line: str, separator: str | None) -> list[str]:
    return line.split(separator)


def _is_number(cell: str, decimal: str) -> bool:
    text = cell.strip()
    if _CLOCK.fullmatch(text):
        return True
    if decimal == ",":
        # A point in a file with decimal commas is a thousands mark or a mistake; neither is guessed at.
        text = text.replace(".", "?").replace(",", ".")
    return _NUMBER.fullmatch(text) is not None


def _rows(file: TextIO) -> Iterator[tuple[int, str]]:
    """Numbered lines (from 1) without blank lines and comments."""
    for number, line in enumerate(file, start=1):
        text = line.strip(" \r\n").rstrip("\t")
        if text.strip() and not text.startswith(("#", "%")):
            yield number, text


def _open(path: Path, encoding: str) -> TextIO:
    try:
        return path.open(encoding=encoding, errors="replace")
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}); give a text file.") from None


def _encoding(path: Path) -> str:
    """Encoding by the file's first bytes; older programs wrote the degree sign in the Windows code page."""
    try:
        if not path.is_file():
            raise OSError(0, "it is no file" if path.exists() else "it does not exist")
        with path.open("rb") as file:
            start = file.read(1 << 16)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}); give a text file.") from None
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in start:
        raise UserError(f"{path} is not a text file; 'fingerlab import' reads tables of numbers in text.")
    try:
        # The last character may be cut in two by the end of the sample.
        start.decode("utf-8-sig") if len(start) < 1 << 16 else start[:-4].decode("utf-8-sig", "strict")
    except UnicodeDecodeError as error:
        if error.start < len(start) - 8:
            return "cp1252"
    return "utf-8-sig"


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


def is_mat(path: Path) -> bool:
    """Whether a file is to be read as a MAT file, by its name."""
    return path.suffix.lower() == ".mat"


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

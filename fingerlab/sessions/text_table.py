"""Tables of numbers in foreign text files, with their separator and header found out.

The bench's earlier program wrote tabs, sometimes a header row, sometimes decimal commas
(``docs/file-format.md``); other programs write semicolons, commas or spaces, numbers in quotes, a separator
behind the last one, and columns of words among those of numbers.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from fingerlab.core.errors import UserError
from fingerlab.core.text import FACTORS, shown
from fingerlab.sessions.model import Array

BLOCK_LINES = 1 << 16
"""Lines read together: about 4 MB of text with seven columns."""

_SAMPLE_LINES = 200
MOST_LETTERS = 120
"""Of a column's title."""
_CANDIDATES = (
    ("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), (None, "."), (None, ","), (",", ","),
)  # fmt: skip
"""Separators (None is any white space) and decimal signs, in the order in which they are preferred. Commas
are both only where quotes hold the numbers together."""

_NUMBER = re.compile(r"[+-]?((\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|nan|inf)", re.IGNORECASE | re.ASCII)
_SEVERAL = re.compile(r"(?=.*\d)[-+\d.eE]*[,;\s][-+\d.,;\seE]*", re.ASCII)
"""Numbers with a separator between them: no cell, but what another separator would part."""
_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,' ]\d{3})+([.,]\d*)?", re.ASCII)
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
        columns: how many cells a row has; an empty one behind the last separator is none.
        ahead: lines with text, comments not counted, that stand before the first row.
        clocks: columns of times of day, or dates with one; they are read as seconds.
        words: columns that hold words, or nothing, in place of numbers, by index, with one of their cells.
    """

    path: Path
    encoding: str
    separator: str | None
    decimal: str
    header: tuple[str, ...] | None
    columns: int
    ahead: int = 0
    clocks: tuple[int, ...] = ()
    words: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RowFault:
    """A row of a table that cannot be read as it stands: all of it, or one of its cells.

    Attributes:
        row: its index in the block. column: of the cell, from 0; None: the row has too few cells or too many.
        words: what is wrong, and what would be right, as the end of a sentence.
    """

    row: int
    column: int | None
    words: str


@dataclass(frozen=True)
class TableRows:
    """A block of rows of a table.

    Attributes:
        values: shape (rows, columns); NaN where nothing could be read, and in columns of words.
        lines: in which lines of the file they stand, from 1, shape (rows,).
        faults: what could not be read, in the order of the rows.
        last: whether the file ends with them.
    """

    values: Array
    lines: NDArray[np.int64]
    faults: tuple[RowFault, ...]
    last: bool


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
    like = [k for k, row in enumerate(rows) if _is_row(row, decimal)]
    width = Counter(len(rows[k]) for k in like).most_common(1)[0][0]
    words = _words([rows[k] for k in like if len(rows[k]) == width], decimal)
    ahead = _ahead(rows, decimal, width, words)
    above = [[cell.strip().strip('"') for cell in row] for row in rows[:ahead]]
    columns = width
    while columns - 1 in words and not words[columns - 1] and not _named(above, columns):
        columns -= 1
        del words[columns]
    first = _fitting(rows[ahead], columns)
    clocks = tuple(k for k, cell in enumerate(first) if k not in words and _CLOCK.fullmatch(cell.strip()))
    if separator == "," and above:
        _refuse_decimal_commas(above[-1], [row for row in rows[ahead:] if row], path)
    header = _header([_fitting(row, columns) for row in above], len(first), clocks)
    return TextTable(path, encoding, separator, decimal, header, len(first), ahead, clocks, words)


def _refuse_decimal_commas(names: Sequence[str], rows: Sequence[Sequence[str]], path: Path) -> None:
    """Commas that part the columns and the decimals alike: more numbers in a row than names, and no point.

    Raises:
        UserError: it is so.
    """
    widths = {len(row) for row in rows}
    titled = len(names) > 1 and all(name and not _is_number(name, ".") for name in names)
    whole = all(row[0].strip().lstrip("+-").isdecimal() for row in rows)
    if not titled or not whole or any("." in cell for row in rows for cell in row):
        return
    if not len(names) < min(widths) <= max(widths) <= 2 * len(names):
        return
    if len(widths) == 1 and max(widths) < 2 * len(names):
        return
    most = max(widths)
    raise UserError(
        f"{path} has {len(names)} names above rows of {most} numbers, for commas stand between the columns "
        "and in the numbers; write these with decimal points, or part the columns by semicolons or tabs."
    )


def _named(above: Sequence[Sequence[str]], columns: int) -> bool:
    """Whether the lines above the first row have a name for the last of so many columns."""
    return bool(above) and len(above[-1]) >= columns and bool(above[-1][columns - 1])


def _words(rows: Sequence[Sequence[str]], decimal: str) -> dict[int, str]:
    """Columns of rows of one width that hold no numbers, each with a cell of it that says something."""
    result = {}
    for k in range(len(rows[0])):
        told = [cell for row in rows if (cell := row[k].strip())]
        if 2 * sum(_is_number(cell, decimal) for cell in told) <= len(told):
            result[k] = next((cell for cell in told if not _is_number(cell, decimal)), "")
    return result


def _ahead(rows: Sequence[Sequence[str]], decimal: str, width: int, words: Mapping[int, str]) -> int:
    """How many lines stand before the first row: all numbers, or mostly and as wide as the others."""
    for k, row in enumerate(rows):
        numbers = [index for index, cell in enumerate(row) if _is_number(cell, decimal)]
        if len(numbers) == len(row) > 1:
            return k
        wanted = width - len(words)
        if len(row) == width and 2 * len([n for n in numbers if n not in words]) > wanted:
            return k
    return 0


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
    for column, cell in table.words.items():
        raise UserError(f"{table.path}{_cell_words(column, cell, table)}.")
    for rows in read_rows(table, block_lines, progress=progress):
        for fault in rows.faults[:1]:
            raise UserError(f"{table.path}, line {rows.lines[fault.row]}{fault.words}.")
        yield rows.values


def read_rows(
    table: TextTable, block_lines: int = BLOCK_LINES, *, progress: Callable[[float], None] | None = None
) -> Iterator[TableRows]:
    """The table's rows, a block at a time, with what could not be read of them.

    Args:
        progress: as in :func:`read_blocks`.

    Raises:
        UserError: a number is written with the other decimal sign.
    """
    with _open(table.path, table.encoding) as file:
        rows = _rows(file)
        for _ in range(table.ahead):
            next(rows)
        size = max(table.path.stat().st_size, 1)
        block = list(islice(rows, block_lines))
        while block:
            if progress is not None:
                progress(file.buffer.tell() / size)
            following = list(islice(rows, block_lines))
            lines = np.array([number for number, _ in block], dtype=np.int64)
            values, faults = _parse(block, table)
            yield TableRows(values, lines, faults, not following)
            block = following


def _parse(block: Sequence[tuple[int, str]], table: TextTable) -> tuple[Array, tuple[RowFault, ...]]:
    """All lines at once where they are as they should be, otherwise cell by cell."""
    lines = [line for _, line in block]
    if table.separator and all(line.endswith(table.separator) for line in lines):
        lines = [line[:-1] for line in lines]
    if table.words or any('"' in line for line in lines):
        return _one_by_one(block, table)
    if table.decimal == ",":
        if any("." in line for line in lines):
            return _one_by_one(block, table)
        lines = [line.replace(",", ".") for line in lines]
    if table.clocks:
        lines = [_without_clocks(line, table) for line in lines]
    try:
        values = np.loadtxt(lines, delimiter=table.separator, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        return _one_by_one(block, table)
    if values.shape != (len(block), table.columns):
        return _one_by_one(block, table)
    return np.asarray(values), ()


def _without_clocks(line: str, table: TextTable) -> str:
    """A row whose times of day are seconds."""
    cells = _cells(line, table.separator)
    for k in table.clocks:
        seconds = _clock_seconds(cells[k]) if k < len(cells) else None
        if seconds is not None:
            cells[k] = repr(seconds)
    return (table.separator or " ").join(cells)


def _clock_seconds(cell: str) -> float | None:
    """A time of day in seconds: since midnight, or since 1970 where a date is told."""
    match = _CLOCK.fullmatch(cell.strip())
    if match is None:
        return None
    day = date.fromisoformat(match["date"]).toordinal() - _DAY_ZERO if match["date"] else 0
    hours, minutes, seconds = match["clock"].replace(",", ".").split(":")
    return 86400.0 * day + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)


def _one_by_one(block: Sequence[tuple[int, str]], table: TextTable) -> tuple[Array, tuple[RowFault, ...]]:
    """The numbers of a block whose lines are not all alike, with what is wrong in them."""
    values = np.full((len(block), table.columns), np.nan)
    faults = list[RowFault]()
    numbers = [k for k in range(table.columns) if k not in table.words]
    for row, (line, text) in enumerate(block):
        cells = _fitting(_cells(text, table.separator), table.columns)
        if len(cells) != table.columns:
            words = (
                f" has {len(cells)} columns where the first row has {table.columns}; every row should have "
                "the same number of columns"
            )
            faults.append(RowFault(row, None, words))
            continue
        for k in numbers:
            value = _clock_seconds(cells[k]) if k in table.clocks else None
            value = _number(cells[k], table.decimal) if value is None else value
            if value is not None:
                values[row, k] = value
                continue
            faults.append(RowFault(row, k, _cell_words(k, cells[k], table)))
            if _written_otherwise(cells[k], table.decimal):
                raise UserError(f"{table.path}, line {line}{faults[-1].words}.")
    return values, tuple(faults)


def _written_otherwise(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with the other decimal sign, or with marks of thousands: that is no gap."""
    other = "." if decimal == "," else ","
    return _number(cell, other) is not None or _THOUSANDS.fullmatch(cell.strip()) is not None


def _cell_words(column: int, cell: str, table: TextTable) -> str:
    """What is wrong with a cell, as the end of a sentence."""
    sign = "comma" if table.decimal == "," else "point"
    held = shown(cell.strip(), MOST_LETTERS)
    return f", column {column + 1} holds {held!r}; it should be a number with a decimal {sign}"


def _separator(lines: Sequence[str], path: Path) -> tuple[str | None, str]:
    """The separator and decimal sign under which most lines are rows of the same number of cells."""

    def score(candidate: tuple[str | None, str]) -> tuple[int, int]:
        separator, decimal = candidate
        rows = [_cells(line, separator) for line in lines]
        like = [k for k, row in enumerate(rows) if _is_row(row, decimal)]
        if not like:
            return 0, 0
        width, most = Counter(len(rows[k]) for k in like).most_common(1)[0]
        alike = [rows[k] for k in like if len(rows[k]) == width]
        whole = sum(all(_is_number(cell, decimal) for cell in row) for row in alike)
        # Two numbers may stand in a line of prose; a table goes on.
        goes_on = whole > 0 or (most > 1 and 2 * most >= len(rows) - like[0])
        return (most, whole) if goes_on else (0, 0)

    scores = [score(candidate) for candidate in _CANDIDATES]
    best = max(scores)
    if best == (0, 0):
        raise UserError(
            f"{path} holds no row of two numbers or more in its first {len(lines)} lines; it should be a "
            "table with tabs, semicolons, commas or spaces between the numbers."
        )
    return _CANDIDATES[scores.index(best)]


def _cells(line: str, separator: str | None) -> list[str]:
    """The cells of a line; quotes around one are none of it, and hold together what stands in them."""
    if '"' not in line:
        return line.split(separator)
    if separator is None:
        return [cell.strip('"') for cell in line.split()]
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [""])


def _fitting(cells: Sequence[str], columns: int) -> list[str]:
    """Cells of a line without empty ones behind the last column."""
    cells = list(cells)
    while len(cells) > columns and not cells[-1].strip():
        cells.pop()
    return cells


def _is_row(cells: Sequence[str], decimal: str) -> bool:
    """Whether the cells of a line are two numbers at least, and no other is numbers run together."""
    numbers = [_is_number(cell, decimal) for cell in cells]
    return sum(numbers) > 1 and not any(
        _SEVERAL.fullmatch(cell.strip()) for cell, known in zip(cells, numbers, strict=True) if not known
    )


def _is_number(cell: str, decimal: str) -> bool:
    return _CLOCK.fullmatch(cell.strip()) is not None or _number(cell, decimal) is not None


def _number(cell: str, decimal: str) -> float | None:
    """What a cell says; None: it is no number with this decimal sign."""
    text = cell.strip()
    if decimal == ",":
        # A point in a file with decimal commas is a thousands mark or a mistake; neither is guessed at.
        text = text.replace(".", "?").replace(",", ".")
    return float(text) if _NUMBER.fullmatch(text) else None


def _rows(file: TextIO) -> Iterator[tuple[int, str]]:
    """Numbered lines (from 1) without blank lines and comments."""
    for number, line in enumerate(file, start=1):
        text = line.strip(" \r\n")
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

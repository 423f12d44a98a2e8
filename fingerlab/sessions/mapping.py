"""Which column of a text file is which channel, and in what unit.

A mapping is the word ``auto``, an inline text such as ``time=1,motor_command=2:deg``, or a JSON or TOML
file such as ``motor_command = { column = 2, unit = "deg" }``. Columns are given by position (from 1) or by
the text of their header.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.core.units import FACTORS, factor
from fingerlab.sessions.format import CHANNEL_UNITS
from fingerlab.sessions.text_table import TextTable

BENCH_ORDER = (
    "time",
    "motor_command",
    "motor_position",
    "motor_torque",
    "mcp_angle",
    "pip_angle",
    "endpoint_force",
)
"""Columns of the bench's own text files, which have the same order with and without a header."""

_ASSUMED_UNIT = {"rad": "deg"}
"""Unit taken where nothing is said: the bench's text files hold angles in degrees (session format)."""

_KEYWORDS = (
    ("load_torque", r"load.?torque"),
    ("endpoint_force", r"force|load.?cell|kraft|forza"),
    ("mcp_angle", r"mcp"),
    ("pip_angle", r"pip"),
    ("motor_command", r"command|\bcmd|reference|set.?point|desired|target"),
    ("motor_current", r"current"),
    ("motor_torque", r"torque"),
    ("motor_position", r"position|motor.?(angle|pos)|encoder"),
    ("time", r"^(t|time|zeit|tempo|timestamp|elapsed.*)$"),
)
"""What a header says of the bench's quantities; the first that matches counts."""

_HEADER_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\((?P<a>[^()]*)\)|\[(?P<b>[^\[\]]*)\]|\s/\s*(?P<c>\S+))\s*$")
_CHANNEL_NAME = re.compile(r"(raw/)?[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Column:
    """One channel taken from one column.

    Attributes:
        channel: name in the session.
        index: column, from 0.
        unit: unit in the text file.
        target_unit: unit in the session.
        factor: session value = factor * text value.
        source: what the column was found by, in words.
    """

    channel: str
    index: int
    unit: str
    target_unit: str
    factor: float
    source: str


@dataclass(frozen=True)
class _Wish:
    """One entry of a mapping as the user gave it."""

    column: int | str
    unit: str | None = None
    scale: float = 1.0


def map_columns(table: TextTable, mapping: str | None) -> tuple[Column, ...]:
    """Which column of the table is which channel.

    Args:
        table: layout of the text file.
        mapping: None or ``auto`` (by header, or in the bench's own order where there is none and the
            number of columns fits), an inline text, or the path of a JSON or TOML file.

    Raises:
        UserError: the mapping cannot be understood or does not fit the file.
    """
    if mapping in (None, "", "auto"):
        return _by_header(table) if table.header else _in_bench_order(table)
    columns = tuple(_wished(table, channel, wish) for channel, wish in _read_mapping(str(mapping)).items())
    _refuse_twice(columns, table)
    return columns


def _in_bench_order(table: TextTable) -> tuple[Column, ...]:
    if table.columns != len(BENCH_ORDER):
        raise UserError(
            f"{table.path} has no header and {table.columns} columns; say which is which with --map, "
            "such as time=1,motor_command=2:deg (the bench's own order has seven)."
        )
    return tuple(
        _column(name, index, None, 1.0, "the bench's order", table) for index, name in enumerate(BENCH_ORDER)
    )


def _by_header(table: TextTable) -> tuple[Column, ...]:
    assert table.header is not None
    columns = []
    for index, cell in enumerate(table.header):
        name, unit = split_header(cell)
        columns.append(_column(_channel_of(name, index), index, unit, 1.0, f"header '{cell}'", table))
    _refuse_twice(columns, table)
    return tuple(columns)


def split_header(cell: str) -> tuple[str, str | None]:
    match = _HEADER_UNIT.match(cell)
    if match is None:
        return cell.strip(), None
    unit = match["a"] if match["a"] is not None else match["b"] if match["b"] is not None else match["c"]
    return match["name"].strip(), unit.strip()


def _channel_of(name: str, index: int) -> str:
    """The channel that a header's name means; a name of its own for quantities that the bench lacks."""
    if name in CHANNEL_UNITS or (_CHANNEL_NAME.fullmatch(name) and name.startswith("raw/")):
        return name
    lowered = name.lower().replace("_", " ")
    for channel, pattern in _KEYWORDS:
        if re.search(pattern, lowered):
            return channel
    cleaned = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower()
    return cleaned if cleaned and not cleaned[0].isdigit() else f"column_{index + 1}"


def _wished(table: TextTable, channel: str, wish: _Wish) -> Column:
    if not _CHANNEL_NAME.fullmatch(channel):
        raise UserError(f"The mapping names the channel {channel!r}; a name is of letters, digits and _.")
    column, unit = wish.column, wish.unit
    if isinstance(column, str) and column.isdecimal():
        column = int(column)
    if isinstance(column, str):
        index, source = _find_header(table, channel, column), f"header '{column}'"
        unit = unit or split_header(column)[1]
    else:
        index, source = column - 1, f"column {column}"
        if not 0 <= index < table.columns:
            raise UserError(
                f"The mapping takes '{channel}' from column {column}, but {table.path} has columns 1 to "
                f"{table.columns}."
            )
        if unit is None and table.header:
            unit = split_header(table.header[index])[1]
    return _column(channel, index, unit, wish.scale, source, table)


def _find_header(table: TextTable, channel: str, wanted: str) -> int:
    if table.header is None:
        raise UserError(
            f"The mapping takes '{channel}' from the header {wanted!r}, but {table.path} has no header; "
            "give the column by its number."
        )
    names = [cell.casefold() for cell in table.header]
    bare = [split_header(cell)[0].casefold() for cell in table.header]
    for candidates in (names, bare):
        if candidates.count(wanted.casefold()) == 1:
            return candidates.index(wanted.casefold())
    raise UserError(
        f"The mapping takes '{channel}' from the header {wanted!r}, but {table.path} has "
        f"{', '.join(table.header)}."
    )


def _column(
    channel: str, index: int, unit: str | None, scale: float, source: str, table: TextTable
) -> Column:
    target = CHANNEL_UNITS.get(channel)
    if target is None:
        return Column(channel, index, unit or "", unit or "", scale, source)
    if not unit:
        unit = _ASSUMED_UNIT.get(target, target)
        source += ", unit assumed"
    times = factor(unit, target)
    if times is None:
        raise UserError(
            f"{table.path}, column {index + 1} is taken as '{channel}' in '{unit}'; it should be in one of "
            f"{', '.join(FACTORS[target])}."
        )
    return Column(channel, index, unit, target, times * scale, source)


def _refuse_twice(columns: tuple[Column, ...] | list[Column], table: TextTable) -> None:
    seen: dict[str, Column] = {}
    for column in columns:
        other = seen.setdefault(column.channel, column)
        if other is not column:
            raise UserError(
                f"{table.path}: columns {other.index + 1} and {column.index + 1} both look like "
                f"'{column.channel}'; say which is which with --map."
            )


def _read_mapping(mapping: str) -> dict[str, _Wish]:
    """Entries of an inline mapping or of a mapping file."""
    path = Path(mapping)
    if path.suffix.lower() in (".json", ".toml"):
        return {channel: _entry(channel, value, mapping) for channel, value in _file(path).items()}
    if "=" not in mapping:
        raise UserError(
            f"The mapping {mapping!r} is neither 'auto' nor a .json or .toml file nor a text such as "
            "time=1,motor_command=2:deg."
        )
    wishes: dict[str, _Wish] = {}
    for part in mapping.split(","):
        channel, equals, rest = (text.strip() for text in part.partition("="))
        fields = [text.strip() for text in rest.split(":")]
        if not (equals and channel and fields[0]) or len(fields) > 3:
            raise UserError(
                f"The mapping holds {part.strip()!r}; each part should read CHANNEL=COLUMN, "
                "CHANNEL=COLUMN:UNIT or CHANNEL=COLUMN:UNIT:SCALE."
            )
        if channel in wishes:
            raise UserError(f"The mapping names '{channel}' twice; each channel has one column.")
        unit = fields[1] if len(fields) > 1 and fields[1] else None
        wishes[channel] = _Wish(fields[0], unit, _scale(fields[2] if len(fields) > 2 else 1.0, channel))
    return wishes


def _file(path: Path) -> dict[str, Any]:
    text = read_text(path, "a mapping file such as COLUMNS.toml")
    where, advice = f"The mapping file {path}", "it should read like time = 1"
    data = read_object(text, where, advice, toml=path.suffix.lower() == ".toml")
    if not data:
        raise UserError(f"{where} holds no columns; {advice}.")
    return data


def _entry(channel: str, value: Any, where: str) -> _Wish:
    table = dict(value) if isinstance(value, Mapping) else {"column": value}
    column = table.pop("column", None)
    unit, scale = table.pop("unit", None), _scale(table.pop("scale", 1.0), channel)
    if table or isinstance(column, bool) or not isinstance(column, (int, str)):
        raise UserError(
            f"{where}: '{channel}' should be a column number, a header, or a table of column, unit and scale."
        )
    return _Wish(column, None if unit is None else str(unit), scale)


def _scale(value: Any, channel: str) -> float:
    try:
        scale = float(value)
    except (TypeError, ValueError):
        scale = math.nan
    if not math.isfinite(scale) or scale == 0:
        raise UserError(f"The mapping scales '{channel}' by {value!r}; it should be a number such as -1.")
    return scale

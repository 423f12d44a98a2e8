"""Which column of a text file is which channel, and in what unit.

A mapping is the word ``auto``, an inline text such as ``time=1,motor_command=2:deg``, or a JSON or TOML
file such as ``motor_command = { column = 2, unit = "deg" }``. Columns are given by position (from 1) or by
the text of their header. A log of one axis (:class:`Axis`) names its units; a linear one is told as an arc.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.core.text import FACTORS, factor, listed, shown
from fingerlab.sessions.mat_table import MatTable
from fingerlab.sessions.model import CHANNEL_UNITS
from fingerlab.sessions.text_table import MOST_LETTERS, TextTable

Table = TextTable | MatTable

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
    ("motor_current", r"current|strom"),
    ("motor_torque", r"torque|drehmoment"),
    ("motor_position", r"position|motor.?(angle|pos|winkel)|encoder"),
    ("time", r"^(t|time|zeit|tempo|timestamp|elapsed.*)$"),
)
"""What a header says of the bench's quantities; the first that matches counts."""

_AXIS_NAMES = {
    "position": "motor_position",
    "torque": "motor_torque",
    "current": "motor_current",
    "load": "load_torque",
    "command": "motor_command",
}
"""Short names of an axis' quantities that a mapping may use."""

_AXIS_KEYWORDS = (
    ("motor_command", r"command|\bcmd|reference|\bref|set.?point|desired|target|\bsoll"),
    ("load_torque", r"load|\blast\b"),
    ("motor_current", r"current|strom|^i(q| q|a)?$"),
    ("motor_torque", r"torque|effort|^tau|^[τ𝜏]|force|kraft|moment|^f\b"),
    (
        "motor_position",
        r"^(q|x)\d*$|position|\bpos|angle|theta|^[θϑφϕ]|encoder|stroke|displacement|winkel|\bweg\b|\bhub\b",
    ),
    ("time", r"^(t|time|zeit|zeitstempel|tempo|timestamp|stamp|elapsed.*|tout)$"),
)
"""What a header says of an axis; the first that matches counts."""

_AXIS_SYMBOLS = (
    ("motor_position", re.compile(r"^(phi|alpha|s|y|[φϕα])\d*$", re.IGNORECASE)),
    ("motor_torque", re.compile(r"^(T|M)\d*$")),
)
"""Letters that may mean a quantity of an axis, where no other column does and their unit fits it."""
_GUESSED = ("time", "motor_position", "motor_torque", "motor_current")
"""What a column may be by its letter or its unit alone, where it is the only one."""

_EITHER = ("motor_torque", "motor_current")
"""Of these an axis needs one."""

AUTOMATIC = (None, "", "auto")
"""Mappings that leave it to the header, or to the bench's own order."""
AXIS_RADIUS_M = 0.01
"""Radius of the arc as which a linear axis is told, m: 1 mm is 0.1 rad and 1 N is 0.01 N m. Only a scale."""

_HEADER_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\((?P<a>[^()]*)\)|\[(?P<b>[^\[\]]*)\]|\s/\s*(?P<c>\S+))\s*$")
_TRAILING_UNIT = re.compile(r"^(?P<name>.*[^\W_])[_ ](?P<unit>[^\W\d_]+|°)$")
_USUAL_UNITS = {"s": "s", "rad": "deg", "A": "A", "N m": "Nm"}
"""What an axis' quantities are usually told in, by their SI units."""
_LINEAR_UNITS = {**_USUAL_UNITS, "rad": "mm", "N m": "N"}
"""The same of one that moves along a line."""
_ALONG_A_LINE = {"rad": "m", "N m": "N"}
"""What stands on a linear axis in place of an angle and a torque."""
_LINEAR_WORDS = re.compile(r"force|kraft|stroke|displacement|\bweg\b|\bhub\b")
"""In a header: the axis is likely to move along a line."""
_COUNTS = re.compile(r"count|\bcnts?\b|ticks?\b|puls|\bsteps?\b|inkrement|increment|quadrature")
"""In a header: a place in steps of an encoder, of which nobody but its owner knows how far one is."""
_NO_UNITS = ("m", "v", "V", "g", "in")
"""At the end of a name they rather mean a motor, a velocity, gravity or what goes in."""
_TWO_WORDS = re.compile(r"^(?P<name>.*[^\W_])[_ ](?P<first>[^\W\d_]+)[_ ](?P<second>[^\W\d_]+)$")
"""A unit of two words behind a name, as in ``torque_kgf_cm``."""
_OWN_FACTOR = 0.00153
"""In the example of a unit of one's own: a step of an encoder of 4,096 steps, rad."""
MOST_SHOWN = 12
"""Columns that a sentence names."""
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
class Axis:
    """That a table is the log of one axis, whose units have to be named.

    Attributes:
        radius: of the arc as which a length is told, and the lever of a force, m.
        lever: whether somebody said that it is one of the machine, at which a force turns the axis; otherwise
            it is a scale alone, and an axis is told in angles and torques, or in lengths and forces.
        constant: what an ampere gives at the axis, N m/A, of a linear one N/A; None: a rig says it, or none.
    """

    radius: float = AXIS_RADIUS_M
    lever: bool = False
    constant: float | None = None

    def factor(self, unit: str, target: str) -> float | None:
        """To the SI unit ``target``, of an axis that moves along a line, too; None: it cannot be."""
        along = factor(unit, _ALONG_A_LINE.get(target, target))
        if not is_linear(unit, target) or along is None:
            return factor(unit, target)
        return along / self.radius if target == "rad" else along * self.radius


def is_linear(unit: str, target: str) -> bool:
    """Whether a unit of what is an angle (``rad``) or a torque (``N m``) is one of length, or of force."""
    return target in _ALONG_A_LINE and factor(unit, _ALONG_A_LINE[target]) is not None


def drawn_unit(unit: str, target: str) -> str:
    """The SI unit that ``unit`` is a multiple of: "m" or "N" of an axis along a line, else ``target``."""
    return _ALONG_A_LINE[target] if is_linear(unit, target) else target


@dataclass(frozen=True)
class _Wish:
    """One entry of a mapping as the user gave it."""

    column: int | str
    unit: str | None = None
    scale: float = 1.0


def map_columns(table: Table, mapping: str | None, axis: Axis | None = None) -> tuple[Column, ...]:
    """Which column of the table is which channel.

    Args:
        table: layout of the text file.
        mapping: None or ``auto`` (by header, or in the bench's own order where there is none and the
            number of columns fits), an inline text, or the path of a JSON or TOML file.
        axis: that it is the log of one axis; None: of the bench.

    Raises:
        UserError: the mapping cannot be understood or does not fit the file.
    """
    if mapping in AUTOMATIC:
        if axis is not None and not table.header:
            raise UserError(
                f"{table.path} has no header; say which column is which with --map, such as "
                "time=1:s,position=2:deg,torque=3:Nm."
            )
        columns = _by_header(table, axis) if table.header else _in_bench_order(table)
    else:
        wishes = _read_mapping(str(mapping))
        if axis is not None:
            wishes = {_AXIS_NAMES.get(channel, channel): wish for channel, wish in wishes.items()}
        columns = tuple(_wished(table, channel, wish, axis) for channel, wish in wishes.items())
    _refuse_twice(columns, table, axis)
    if axis is not None:
        _refuse_unnamed(columns, table)
        if not axis.lever:
            _refuse_mixed(columns, table)
    return columns


def words_of(table: Table) -> Mapping[int, str]:
    """Columns that hold words in place of numbers, by index, with one of their cells."""
    return table.words if isinstance(table, TextTable) else {}


def likely_columns(table: Table, axis: Axis | None = None) -> tuple[Column | None, ...]:
    """What each column of a table is likely to be, to start from where a person chooses; nothing is refused.

    By the header or in the bench's own order; None for a column of which nothing is known, whose unit does
    not fit, or that looks like one before it.
    """
    names: Sequence[str | None] = [None] * table.columns
    units: Sequence[str | None] = [None] * table.columns
    if table.header:
        parts = [_likely_parts(cell) if axis is None else _split_axis_header(cell) for cell in table.header]
        names = _channels_of(parts, words_of(table), axis)[0]
        units = [unit for _, unit in parts]
    elif table.columns == len(BENCH_ORDER) and axis is None:
        names = BENCH_ORDER
    found: list[Column | None] = []
    for index, name in enumerate(names):
        name = None if index in words_of(table) else name
        taken = [column.channel for column in found if column is not None]
        found.append(None)
        if name is not None and name not in taken:
            with suppress(UserError):
                found[-1] = _column(name, index, units[index], 1.0, "", table, axis)
    return tuple(found)


def _likely_parts(cell: str) -> tuple[str, str | None]:
    """Name and unit of a header; ``t_ms`` has its unit behind the name where that is a quantity's then."""
    name, unit = _split_axis_header(cell)
    return (name, unit) if _channel_of(name, 0, _KEYWORDS) in CHANNEL_UNITS else split_header(cell)


def units_of(channel: str, axis: Axis | None = None) -> tuple[str, ...]:
    """In which units a column of a channel may be, one spelling each; SI first; none for an unknown one."""
    target = CHANNEL_UNITS.get(channel)
    if target is None:
        return ()
    along_a_line = _ALONG_A_LINE.get(target) if axis is not None else None
    each = [FACTORS[target], *([FACTORS[along_a_line]] if along_a_line else [])]
    first: dict[tuple[int, float], str] = {}
    for number, table in enumerate(each):
        for unit, value in table.items():
            first.setdefault((number, value), unit)
    return tuple(first.values())


def _refuse_unnamed(columns: tuple[Column, ...], table: Table) -> None:
    """Nothing is assumed of the units of a machine that nobody here knows."""
    unnamed = [c for c in columns if not c.unit and c.target_unit]
    if not unnamed:
        return
    for channel in lacking(columns):
        raise UserError(axis_lacks(table, channel, columns))
    named = [f"'{c.channel}' (column {c.index + 1}{_unknown_ending(c, table)})" for c in unnamed]
    names = " and ".join((", ".join(named[:-1]), named[-1]) if len(named) > 1 else named)
    wanted = _mapping_text({c.channel: c for c in columns}, table)
    counts = _count_words(columns, table)
    raise UserError(f"{table.path} names no unit of {names}; say them, such as --map {wanted}{counts}.")


def _unknown_ending(column: Column, table: Table) -> str:
    """That a word stands at the end of a column's name, which may be its unit but is none that is known."""
    match = _TRAILING_UNIT.match(table.header[column.index].strip()) if table.header else None
    if match is None or match["unit"] in _NO_UNITS:
        return ""
    return f", '{shown(match['unit'], MOST_LETTERS)}' is no unit that is known"


def _refuse_mixed(columns: tuple[Column, ...], table: Table) -> None:
    """A force does not turn an axis but at a lever, and a torque moves nothing along a line without one."""
    motion = next((c for c in columns if c.channel == "motor_position"), None)
    for column in columns:
        if motion is None or column is motion or column.target_unit not in _ALONG_A_LINE:
            continue
        linear = is_linear(motion.unit, motion.target_unit)
        if is_linear(column.unit, column.target_unit) == linear:
            continue
        right = (_LINEAR_UNITS if linear else _USUAL_UNITS)[column.target_unit]
        raise UserError(
            f"{table.path} tells the position in {motion.unit} and '{column.channel}' (column "
            f"{column.index + 1}) in {column.unit}; of an axis that {'slides' if linear else 'turns'} it "
            f"should be in a unit such as {right}, or --radius should give the lever between the two in m."
        )


def lacking(columns: Sequence[Column]) -> list[str]:
    """Which channels the log of an axis needs beside time and lacks; a current does for a torque."""
    present = {column.channel for column in columns}
    present |= {"motor_torque"} if "motor_current" in present else set()
    return [name for name in ("motor_position", "motor_torque") if name not in present]


def unknown_names(columns: Sequence[Column], axis: Axis | None) -> str:
    """What a mapping calls columns that are no channel, and what it may, as a part of a sentence."""
    strange = [f"'{c.channel}'" for c in columns if c.channel not in CHANNEL_UNITS and "/" not in c.channel]
    if not strange:
        return ""
    known = CHANNEL_UNITS if axis is None else ("time", *_AXIS_NAMES)
    are = "is" if len(strange) == 1 else "are"
    return f"; {listed(strange)} in the mapping {are} none of {', '.join(known)}"


def axis_lacks(table: Table, channel: str, columns: Sequence[Column], misnamed: str = "") -> str:
    """The sentence about the log of an axis in which a channel was not found: what there is, and a mapping.

    Args:
        columns: those that were found. misnamed: what :func:`unknown_names` says of them.
    """
    usable = [k for k in range(table.columns) if k not in words_of(table)]
    named = [
        f"{k + 1} '{shown(table.header[k], MOST_LETTERS)}'" if table.header else str(k + 1) for k in usable
    ]
    have = ", ".join(named[:MOST_SHOWN]) + (", ..." if len(named) > MOST_SHOWN else "")
    found = {c.channel: c for c in columns if c.channel in CHANNEL_UNITS}
    taken = {c.index for c in found.values()}
    free, missing = [k for k in usable if k not in taken], list[str]()
    named_units = {c.index: c.unit for c in columns}
    for name in lacking(columns):
        fits = [
            (k, column) for k in free if (column := _may_be(table, k, name, named_units.get(k))) is not None
        ]
        if fits:
            free.remove(fits[0][0])
            found[fits[0][1].channel] = fits[0][1]
        else:
            missing.append(name)
    wanted = _mapping_text(found, table, missing)
    told_otherwise = table.header is not None and any(
        _passed_over(*_split_axis_header(table.header[k]), "") for k in free
    )
    end = (", N being its column" if missing else "") + _count_words(found.values(), table)
    end += _own_unit_words(missing) if missing and told_otherwise else ""
    what = f"{short_name(channel)}{' and no current' if channel == 'motor_torque' else ''}"
    return (
        f"{table.path} gives no {what}, which the log of an axis needs{misnamed}; it has the columns "
        f"{have}: say which is which, such as --map {wanted}{end}."
    )


def _own_unit_words(missing: Sequence[str]) -> str:
    """How a column is mapped whose unit is of another kind, such as volts for a torque."""
    usual = _USUAL_UNITS[CHANNEL_UNITS[missing[-1]]]
    return f"; a unit of another kind takes a factor behind a known one, such as {usual}:{_OWN_FACTOR:g}"


def _may_be(table: Table, index: int, channel: str, unit: str | None) -> Column | None:
    """A column as a channel that its header does not name; None where its unit is of something else."""
    unit = unit or (_split_axis_header(table.header[index])[1] if table.header else None)
    for name in (channel, *(("motor_current",) if channel == "motor_torque" else ())):
        target = CHANNEL_UNITS[name]
        if not unit or Axis().factor(unit, target) is not None:
            return Column(name, index, unit or "", target, 1.0, "")
    return None


def _mapping_text(found: Mapping[str, Column], table: Table, missing: Sequence[str] = ()) -> str:
    """Columns as ``--map`` takes them, by their channels' short names, with usual units where none is named.

    Args:
        missing: channels whose column is not known, ``N``.
    """
    known = [c for c in found.values() if c.channel in CHANNEL_UNITS and c.target_unit in _USUAL_UNITS]
    told = [is_linear(c.unit, c.target_unit) for c in known if c.unit and c.target_unit in _ALONG_A_LINE]
    likely = [_LINEAR_WORDS.search(table.header[c.index].lower()) for c in known if table.header]
    units = _LINEAR_UNITS if (told[0] if told else any(likely)) else _USUAL_UNITS
    parts = [f"{short_name(c.channel)}={c.index + 1}:{_unit_text(c, units, table)}" for c in known]
    places = [c.index for c in known]
    parts = [part for _, part in sorted(zip(places, parts, strict=True))]
    parts += [f"{short_name(name)}=N:{units[CHANNEL_UNITS[name]]}" for name in missing]
    text = ",".join(parts)
    return f'"{text}"' if re.search(r"[^\w=:,.]", text) else text


def _unit_text(column: Column, units: Mapping[str, str], table: Table) -> str:
    """The unit of a column as a mapping has it; of counts what one of them is, as an example."""
    if not _is_counted(column, table):
        return column.unit or units[column.target_unit]
    place = "mm" if units is _LINEAR_UNITS else "rad"
    return f"{place}:{_OWN_FACTOR:g}"


def _is_counted(column: Column, table: Table) -> bool:
    header = table.header[column.index].lower().replace("_", " ") if table.header else ""
    return not column.unit and column.target_unit == "rad" and _COUNTS.search(header) is not None


def _count_words(columns: Iterable[Column], table: Table) -> str:
    """That a factor of a mapping is an example, behind it; empty where no column is of counts."""
    if not any(_is_counted(c, table) for c in columns):
        return ""
    return f", {_OWN_FACTOR:g} being what one count of the encoder is; put in that of yours"


def short_name(channel: str) -> str:
    """What a mapping may call a channel of an axis."""
    return {of: name for name, of in _AXIS_NAMES.items()}.get(channel, channel)


def _in_bench_order(table: Table) -> tuple[Column, ...]:
    if table.columns != len(BENCH_ORDER):
        raise UserError(
            f"{table.path} has no header and {table.columns} columns; say which is which with --map, "
            "such as time=1,motor_command=2:deg (the bench's own order has seven)."
        )
    return tuple(
        _column(name, index, None, 1.0, "the bench's order", table, None)
        for index, name in enumerate(BENCH_ORDER)
        if index not in words_of(table)
    )


def _by_header(table: Table, axis: Axis | None) -> tuple[Column, ...]:
    assert table.header is not None
    parts = [split_header(cell) if axis is None else _split_axis_header(cell) for cell in table.header]
    channels, doubtful = _channels_of(parts, words_of(table), axis)
    columns = tuple(
        _column(
            channels[index],
            index,
            parts[index][1],
            1.0,
            f"header '{cell}'{'' if axis is None else _passed_over(*parts[index], channels[index])}",
            table,
            axis,
        )
        for index, cell in enumerate(table.header)
        if index not in words_of(table)
    )
    for channel, places in doubtful.items():
        named = [f"{k + 1} '{shown(table.header[k], MOST_LETTERS)}'" for k in places]
        found = {c.channel: c for c in columns if c.index not in places}
        first = _may_be(table, places[0], channel, None)
        found |= {} if first is None else {first.channel: first}
        raise UserError(
            f"{table.path}: columns {', '.join(named[:-1])} and {named[-1]} may each be the "
            f"{short_name(channel)}; say which is which, such as --map {_mapping_text(found, table)}"
            f"{_count_words(found.values(), table)}."
        )
    return columns


def _passed_over(name: str, unit: str | None, taken_as: str) -> str:
    """That a column of an axis is not what its name says, for its unit is of something else; empty: it is."""
    said = _channel_of(name, 0, _AXIS_KEYWORDS)
    if said == taken_as or not unit or said not in CHANNEL_UNITS or not _is_of_another_kind(unit, said):
        return ""
    return f"; no {short_name(said)}, for that is not told in {unit}"


def _channels_of(
    parts: Sequence[tuple[str, str | None]], words: Mapping[int, str], axis: Axis | None
) -> tuple[list[str], dict[str, list[int]]]:
    """The channel of each column by its name and unit, and what of an axis several columns may be.

    ``T`` is a torque where its unit or another column, which is plainly the time, says so. What an axis needs
    and no name tells is the only column whose unit, or whose letter, allows it.

    Args:
        parts: name and unit of each header. words: columns that hold no numbers.
    """
    keywords = _KEYWORDS if axis is None else _AXIS_KEYWORDS
    found = [_channel_of(name, k, keywords) for k, (name, _) in enumerate(parts)]
    counts_time = any(
        channel == "time" and parts[k][0] != "T" and k not in words for k, channel in enumerate(found)
    )
    for k, (name, unit) in enumerate(parts):
        if name == "T" and (not _may_mean(unit, "time") if unit else counts_time):
            found[k] = name.lower()
    doubtful: dict[str, list[int]] = {}
    if axis is None:
        return found, doubtful
    for k, (name, unit) in enumerate(parts):
        if unit and found[k] in CHANNEL_UNITS and _is_of_another_kind(unit, found[k]):
            own = _own_name(name, k)
            found[k] = own if own not in CHANNEL_UNITS else found[k]
    for channel in _GUESSED:
        one_of = _EITHER if channel in _EITHER else (channel,)
        if any(other in one_of for k, other in enumerate(found) if k not in words):
            continue
        free = [k for k, other in enumerate(found) if other not in CHANNEL_UNITS and k not in words]
        told = [k for k in free if (unit := parts[k][1]) and _may_mean(unit, channel)]
        lettered = [
            k
            for k in free
            for meant, letters in _AXIS_SYMBOLS
            if meant == channel and letters.match(parts[k][0]) and (k in told or not parts[k][1])
        ]
        both = [k for k in told if k in lettered]
        chosen = next((some for some in (both, told, lettered) if some), [])
        if len(chosen) == 1:
            found[chosen[0]] = channel
        elif chosen and channel in ("motor_position", "motor_torque"):
            doubtful[channel] = chosen
    return found, doubtful


def _may_mean(unit: str, channel: str) -> bool:
    """Whether a quantity of an axis may be in this unit."""
    return Axis().factor(unit, CHANNEL_UNITS[channel]) is not None


def _is_of_another_kind(unit: str, channel: str) -> bool:
    """Whether a unit is known, and none of what an axis' quantity may be told in."""
    return any(unit in table for table in FACTORS.values()) and not _may_mean(unit, channel)


def split_header(cell: str) -> tuple[str, str | None]:
    match = _HEADER_UNIT.match(cell)
    if match is None:
        return cell.strip(), None
    unit = match["a"] if match["a"] is not None else match["b"] if match["b"] is not None else match["c"]
    return match["name"].strip(), unit.strip()


def _split_axis_header(cell: str) -> tuple[str, str | None]:
    """The same with a unit behind the name, too, as in ``q_deg`` or ``current_mA``."""
    name, unit = split_header(cell)
    two = _TWO_WORDS.match(name) if unit is None else None
    if two is not None and f"{two['first']} {two['second']}" in FACTORS["N m"]:
        return two["name"], f"{two['first']} {two['second']}"
    match = _TRAILING_UNIT.match(name) if unit is None else None
    if match is None or match["unit"] in _NO_UNITS:
        return name, unit
    known = any(match["unit"] in FACTORS[si] for si in (*_USUAL_UNITS, "N", "m"))
    return (match["name"], match["unit"]) if known else (name, None)


def _channel_of(name: str, index: int, keywords: Sequence[tuple[str, str]]) -> str:
    """The channel that a header's name means; a name of its own for quantities that the bench lacks."""
    if name in CHANNEL_UNITS or (_CHANNEL_NAME.fullmatch(name) and name.startswith("raw/")):
        return name
    lowered = name.lower().replace("_", " ")
    for channel, pattern in keywords:
        if re.search(pattern, lowered):
            return channel
    return _own_name(name, index)


def _own_name(name: str, index: int) -> str:
    """What a column is called in the session that is none of its channels."""
    cleaned = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower()
    return cleaned if cleaned and not cleaned[0].isdigit() else f"column_{index + 1}"


def _wished(table: Table, channel: str, wish: _Wish, axis: Axis | None) -> Column:
    if not _CHANNEL_NAME.fullmatch(channel):
        raise UserError(f"The mapping names the channel {channel!r}; a name is of letters, digits and _.")
    column, unit = wish.column, wish.unit
    if isinstance(column, str) and column.isdecimal():
        column = int(column)
    if isinstance(column, str):
        index, source = _find_header(table, channel, column), f"header '{column}'"
    else:
        index, source = column - 1, f"column {column}"
        if not 0 <= index < table.columns:
            raise UserError(
                f"The mapping takes '{channel}' from column {column}, but {table.path} has columns 1 to "
                f"{table.columns}."
            )
    if index in words_of(table):
        held = words_of(table)[index]
        raise UserError(
            f"The mapping takes '{channel}' from column {index + 1}, but in {table.path} that holds "
            f"{repr(shown(held, MOST_LETTERS)) if held else 'nothing'} where numbers should be; name another."
        )
    if unit is None and table.header:
        unit = (split_header if axis is None else _split_axis_header)(table.header[index])[1]
    return _column(channel, index, unit, wish.scale, source, table, axis)


def _find_header(table: Table, channel: str, wanted: str) -> int:
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
    channel: str, index: int, unit: str | None, scale: float, source: str, table: Table, axis: Axis | None
) -> Column:
    target = CHANNEL_UNITS.get(channel)
    if target is None:
        return Column(channel, index, unit or "", unit or "", scale, source)
    if not unit and axis is not None:
        return Column(channel, index, "", target, scale, source)
    if not unit:
        unit = _ASSUMED_UNIT.get(target, target)
        source += ", unit assumed"
    times = factor(unit, target) if axis is None else axis.factor(unit, target)
    if times is None:
        along_a_line = FACTORS[_ALONG_A_LINE[target]] if axis is not None and target in _ALONG_A_LINE else {}
        usual, name = target.replace(" ", ""), channel if axis is None else short_name(channel)
        raise UserError(
            f"{table.path}, column {index + 1} is taken as '{channel}' in '{unit}'; it should be in one of "
            f"{', '.join([*FACTORS[target], *along_a_line])}; any other takes a factor to one of them, such "
            f"as {name}={index + 1}:{usual}:{_OWN_FACTOR:g} where one '{shown(unit, MOST_LETTERS)}' is "
            f"{_OWN_FACTOR:g} {usual}."
        )
    return Column(channel, index, unit, target, times * scale, source)


def _refuse_twice(columns: tuple[Column, ...], table: Table, axis: Axis | None) -> None:
    seen: dict[str, Column] = {}
    for column in columns:
        other = seen.setdefault(column.channel, column)
        if other is not column:
            firsts = {c.channel: c for c in reversed(columns)}
            such = "with --map" if axis is None else f"such as --map {_mapping_text(firsts, table)}"
            such += "" if axis is None else _count_words(firsts.values(), table)
            raise UserError(
                f"{table.path}: columns {other.index + 1} and {column.index + 1} both look like "
                f"'{column.channel}'; say which is which{',' if axis else ''} {such}."
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

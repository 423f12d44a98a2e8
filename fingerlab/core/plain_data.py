"""Plain data of JSON and TOML files: read as dataclasses, each value of its field's type.

msgspec decides what is of which type; what it does not do is done here: sections that leave something out
have the default of their field, whole numbers may be written with a point, numbers are finite, unknown names
can be refused, and what does not fit is told with its name, its value and what would be right.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Any, TypeGuard, TypeVar, get_args, get_type_hints

import msgspec
import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.text import shown

T = TypeVar("T")

WANTED = {
    "float": "a finite number",
    "int": "a whole number",
    "str": "text in quotes",
    "bool": "true or false",
    "object": "a section",
    "array": "a list",
}
"""What the types of a file's values are called."""

_AT = re.compile(r"(?P<what>.*?)(?: - at `\$\.?(?P<place>.*)`)?")
_EXPECTED = re.compile(r"Expected `(\w+)")
_MISSING = re.compile(r"Object missing required field `(\w+)`")


class Mismatch(ValueError):
    """Data that is not what it should be; the text is the rest of a sentence, without a full stop.

    Attributes:
        place: names that lead to the value. wanted: what ``value`` should be; empty without one.
    """

    def __init__(self, place: tuple[str, ...], says: str, wanted: str = "", value: object = None) -> None:
        super().__init__(" ".join((*place, says)))
        self.place, self.wanted, self.value = place, wanted, value


MOST_TEXT = 1 << 24
"""Letters of a text that is read as JSON; the points of the longest trajectory take a quarter."""
MOST_TOML = 1 << 18
"""The same of TOML, which a person keeps and whose reader takes its time: a rig file has some 6000."""
MOST_LEVELS = 32
MOST_DIGITS = 300
"""Digits that still are a number of double precision."""


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether it is a finite number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def parsed(text: object, toml: bool = False) -> Any:
    """JSON (or TOML) text as plain data: text that can be shown and written, bounded in every way.

    Numbers of JSON are finite; TOML has words for others, and who reads one says where it stands.

    Raises:
        ValueError: it is anything else; the text is a few words without a full stop.
    """
    if not isinstance(text, str):
        raise ValueError("it is no text")
    if len(text) > (MOST_TOML if toml else MOST_TEXT):
        raise ValueError(f"it has {len(text)} letters")
    try:
        data = tomllib.loads(text) if toml else json.loads(text, parse_int=_whole_number)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise ValueError(
            "it is empty" if not text.strip() else f"it cannot be read from {place} on"
        ) from None
    level = [data]
    for _ in range(MOST_LEVELS):
        level = [item for value in level for item in _inside(value, toml)]
        if not level:
            return data
    raise ValueError("it is nested too deep")


def _whole_number(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"it holds a number of {len(digits)} digits")
    return int(digits)


def _inside(value: object, toml: bool) -> Iterable[object]:
    """What a list or section holds; nothing for a value that can be kept.

    Raises:
        ValueError: it cannot.
    """
    if isinstance(value, dict):
        return (*value, *value.values())
    if isinstance(value, list):
        return value
    if isinstance(value, str):
        if shown(value) != value:
            raise ValueError("it holds characters that are no text")
    elif isinstance(value, float):
        if not (toml or math.isfinite(value)):
            raise ValueError(f"it holds the number {value}")
    elif isinstance(value, int):
        if value.bit_length() > MOST_DIGITS * 3:
            raise ValueError("it holds a number of too many digits")
    elif value is not None:
        raise ValueError(f"it holds {value}, a time; write that in quotes")
    return ()


def read_object(text: object, where: str, advice: str, toml: bool = False) -> dict[str, Any]:
    """The named values of JSON (or TOML) text.

    Args:
        where: opens the sentence of an error. advice: what would be right; ends it, without a full stop.

    Raises:
        UserError: the text is anything else.
    """
    kind = "TOML" if toml else "JSON"
    try:
        data = parsed(text, toml)
    except ValueError as error:
        raise UserError(f"{where} is not {kind} ({shown(str(error), MOST_REASON)}); {advice}.") from None
    if not isinstance(data, dict):
        raise UserError(f"{where} is not a {kind} object; {advice}.")
    return data


MOST_REASON = 200
"""Letters of what a library says of a file."""


def structured(kind: type[T], data: object, refuse_unknown: bool = False) -> T:
    """Plain data as the dataclass ``kind``.

    Args:
        data: what ``json.loads`` or ``tomllib.loads`` gave.
        refuse_unknown: whether a name that ``kind`` does not have is an error; else it is left out.

    Raises:
        Mismatch: a value is missing, unknown, of the wrong type, or no finite number.
    """
    plain = _prepared(kind, data, (), refuse_unknown)
    try:
        found = msgspec.convert(plain, kind)
    except msgspec.ValidationError as error:
        raise _mismatch(str(error), plain, kind) from None
    whole: T = _whole(found, ())
    return whole


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _prepared(kind: Any, data: object, place: tuple[str, ...], refuse_unknown: bool) -> dict[str, Any]:
    known = {spec.name: spec for spec in fields(kind)}
    if not isinstance(data, Mapping):
        raise Mismatch(place, f"is not a section; it should hold {', '.join(known)}", WANTED["object"])
    result, hints = {}, _hints(kind)
    for name, value in data.items():
        if name not in known:
            if refuse_unknown:
                raise Mismatch(place, f"holds the unknown '{name}'; it knows {', '.join(known)}")
            continue
        hint, default = hints[name], known[name].default
        if isinstance(hint, type) and is_dataclass(hint):
            usual = {} if default is MISSING else vars(default)
            value = {**usual, **_prepared(hint, value, (*place, name), refuse_unknown)}
        elif hint is int and isinstance(value, float) and value.is_integer():
            value = int(value)
        result[name] = value
    return result


def _mismatch(error: str, data: object, kind: Any) -> Mismatch:
    """The same as msgspec says, with the value that it does not name."""
    at = _AT.fullmatch(error)
    assert at is not None
    place = tuple(re.findall(r"[^.\[\]]+", at["place"] or ""))
    missing = _MISSING.match(at["what"])
    if missing is not None:
        return Mismatch(place, f"lacks '{missing[1]}'")
    for name in place:
        if isinstance(data, Mapping):
            data = data.get(name)
            hints: dict[str, Any] = _hints(kind) if isinstance(kind, type) and is_dataclass(kind) else {}
            kind = hints.get(name)
        elif isinstance(data, (list, tuple)) and name.isdecimal():
            data, kind = data[int(name)], None
    expected = _EXPECTED.match(at["what"])
    if expected is not None:
        wanted = WANTED.get(expected[1], expected[1])
    else:  # one of several words or numbers
        wanted = f"one of {', '.join(map(str, get_args(kind)))}"
    return Mismatch(place, f"is {shown(repr(data), MOST_REASON)}; it should be {wanted}", wanted, data)


def _whole(found: Any, place: tuple[str, ...]) -> Any:
    """The same, made by its own constructor: msgspec leaves a default to the class, where ``vars`` has none.

    Raises:
        Mismatch: a number is not finite.
    """
    values = {}
    for spec in fields(found):
        value, here = getattr(found, spec.name), (*place, spec.name)
        if isinstance(value, float) and not math.isfinite(value):
            raise Mismatch(here, f"is {value!r}; it should be {WANTED['float']}", WANTED["float"], value)
        values[spec.name] = _whole(value, here) if is_dataclass(value) else value
    return type(found)(**values)


def json_ready(value: Any, unknown: Callable[[Any], Any] = lambda value: value) -> Any:
    """The same as JSON can hold it: no number that is not finite, lists for tuples, text for keys.

    Args:
        unknown: what becomes of anything else; as it is, ``json.dumps`` refuses it.
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): json_ready(item, unknown) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(item, unknown) for item in value]
    if isinstance(value, np.generic):
        return json_ready(value.item(), unknown)
    return value if value is None or isinstance(value, (str, int)) else unknown(value)

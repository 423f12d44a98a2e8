"""Where two goldens differ: to the last bit, or beyond a relative tolerance."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

LONGEST = 100
"""Characters of a value that are shown."""


@dataclass(frozen=True)
class Difference:
    """One value: its place, what was stored, what there is now, and their relative difference, if numbers."""

    place: str
    stored: str
    now: str
    relative: float | None = None

    def line(self) -> str:
        """In one line."""
        size = "" if self.relative is None else f"  (relative {self.relative:.2e})"
        return f"{self.place}: {self.stored} -> {self.now}{size}"


def differences(
    stored: Any, now: Any, tolerance: float = 0.0, but_for: Sequence[str] = ()
) -> list[Difference]:
    """All values that differ, in the order of the stored ones.

    Args:
        tolerance: relative difference of two numbers that passes; 0 asks for equal bits.
        but_for: patterns of places, such as ``*.printed*``, that are passed over.
    """
    found = _walk("", stored, now, tolerance)
    return [d for d in found if not any(fnmatchcase(d.place, pattern) for pattern in but_for)]


def _walk(place: str, stored: Any, now: Any, tolerance: float) -> Iterator[Difference]:
    if isinstance(stored, dict) and isinstance(now, dict):
        for key in [*stored, *(k for k in now if k not in stored)]:
            where = f"{place}.{key}" if place else str(key)
            if key not in now:
                yield Difference(where, _short(stored[key]), "is missing")
            elif key not in stored:
                yield Difference(where, "was not there", _short(now[key]))
            else:
                yield from _walk(where, stored[key], now[key], tolerance)
    elif isinstance(stored, list) and isinstance(now, list):
        for number, (one, other) in enumerate(zip(stored, now, strict=False)):
            yield from _walk(f"{place}[{number}]", one, other, tolerance)
        if len(stored) != len(now):
            yield Difference(f"{place}.length", str(len(stored)), str(len(now)))
    elif isinstance(stored, float) and isinstance(now, float):
        relative = _relative(stored, now)
        # Beyond zero tolerance 0.0 and -0.0 are alike, and a NaN is no further from a NaN.
        if _bits(stored) != _bits(now) and (tolerance == 0.0 or relative > tolerance):
            yield Difference(place, repr(stored), repr(now), relative)
    elif type(stored) is not type(now) or stored != now:
        yield Difference(place, _short(stored), _short(now))


def _bits(value: float) -> bytes:
    return struct.pack("<d", value)


def _relative(one: float, other: float) -> float:
    """Difference over the larger size; infinite where one of them is no number."""
    if not (math.isfinite(one) and math.isfinite(other)):
        return math.inf
    size = max(abs(one), abs(other))
    return abs(one - other) / size if size else 0.0


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."

"""What is followed over sessions: trends, and the strength of an effect in each, found there or not.

A session in whose last model an effect stands tells its strength in that model. One whose model needs
nothing tells the strength of the effect fitted alone. One whose model holds others, and needs no more, tells
that there is none of it, to within the interval of the effect fitted alone: what it would take up by itself
belongs to the others. One that cannot tell the effect from those of its model tells nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from fingerlab.batch.laws import Prior
from fingerlab.batch.table import Row, is_delay, number_of, recorded_at
from fingerlab.core.text import LEVEL
from fingerlab.diagnosis.equations.coefficients import DELAY
from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.settings import Z90
from fingerlab.effects import CATALOGUE, find_effect
from fingerlab.effects.base import FAMILIES
from fingerlab.physics.parameter import Parameter
from fingerlab.rig.file import default_rig
from fingerlab.sessions.model import Array


def model_of(row: Row) -> tuple[str, ...]:
    """Effects of the last model of a session."""
    return tuple(row.get("final_model") or ())


def found_effects(rows: Sequence[Row]) -> list[str]:
    """Effects that were found in any session, by id."""
    return sorted({str(name) for row in rows for name in model_of(row)})


def effect_of(column: str) -> str:
    """The effect whose strength a column holds; empty: none's."""
    kind, _, rest = column.partition(".")
    if kind == "alone" or (kind == "param" and "." in rest):
        return rest.partition(".")[0]
    return ""


def strength_columns(effect: str, rows: Sequence[Row]) -> list[str]:
    """Columns that hold how strong an effect is, in rows of :func:`with_strengths`."""
    if is_delay(effect):  # followed as it is fitted alone: nothing else takes it up
        names = {f"alone.{effect}.{DELAY}"}
    else:
        start = f"param.{effect}."
        names = {name for row in rows for name in row if name.startswith(start)}
        one = find_effect(effect)
        if one is not None:
            names = {name for name in names if name.removeprefix(start) in one.gains}
    return sorted(n for n in names if not n.endswith((".low", ".high")) and any(n in row for row in rows))


def with_strengths(rows: Iterable[Row]) -> list[Row]:
    """The rows with ``param.EFFECT.GAIN`` in every session that tells it, for effects found in any."""
    every = list(rows)
    wanted = {
        name.removesuffix(".low"): None
        for row in every
        for name in row
        if name.startswith("param.") and name.endswith(".low") and effect_of(name.removesuffix(".low"))
    }
    return [{**row, **dict(_filled(row, wanted))} for row in every]


def _filled(row: Row, columns: Iterable[str]) -> Iterator[tuple[str, float]]:
    model = model_of(row)
    for column in columns:
        effect = effect_of(column)
        alone = f"alone.{effect}.{column.rpartition('.')[2]}"
        if effect in model or column in row or alone not in row:
            continue
        if not model:
            yield from ((column + end, number_of(row.get(alone + end))) for end in ("", ".low", ".high"))
        elif effect not in (row.get("set") or ()):
            half = Z90 * error_of(row, alone)
            yield from ((column, 0.0), (column + ".low", -half), (column + ".high", half))


def error_of(row: Row, column: str) -> float:
    """Standard error of a number from its 90 % interval, of which a bound may cut one side; NaN: unknown."""
    value, low, high = (number_of(row.get(column + end)) for end in ("", ".low", ".high"))
    half = max(high - value, value - low)
    return half / Z90 if math.isfinite(half) and half > 0 else math.nan


def series(rows: Sequence[Row], column: str) -> tuple[list[int], Array, Array]:
    """Places among the rows of those that have a number, and its values and errors there, (k,)."""
    values = np.array([number_of(row.get(column)) for row in rows])
    known = [int(i) for i in np.flatnonzero(np.isfinite(values))]
    return known, values[known], np.array([error_of(rows[i], column) for i in known])


def prior_of(column: str, values: Array, change: float = 0.5) -> Prior:
    """What is known of a column's number beforehand: where it is usually, and what of it would matter.

    From the effect's own parameters or those that every model carries; what is in neither has the size of
    its ``values``.
    """
    effect, name = effect_of(column), column.rpartition(".")[2]
    one = _parameter(effect, name)
    if one is None:
        return Prior(0.0, float(np.max(np.abs(values), initial=0.0)) or 1.0, False, change)
    return Prior(one.default, one.typical, bool(effect), change)


@cache
def _every_model() -> dict[str, Parameter]:
    return dict(nuisance_ranges(default_rig()))


def _parameter(effect: str, name: str) -> Parameter | None:
    if not effect:
        ranges = _every_model()
        return ranges.get(name.partition("@")[0])
    known = find_effect(effect)
    return None if known is None else known.unknowns.get(name)


FOLLOWED_EFFECTS = sorted(
    (one for one in CATALOGUE.values() if one.followed),
    key=lambda one: (FAMILIES.index(one.family), one.title),
)
"""Those whose strength is followed over time, found missing or not, as a reader looks for them."""
DAYS_A_MONTH = 365.25 / 12
LEAST_TIMES = 4
"""All slopes agree by chance one time in three with three points, one in twelve with four."""
LEAST_DAYS = 1.0
"""Within a day a bench warms up; what that would be a month, thirty times as far away, says nothing of it."""
FOLLOWED = ("score", "final_score")
FOLLOWED_PARAMETERS = (
    "param.arm_mcp", "param.arm_pip", *(f"alone.{one.id}." for one in FOLLOWED_EFFECTS), "param.loss_mcp",
    "param.loss_pip", "param.offset", "param.bench_gain", "param.bench_offset",
)  # fmt: skip
"""Columns that are followed over time, by how their names begin: arms, friction, delay, losses, offset."""


@dataclass(frozen=True)
class Trend:
    """A quantity over time. ``median`` and ``per_month`` with its 90 % interval are in ``unit`` (a month).

    Without a slope, all three NaN, where its sessions lie within a day.
    """

    column: str
    unit: str
    median: float
    per_month: float
    low: float
    high: float
    sessions: int

    @property
    def changes(self) -> bool:
        """Whether the interval leaves out zero; of ten quantities that do not change, one does by chance."""
        return self.low > 0 or self.high < 0


def ageing_rows(rows: Sequence[Row]) -> list[Row]:
    """Sessions that were diagnosed and know their time, in its order; a copy of a file counts once."""
    timed: dict[str, tuple[float, Row]] = {}
    for row in rows:
        when = recorded_at(row.get("created"))
        if when is not None and not row.get("error"):
            timed.setdefault(str(row["sha256"]), (when.timestamp(), row))
    return [row for _, row in sorted(timed.values(), key=lambda pair: pair[0])]


def followed_columns(rows: Sequence[Row]) -> list[str]:
    """The followed columns that the rows have, in the order in which a person reads them."""
    names = sorted({name for row in rows for name in row})
    found = list(FOLLOWED)
    for start in FOLLOWED_PARAMETERS:
        found += [n for n in names if n.startswith(start) and not n.endswith((".low", ".high"))]
    return found


def trends(rows: Sequence[Row], units: Mapping[str, str]) -> list[Trend]:
    """The trend of every followed quantity that enough sessions have; see :func:`trend`."""
    usable = ageing_rows(rows)
    days = days_of(usable)
    result = []
    for column in followed_columns(usable):
        values = np.array([number_of(row.get(column)) for row in usable])
        known = np.isfinite(values)
        found = trend(days[known], values[known])
        if found is not None:
            span = float(np.ptp(days[known]))
            slope, low, high = found if span >= LEAST_DAYS else (math.nan,) * 3
            median, count = float(np.median(values[known])), int(known.sum())
            result.append(Trend(column, units.get(column, "1"), median, slope, low, high, count))
    return result


def trend(days: Array, values: Array) -> tuple[float, float, float] | None:
    """Theil-Sen slope per month with its 90 % interval; None for fewer than four different times.

    The median of the slopes of all pairs: a few sessions that went wrong do not turn it. Source: Sen 1968.

    Args:
        days: time of recording, shape (n,). values: shape (n,).
    """
    if len(set(days.tolist())) < LEAST_TIMES:
        return None
    from scipy.stats import theilslopes

    slope, _, low, high = theilslopes(values, days / DAYS_A_MONTH, alpha=LEVEL)
    return float(slope), float(low), float(high)


def days_of(rows: Sequence[Row]) -> Array:
    """Days since 1970 at which sessions of :func:`ageing_rows` were recorded, (n,)."""
    times = [recorded_at(row["created"]) for row in rows]
    return np.array([when.timestamp() / 86400.0 for when in times if when is not None])

"""How the bench ages: scores and parameters over the time of recording, with robust trends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.batch.rows import ALONE, Row, recorded_at
from fingerlab.sessions.model import Array

DAYS_A_MONTH = 365.25 / 12
LEAST_TIMES = 4
"""All slopes agree by chance one time in three with three points, one in twelve with four."""
CONFIDENCE = 0.9

FOLLOWED = ("score", "final_score")
FOLLOWED_PARAMETERS = (
    "param.arm_mcp", "param.arm_pip", *(f"alone.{effect}." for effect in ALONE), "param.loss_mcp",
    "param.loss_pip", "param.offset", "param.bench_gain", "param.bench_offset",
)  # fmt: skip
"""Columns that are followed over time, by how their names begin: arms, friction, delay, losses, offset."""


@dataclass(frozen=True)
class Trend:
    """A quantity over time. ``median`` and ``per_month`` with its 90 % interval are in ``unit`` (a month)."""

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
    days = np.array([_days(row) for row in usable])
    result = []
    for column in followed_columns(usable):
        values = np.array([_number(row.get(column)) for row in usable])
        known = np.isfinite(values)
        found = trend(days[known], values[known])
        if found is not None:
            slope, low, high = found
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

    slope, _, low, high = theilslopes(values, days / DAYS_A_MONTH, alpha=CONFIDENCE)
    return float(slope), float(low), float(high)


def _days(row: Row) -> float:
    when = recorded_at(row["created"])
    assert when is not None  # ageing_rows lets no other through
    return when.timestamp() / 86400.0


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) else math.nan

"""Two benches, or two groups of sessions of one: which effects they share.

For every effect that was found in any session of either: both have it alike, both of another strength, the
first alone, the second alone, or neither (it was found, but its strength is compatible with none). Each gain
of the effect has a strength on each bench; the sessions scatter about it (``laws.py``). The evidence of all
five is in closed form for a given scatter and size of the prior, over which it is summed; that of several
gains is multiplied. Effects without a gain that is zero where the effect is absent are told by counting.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch

import numpy as np

from fingerlab.batch.followed import (
    ageing_rows,
    found_effects,
    model_of,
    prior_of,
    series,
    strength_columns,
    with_strengths,
)
from fingerlab.batch.laws import Estimate, possible_errors, quantiles
from fingerlab.batch.settings import BETWEEN, BEYOND, SIZES
from fingerlab.batch.table import Row
from fingerlab.core.errors import UserError
from fingerlab.core.text import ParameterEstimate
from fingerlab.sessions.model import Array

LEAST_EACH = 1
"""Sessions of each bench that tell a strength."""


@dataclass(frozen=True)
class BenchSessions:
    """Sessions of one bench: the name it was given, and its rows in order of time."""

    name: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class StrengthOnTwo:
    """One gain of an effect on both benches; ``second_less_first`` is how far they are apart."""

    column: str
    first: ParameterEstimate
    second: ParameterEstimate
    second_less_first: ParameterEstimate


@dataclass(frozen=True)
class SharedEffect:
    """An effect on two benches.

    Attributes:
        effect: id. chances: of "same", "differs", "first", "second", "neither", together 1; empty: its
            strength is not known on both, and only the counts tell.
        found: sessions with it in their last model and all sessions, of the first bench and of the second.
        strengths: of each gain.
    """

    effect: str
    chances: Mapping[str, float]
    found: tuple[int, int, int, int]
    strengths: tuple[StrengthOnTwo, ...]

    @property
    def likeliest(self) -> str:
        """Of the five; empty without a probability."""
        return max(self.chances, key=lambda kind: self.chances[kind]) if self.chances else ""


def group_of(rows: Sequence[Row], name: str) -> BenchSessions:
    """The sessions of a folder below that of the batch, or whose names fit a pattern such as ``left-*``.

    Raises:
        UserError: there is none with a verdict and a time.
    """
    start = name.strip("/").replace("\\", "/")
    usable = ageing_rows(rows)
    inside = [row for row in usable if str(row["session"]).startswith(f"{start}/")]
    fitting = inside or [row for row in usable if fnmatch(str(row["session"]), start)]
    if not fitting:
        raise UserError(
            f"No session with a verdict and a time is in {name!r}; give a folder below that of the batch, or "
            "a pattern of names such as 'left-*'."
        )
    return BenchSessions(name, tuple(fitting))


def two_groups(rows: Sequence[Row], first: str, second: str) -> tuple[BenchSessions, BenchSessions]:
    """Both groups of a comparison.

    Raises:
        UserError: one is empty, or a session is in both.
    """
    one, other = group_of(rows, first), group_of(rows, second)
    both = {str(row["session"]) for row in one.rows} & {str(row["session"]) for row in other.rows}
    if both:
        raise UserError(f"{min(both)} is in both {first!r} and {second!r}; a session is of one bench.")
    return one, other


def folders_of(rows: Sequence[Row]) -> list[str]:
    """Folders directly below that of the batch which hold sessions with a verdict and a time."""
    names = {str(row["session"]).partition("/")[0] for row in ageing_rows(rows) if "/" in str(row["session"])}
    return sorted(names)


def shared_effects(
    first: BenchSessions, second: BenchSessions, units: Mapping[str, str]
) -> list[SharedEffect]:
    """Every effect that was found on either bench, those that both have first, then by its id."""
    count = len(first.rows)
    rows = with_strengths([*first.rows, *second.rows])
    shared = [_shared(effect, rows[:count], rows[count:], units) for effect in found_effects(rows)]
    order = ("same", "differs", "first", "second", "neither", "")
    return sorted(shared, key=lambda one: (order.index(one.likeliest), one.effect))


def _shared(
    effect: str, first: Sequence[Row], second: Sequence[Row], units: Mapping[str, str]
) -> SharedEffect:
    found = tuple(sum(effect in model_of(row) for row in rows) for rows in (first, second))
    counts = found[0], len(first), found[1], len(second)
    weights, strengths = dict.fromkeys(BETWEEN, 0.0), []
    for column in strength_columns(effect, [*first, *second]):
        sides = series(first, column)[1:], series(second, column)[1:]
        if min(len(values) for values, _ in sides) < LEAST_EACH:
            continue
        logs, ranges = weigh_two(sides[0], sides[1], prior_of(column, np.zeros(0)).size)
        weights = {kind: weights[kind] + logs[kind] for kind in weights}
        unit = units.get(column) or units.get(f"alone.{column.partition('.')[2]}", "1")
        estimates = (ParameterEstimate(r.value, unit, r.low, r.high) for r in ranges)
        strengths.append(StrengthOnTwo(column, *estimates))
    if not strengths:
        return SharedEffect(effect, {}, counts, ())
    top = max(weights[kind] + math.log(share) for kind, share in BETWEEN.items())
    odds = {kind: share * math.exp(weights[kind] - top) for kind, share in BETWEEN.items()}
    whole = sum(odds.values())
    return SharedEffect(effect, {kind: p / whole for kind, p in odds.items()}, counts, tuple(strengths))


Side = tuple[Array, Array]
"""Values of a bench's sessions and their standard errors (NaN: unknown), (n,) each."""


def weigh_two(
    first: Side, second: Side, size: float
) -> tuple[dict[str, float], tuple[Estimate, Estimate, Estimate]]:
    """Log evidence of each of the five, and the strengths: first, second, second less first.

    The strengths are told as those of two benches that both have some.

    Args:
        size: a strength that would matter.
    """
    values = np.concatenate((first[0], second[0]))
    errors = np.nan_to_num(np.concatenate((first[1], second[1])), nan=0.0)
    size = max(size, float(np.max(np.abs(values))) / BEYOND, 1e-300)
    may_be = possible_errors(values, errors, size)
    precise, n = 1.0 / may_be.variances, len(first[0])
    typical = float(np.median(errors[errors > 0])) if np.any(errors > 0) else 1.0
    flat = may_be.weights + 0.5 * np.sum(np.log(precise / (2.0 * np.pi)), axis=1)
    a, p = [], []
    for side in (slice(None, n), slice(n, None)):
        own = precise[:, side].sum(axis=1)
        mean = (precise[:, side] @ values[side]) / own
        # What the sessions of a bench have in common moves its level: the rest of their intervals.
        common = may_be.common * (float(np.median(errors[side])) / typical) ** 2
        known = 1.0 / (1.0 / own + common)
        flat += 0.5 * np.log(known / own) - 0.5 * (
            np.sum(precise[:, side] * (values[side] - mean[:, None]) ** 2, axis=1) + known * mean**2
        )
        a.append(known[:, None])
        p.append((known * mean)[:, None])
    v = 1.0 / (np.array(SIZES) * size) ** 2  # (1, sizes): of one strength beforehand

    def gain(of: Array, weighted: Array) -> Array:
        return 0.5 * np.log(v / (of + v)) + 0.5 * weighted**2 / (of + v)

    grid = flat[:, None] - math.log(len(SIZES))
    each = [gain(a[0], p[0]), gain(a[1], p[1])]
    parts = {
        "same": grid + gain(a[0] + a[1], p[0] + p[1]),
        "differs": grid + each[0] + each[1],
        "first": grid + each[0],
        "second": grid + each[1],
        "neither": np.broadcast_to(grid, each[0].shape),
    }
    logs = {kind: float(np.logaddexp.reduce(part, axis=None)) for kind, part in parts.items()}
    weight = np.exp(parts["differs"] - parts["differs"].max())
    means = [weighted / (of + v) for of, weighted in zip(a, p, strict=True)]
    spreads = [np.broadcast_to(1.0 / (of + v), weight.shape) for of in a]
    ranges = [
        quantiles(mean.ravel(), np.sqrt(spread).ravel(), weight.ravel())
        for mean, spread in (
            (means[0], spreads[0]), (means[1], spreads[1]), (means[1] - means[0], spreads[0] + spreads[1]),
        )
    ]  # fmt: skip
    return logs, (ranges[0], ranges[1], ranges[2])

"""What became of a bench over its sessions: of every number, and of the bench at one moment.

Each number has a course: steady, a step, wear, something that settles or warms up, or one session that went
wrong, each with its probability (``laws.py``). Whether an effect was found missing is a yes or no of each
session: one rate, or one before and another after, under Jeffreys' prior.

One that is found in many quantities is judged as one of many: beforehand, as much speaks for no change in any
of them as for a change in one. What steps at the same moment is told as one change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.batch.followed import (
    ageing_rows,
    days_of,
    effect_of,
    followed_columns,
    found_effects,
    model_of,
    prior_of,
    series,
    strength_columns,
    with_strengths,
)
from fingerlab.batch.laws import Course, Estimate, course
from fingerlab.batch.settings import MOSTLY, PROBABLE
from fingerlab.batch.table import Row, number_of
from fingerlab.core.text import ParameterEstimate
from fingerlab.diagnosis.equations.parameters import is_loss
from fingerlab.sessions.model import Array

LEAST_SIDE = 2
"""Sessions on either side of the moment from which on an effect is found: one alone may have gone wrong."""
LEAST_YES_AND_NO = 5
"""Fewer sessions leave open whether a yes or no changed."""


@dataclass(frozen=True)
class NumberCourse:
    """The course of one column over the sessions that have it.

    Attributes:
        column, unit: of the table. effect: whose strength it is; empty: none's. names: of the sessions, in
            order of time. when: their ISO times. from_nothing: whether it should be zero.
        course: what became of it. leans_on: effects of the models of its sessions, if it is the strength of
            an effect fitted alone, which then takes up what these do; it is no finding of its own.
    """

    column: str
    unit: str
    effect: str
    names: tuple[str, ...]
    when: tuple[str, ...]
    from_nothing: bool
    course: Course
    leans_on: tuple[str, ...] = ()

    def estimate(self, estimated: Estimate) -> ParameterEstimate:
        """A level or a size of the course, with its unit."""
        return ParameterEstimate(estimated.value, self.unit, estimated.low, estimated.high)


@dataclass(frozen=True)
class BenchChange:
    """Something that changed between two sessions.

    Attributes:
        kind: "new" or "gone" (an effect that is missing only after it, or only before it), "grown" or
            "shrunk" (the same effect, of another strength), "moved" (a number of the bench).
        effect: id of the effect; empty: none. column: of the number that moved; empty: none.
        chance: probability that there was a step, 0 to 1. certain_place: that it was here, if so.
        before, after: names of the sessions next to it. when: ISO time of the one after it.
        first, second: the number's mean on either side with its 90 % interval; None without one.
        found: sessions with the effect and all sessions, before and after.
        others: columns that moved with it.
    """

    kind: str
    effect: str
    column: str
    chance: float
    certain_place: float
    before: str
    after: str
    when: str
    first: ParameterEstimate | None = None
    second: ParameterEstimate | None = None
    found: tuple[int, int, int, int] = (0, 0, 0, 0)
    others: tuple[str, ...] = ()


@dataclass(frozen=True)
class YesAndNo:
    """Whether a rate changed: ``step``, its probability; ``place``, the sessions before the likeliest moment;
    ``certain_place``, the probability of that place, if there is a step."""

    step: float
    place: int
    certain_place: float


def weigh_found(days: Array, found: Sequence[bool], prior: float = 0.5) -> YesAndNo | None:
    """One rate, or one before and another after, of whether something was found; None: too few sessions.

    Args:
        days: of recording, (n,), rising. prior: probability of a change beforehand.
    """
    inside = range(LEAST_SIDE, len(days) - LEAST_SIDE + 1)
    places = [place for place in inside if days[place] > days[place - 1]]
    if len(found) < LEAST_YES_AND_NO or not places:
        return None
    hits = np.asarray(found, dtype=bool)
    one = _rate(hits)
    steps = [math.exp(_rate(hits[:place]) + _rate(hits[place:]) - one) for place in places]
    mean, best = prior * float(np.mean(steps)), int(np.argmax(steps))
    return YesAndNo(mean / (mean + 1.0 - prior), places[best], steps[best] / sum(steps))


def _rate(hits: Array) -> float:
    """Logarithm of the probability of a sequence of yes and no whose rate may be anything."""
    yes, n = int(np.sum(hits)), len(hits)
    return math.lgamma(yes + 0.5) + math.lgamma(n - yes + 0.5) - math.lgamma(n + 1) - math.log(math.pi)


def course_columns(rows: Sequence[Row]) -> list[str]:
    """The columns that have a course, in rows of :func:`with_strengths`: the bench's numbers, then effects'.

    The errors only follow. An effect that was found somewhere is followed by its strength in the models.
    """
    strong = [column for effect in found_effects(rows) for column in strength_columns(effect, rows)]
    covered = {effect_of(column) for column in strong}
    usual = [column for column in followed_columns(rows)[2:] if effect_of(column) not in covered]
    return list(dict.fromkeys([*usual, *strong]))


def courses(rows: Sequence[Row], units: Mapping[str, str]) -> list[NumberCourse]:
    """The course of every number that three sessions have, in the order of :func:`course_columns`."""
    usable = with_strengths(ageing_rows(rows))
    days, columns = days_of(usable), course_columns(usable)
    seconds = np.array([number_of(row.get("recorded_seconds")) for row in usable])
    used = np.concatenate(([0.0], np.cumsum(seconds)[:-1])) if len(usable) else seconds
    change = one_of_many(len(columns) + len(found_effects(usable)))
    result = []
    for column in columns:
        known, values, errors = series(usable, column)
        if not known:
            continue
        prior = prior_of(column, values, change)
        one = course(days[known], values, errors, prior, used[known])
        if one is not None:
            names, when = (tuple(str(usable[i][key]) for i in known) for key in ("session", "created"))
            from_nothing = prior.absent or is_loss(column.removeprefix("param."))
            unit = units.get(column) or units.get(f"alone.{column.partition('.')[2]}", "1")
            leans_on = tuple(_leans_on(column, [usable[i] for i in known]))
            result.append(
                NumberCourse(column, unit, effect_of(column), names, when, from_nothing, one, leans_on)
            )
    return result


def _leans_on(column: str, rows: Sequence[Row]) -> list[str]:
    """Effects that take part in what an effect fitted alone takes up."""
    if not column.startswith("alone."):
        return []
    return [effect for effect in found_effects(rows) if effect != effect_of(column)]


def one_of_many(count: int) -> float:
    """Probability beforehand that one of so many quantities changed."""
    return 1.0 / (1.0 + max(count, 1))


def changes(
    rows: Sequence[Row], units: Mapping[str, str], known: Sequence[NumberCourse] | None = None
) -> list[BenchChange]:
    """What changed between two sessions, surest first; what is as likely steady as not is left out.

    Args:
        known: the courses of these rows, if they are there already.
    """
    usable = with_strengths(ageing_rows(rows))
    days, effects = days_of(usable), found_effects(usable)
    prior = one_of_many(len(course_columns(usable)) + len(effects))
    all_courses = courses(rows, units) if known is None else known
    found = [_of_column(usable, one) for one in all_courses if one.course.step >= PROBABLE]
    found += [c for effect in effects if (c := _of_effect(usable, days, effect, prior)) is not None]
    moments: dict[str, list[BenchChange]] = {}
    for change in found:
        moments.setdefault(change.after, []).append(change)
    return sorted(map(_named, moments.values()), key=lambda one: -one.chance)


def beside(known: Sequence[NumberCourse], found: Sequence[BenchChange]) -> list[NumberCourse]:
    """Courses that are no part of a change at one moment, and lean on nothing that was found."""
    columns = {name for change in found for name in (change.column, *change.others)}
    effects = {change.effect for change in found if change.effect}
    return [
        one
        for one in known
        if not one.leans_on
        and one.column not in columns
        and not (one.effect in effects and one.course.step >= PROBABLE)
    ]


ORDER = ("new", "gone", "grown", "shrunk", "moved")


def _named(together: Sequence[BenchChange]) -> BenchChange:
    """What changed at one moment: the effect that came, went or grew; all else moved with it.

    A fit that lacks an effect leans on the others, so that their numbers step when it comes.
    """

    def rank(one: BenchChange) -> tuple[int, bool, float, float]:
        before, n, after, m = one.found
        share = abs(after / max(m, 1) - before / max(n, 1))
        return ORDER.index(one.kind), bool(one.effect) and one.kind == "moved", -share, -one.chance

    first, *others = sorted(together, key=rank)
    if first.effect:
        own = [one for one in together if one.effect == first.effect]
        best = max(own, key=lambda one: (bool(one.column), one.chance))
        sure = max(own, key=lambda one: one.chance)
        first = replace(best, kind=first.kind, chance=sure.chance, certain_place=sure.certain_place)
        others = [one for one in together if one.effect != first.effect]
    return replace(first, others=tuple(one.column for one in others if one.column))


def _of_effect(rows: Sequence[Row], days: Array, effect: str, prior: float) -> BenchChange | None:
    found = [effect in model_of(row) for row in rows]
    weighed = weigh_found(days, found, prior)
    if weighed is None or weighed.step < PROBABLE:
        return None
    k = weighed.place
    counts = (sum(found[:k]), k, sum(found[k:]), len(found) - k)
    kind = "new" if counts[0] * counts[3] < counts[2] * counts[1] else "gone"
    names, when = ([str(row[key]) for row in rows] for key in ("session", "created"))
    return BenchChange(kind, effect, "", weighed.step, weighed.certain_place, names[k - 1], names[k], when[k],
                  found=counts)  # fmt: skip


def _of_column(rows: Sequence[Row], one: NumberCourse) -> BenchChange:
    k, effect = one.course.place, one.effect
    by_name = {str(row["session"]): row for row in rows}
    having = [effect in model_of(by_name[name]) for name in one.names]
    counts = sum(having[:k]), k, sum(having[k:]), len(having) - k
    first, second = one.estimate(one.course.first), one.estimate(one.course.last)
    grown = "grown" if abs(second.value) > abs(first.value) else "shrunk"
    kinds = {(False, True): "new", (True, False): "gone", (True, True): grown}
    sides = counts[0] > MOSTLY * counts[1], counts[2] > MOSTLY * counts[3]
    kind = kinds.get(sides, "moved") if effect else "moved"
    certain = float(one.course.places[k])
    return BenchChange(kind, effect, one.column, one.course.step, certain, one.names[k - 1], one.names[k],
                  one.when[k], first, second, counts)  # fmt: skip

"""What became of a bench over its sessions, and what two benches share, in words and as plain data."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import (
    ParameterEstimate,
    decimals_for,
    estimate_text,
    fixed,
    percent,
    screen_unit,
    with_minus,
)
from fingerlab.diagnosis.equations.parameters import is_loss
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.effects import CATALOGUE
from fingerlab.report.diagnosis_words import (
    NOTHING_WORDS,
    UNKNOWN_WORDS,
    effect_title,
    in_sentence,
    kept_titles,
    listed,
)
from fingerlab.report.parameter_words import SHORT_TITLES, parameter_title

if TYPE_CHECKING:
    from fingerlab.batch.benches import BenchSessions, SharedEffect, StrengthOnTwo
    from fingerlab.batch.changes import BenchChange, NumberCourse
    from fingerlab.batch.followed import Trend
    from fingerlab.batch.laws import Estimate

Row = dict[str, Any]

KIND_WORDS: Mapping[str, str] = {
    "steady": "steady",
    "step": "step",
    "new": "new effect",
    "gone": "effect gone",
    "wear": "wear",
    "settling": "settles",
    "warm_up": "warms up",
    "odd": "one session off",
    "open": "cannot be told",
}
"""What a course is called in a table."""
BETWEEN_WORDS: Mapping[str, str] = {
    "same": "both, alike",
    "differs": "both, not alike",
    "first": "first only",
    "second": "second only",
    "neither": "neither",
    "": "not known",
}
LEAST_PLACE = 0.01
"""Less likely moments are left out of the JSON."""


def course_sentence(one: NumberCourse) -> str:
    """What became of a number, as what that reads, and how sure it is."""
    verdict, title = one.course.verdict, column_words(one.column)
    sure = f"Probability {percent(one.course.certain)}."
    if verdict == "open":
        return _open(one, title)
    if verdict == "steady":
        level = estimate_text(one.estimate(one.course.last))
        return f"{title} stayed at {level} over {len(one.names)} sessions. {sure}"
    if one.leans_on:
        others = listed([in_sentence(effect_title(effect)) for effect in one.leans_on])
        sure = f"{sure} Fitted alone, it takes up what is of {others}."
    if one.course.moment:
        return f"{_moment(one)} {in_sentence(title)} {_step(one, verdict)} {sure}"
    size, ends = estimate_text(one.estimate(one.course.size)), _ends(one)
    if verdict == "odd":
        place = int(np.argmax(one.course.odd))
        name, chance = one.names[place], float(one.course.odd[place])
        return (
            f"{title}: {name} alone is off by {size}; rather that session went wrong than the bench. {sure} "
            f"Of that session, if so, {percent(chance)}."
        )
    if verdict == "warm_up":
        return (
            f"{title} changes by {size} within each sitting and comes back after a pause, as with "
            f"temperature. {sure}"
        )
    if verdict == "settling":
        return f"{title} settles, {ends}, most of it in the first sessions, as when a bench runs in. {sure}"
    falls = abs(one.course.last.value) < abs(one.course.first.value)
    reads = "as of what wears in or comes loose" if falls else "as wear does"
    return f"{title} {'falls' if falls else 'grows'} steadily, {ends}, {reads}. {sure}"


def _open(one: NumberCourse, title: str) -> str:
    count, course = len(one.names), one.course
    chances = sorted(((p, kind) for kind, p in course.chances.items() if kind != "steady"), reverse=True)
    named = listed([f"{KIND_WORDS[kind]} {percent(p)}" for p, kind in chances[:3]])
    if course.chances["steady"] < 0.5:
        last = course.places.size and max(course.places[-1], course.places[1]) > 0.5
        more = " A session more would tell a step from one that went wrong." if last and count > 2 else ""
        return (
            f"{title} changed ({percent(1.0 - course.chances['steady'])}), but {count} sessions cannot tell "
            f"how: {named}.{more}"
        )
    return (
        f"{title}: {count} sessions cannot tell whether it changed; steady "
        f"{percent(course.chances['steady'])}, {named}."
    )


def _moment(one: NumberCourse) -> str:
    place = one.course.place
    chance = percent(float(one.course.places[place]))
    return (
        f"Between {one.names[place - 1]} and {one.names[place]} ({one.when[place][:10]}; of that moment "
        f"{chance})"
    )


def _step(one: NumberCourse, verdict: str) -> str:
    ends = _ends(one)
    if one.leans_on:
        return f"went {ends}."
    if verdict == "new":
        after = estimate_text(one.estimate(one.course.last))
        return f"came up from nothing to {after}: {in_sentence(effect_title(one.effect))} is a new effect."
    if verdict == "gone":
        before = estimate_text(one.estimate(one.course.first))
        return (
            f"went away from {before}: {in_sentence(effect_title(one.effect))} is gone, as after a repair, "
            "cleaning or lubrication."
        )
    first, last = one.estimate(one.course.first), one.estimate(one.course.last)
    return f"went {ends}{reads_as(first, last, one.from_nothing)}."


def _ends(one: NumberCourse) -> str:
    first, last = one.estimate(one.course.first), one.estimate(one.course.last)
    return f"from {estimate_text(first)} to {estimate_text(last)}"


def course_json(one: NumberCourse) -> dict[str, Any]:
    """An entry of "over_time" of ``batch --json``; SI."""
    course = one.course

    def plain(estimate: Estimate) -> dict[str, Any]:
        return vars(one.estimate(estimate))

    def places(chances: Sequence[float]) -> list[dict[str, Any]]:
        named = zip(one.names, chances, strict=True)
        return [{"session": name, "probability": float(p)} for name, p in named if p >= LEAST_PLACE]

    entry = {
        "column": one.column,
        "unit": one.unit,
        "effect": one.effect,
        "leans_on": list(one.leans_on),
        "sessions": list(one.names),
        "told": course.verdict,
        "kind": course.kind,
        "probability": course.certain,
        "chances": dict(course.chances),
        "step_before": places(course.places.tolist()),
        "odd_session": places(course.odd.tolist()),
        "first": plain(course.first),
        "last": plain(course.last),
        "size": plain(course.size),
        "scatter": plain(course.scatter),
        "bayes_factor": course.learned,
        "sentence": course_sentence(one),
    }
    return dict(json_ready(entry))


def shared_sentence(one: SharedEffect, first: BenchSessions, second: BenchSessions) -> str:
    """Whether two benches share an effect, and how sure that is."""
    title = effect_title(one.effect)
    a, n, b, m = one.found
    seen = f"found in {a} of {n} sessions of {first.name} and in {b} of {m} of {second.name}"
    if not one.chances:
        return f"{title} was {seen}; nothing tells its strength on both."
    sure = f"Probability {percent(one.chances[one.likeliest])}"
    strengths = "; ".join(_strengths(s) for s in one.strengths)
    if one.chances[one.likeliest] < 0.5:
        ranked = sorted(one.chances.items(), key=lambda pair: -pair[1])[:3]
        named = listed([f"{BETWEEN_WORDS[kind]} {percent(p)}" for kind, p in ranked])
        return f"{title}: the sessions cannot tell who has it ({named}); {seen}. {strengths}."
    what = {
        "same": f"{title} is on both, equally strong",
        "differs": f"{title} is on both, but not equally strong",
        "first": f"{title} is on {first.name} only",
        "second": f"{title} is on {second.name} only",
        "neither": f"{title} has no strength on either that is sure",
    }[one.likeliest]
    return f"{what}: {strengths}; {seen}. {sure}."


def _strengths(strength: StrengthOnTwo) -> str:
    words = in_sentence(column_words(strength.column))
    return f"{words} {estimate_text(strength.first)} against {estimate_text(strength.second)}"


SHARED_HEADINGS = ("Effect", "On", "Probability", "Strength", "First", "Second", "Second less first")


def shared_cells(one: SharedEffect) -> list[tuple[str, ...]]:
    """Rows under ``SHARED_HEADINGS``, one for each strength of the effect."""
    title = effect_title(one.effect)
    if not one.chances:
        a, n, b, m = one.found
        return [(title, BETWEEN_WORDS[""], "–", "found in sessions", f"{a} of {n}", f"{b} of {m}", "–")]
    head = (title, BETWEEN_WORDS[one.likeliest], percent(one.chances[one.likeliest]))
    return [
        (*(head if k == 0 else ("", "", "")), column_words(s.column),
         *(estimate_text(e) for e in (s.first, s.second, s.second_less_first)))
        for k, s in enumerate(one.strengths)
    ]  # fmt: skip


def shared_json(one: SharedEffect, first: BenchSessions, second: BenchSessions) -> dict[str, Any]:
    """An entry of "effects" in "between" of ``batch --json``; SI."""
    entry = {
        "effect": one.effect,
        "title": effect_title(one.effect),
        "told": one.likeliest,
        "chances": dict(one.chances),
        "found": list(one.found),
        "strengths": [
            {"column": s.column, "first": vars(s.first), "second": vars(s.second),
             "second_less_first": vars(s.second_less_first)}
            for s in one.strengths
        ],
        "sentence": shared_sentence(one, first, second),
    }  # fmt: skip
    return dict(json_ready(entry))


def _numbers(estimate: ParameterEstimate) -> list[str]:
    return [f"{number:.9g}" for number in (estimate.value, estimate.low, estimate.high)]


def courses_csv(benches: Sequence[tuple[str, Sequence[NumberCourse]]]) -> str:
    """Every course as a row, SI; ``benches`` are the names of groups (or one without a name) and theirs."""
    ends = [f"{what}{end}" for what in ("first", "last", "size") for end in ("", "_low", "_high")]
    kinds = [kind for kind in KIND_WORDS if kind != "open"]
    head = ["bench", "column", "unit", "sessions", "told", *kinds, "step_before", "step_before_probability"]
    rows = []
    for name, courses in benches:
        for one in courses:
            course = one.course
            place = one.names[course.place] if course.step > 0.0 else ""
            chances = [f"{course.chances[kind]:.4f}" for kind in kinds]
            moment = [place, f"{float(course.places[course.place]):.4f}"]
            numbers = [n for r in (course.first, course.last, course.size) for n in _numbers(one.estimate(r))]
            rows.append(
                [name, one.column, one.unit, len(one.names), course.verdict, *chances, *moment, *numbers]
            )
    return _csv([*head, *ends], rows)


def shared_csv(effects: Sequence[SharedEffect]) -> str:
    """Every strength of every effect on two benches as a row, SI."""
    kinds = [kind for kind in BETWEEN_WORDS if kind]
    ends = [f"{w}{end}" for w in ("first", "second", "second_less_first") for end in ("", "_low", "_high")]
    head = ["effect", "told", *kinds, "found_first", "of_first", "found_second", "of_second"]
    rows = []
    for one in effects:
        chances = [f"{one.chances[kind]:.4f}" if one.chances else "" for kind in kinds]
        start = [one.effect, one.likeliest, *chances, *one.found]
        for s in one.strengths:
            numbers = [n for e in (s.first, s.second, s.second_less_first) for n in _numbers(e)]
            rows.append([*start, s.column, s.first.unit, *numbers])
        if not one.strengths:
            rows.append([*start, "", "", *[""] * len(ends)])
    return _csv([*head, "column", "unit", *ends], rows)


def _csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()


COLUMN_WORDS = {
    "score": "Error / floor",
    "final_score": "Error / floor, effects added",
    **{f"alone.{one.id}.{name}": words for one in CATALOGUE.values() for name, words in one.followed.items()},
}


def outcome_words(row: Row) -> str:
    """What a session lacks, in words."""
    words = {Verdict.NOTHING_MISSING: NOTHING_WORDS, Verdict.NOT_IN_CATALOGUE: UNKNOWN_WORDS}
    if row["verdict"] in words:
        return words[row["verdict"]]
    if not row["set"]:
        return effect_title(str(row["first_effect"]))
    return kept_titles(row["set"], row.get("set_titles"))[0]


def not_shown_sentence(rows: Sequence[Row]) -> str:
    """What the sessions in which nothing is missing leave open, and how many of them; or nothing."""
    left = [
        kept_titles(row["set"], row.get("set_titles"))
        for row in rows
        if row["verdict"] == Verdict.NOTHING_MISSING and row["set"]
    ]
    if not left:
        return ""
    titles = Counter(in_sentence(title) for each in left for title in each)
    named = [f"{title} ({count})" for title, count in titles.most_common()]
    where = "One session" if len(left) == 1 else f"{len(left)} sessions"
    leave = "leaves" if len(left) == 1 else "leave"
    return f"{where} with nothing missing {leave} open, at a plausible strength: {listed(named)}."


def column_words(column: str) -> str:
    """A column of the table in words, such as ``Moment arm MCP, extension``."""
    if column in COLUMN_WORDS:
        return COLUMN_WORDS[column]
    if column.partition(".")[2].count("."):
        return parameter_title(column.partition(".")[2], ())
    key, _, routing = column.partition(".")[2].partition("@")
    words = SHORT_TITLES.get(key, key.replace("_", " "))
    return f"{words}, {routing}" if routing else words


def trend_cells(trend: Trend) -> tuple[str, str, str, str, str, str]:
    """Quantity, median, unit, change a month, its 90 % interval, number of sessions.

    The unit is that of the values, however large the change of a month would be in it.
    """
    unit = screen_unit(trend.unit, abs(trend.median))
    slope, low, high = (value * unit.factor for value in (trend.per_month, trend.low, trend.high))
    told = math.isfinite(slope)
    digits = min(decimals_for((high - low) / 4), MOST_DECIMALS)
    return (
        column_words(trend.column),
        with_minus(f"{trend.median * unit.factor:.4g}"),
        unit.symbol,
        fixed(slope, digits),
        f"{fixed(low, digits)} to {fixed(high, digits)}" if told else "–",
        str(trend.sessions),
    )


def within_a_day(found: Sequence[Trend]) -> str:
    """That of sessions of one day no change a month is told; empty where all trends have one."""
    short = [trend for trend in found if not math.isfinite(trend.per_month)]
    if not short:
        return ""
    if len(short) == len(found):
        return "The sessions were recorded within a day, so that no change a month is told."
    return "Of a number whose sessions were recorded within a day no change a month is told."


MOST_DECIMALS = 4


def reads_as(first: ParameterEstimate | None, second: ParameterEstimate | None, from_nothing: bool) -> str:
    """What a step is usually: ", as after damage ...".

    Args:
        first, second: the number before and after. from_nothing: it should be zero, as a friction.
    """
    if first is None or second is None:
        return ""
    if not from_nothing:
        return ", as when a part is changed or a cable laid anew"
    if abs(second.value) < abs(first.value):
        return ", as after a repair, cleaning or lubrication"
    return ", as after damage or with a new part"


def change_sentence(change: BenchChange) -> str:
    """What changed, between which sessions, and how sure that is."""
    when = f"Between {change.before} and {change.after} ({change.when[:10]})"
    sure = f"Probability {percent(change.chance)}; of that moment, if so, {percent(change.certain_place)}."
    title = in_sentence(effect_title(change.effect)) if change.effect else ""
    before, n, after, m = change.found
    strength = ""
    if change.first is not None and change.second is not None:
        values = f"from {estimate_text(change.first)} to {estimate_text(change.second)}"
        strength = f"{in_sentence(column_words(change.column))} went {values}"
    seen = f"missing in {before} of {n} sessions before and in {after} of {m} after"
    if change.kind in ("new", "gone"):
        what = f"a new effect appeared, {title}" if change.kind == "new" else f"an effect went away, {title}"
        what = f"{what}, {seen}" + (f"; {strength}" if strength else "")
    elif change.kind == "moved":
        what = strength
    else:
        what = f"the same effect has {change.kind}, {title}: {strength}; {seen}"
    what += reads_as(
        change.first, change.second, bool(change.effect) or is_loss(change.column.removeprefix("param."))
    )
    many = len(change.others)
    others = f" With it moved {many} other number{'s' * (many > 1)}." if many else ""
    return f"{when} {what}. {sure}{others}"

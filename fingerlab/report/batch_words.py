"""What a batch found, in words: outcomes, followed quantities, trends, and what changed when."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fingerlab.core.text import (
    decimals_for,
    estimate_text,
    fixed,
    largest_of,
    percent,
    screen_unit,
    with_minus,
)
from fingerlab.report.diagnosis_words import (
    NOTHING_WORDS,
    UNKNOWN_WORDS,
    effect_title,
    in_sentence,
    listed,
)
from fingerlab.report.parameter_words import parameter_title

if TYPE_CHECKING:
    from fingerlab.batch.changes import Change
    from fingerlab.batch.table import Trend

Row = dict[str, Any]

PARAMETER_WORDS = {
    "arm_mcp": "Moment arm MCP",
    "arm_pip": "Moment arm PIP",
    "loss_mcp": "Loss MCP",
    "loss_pip": "Loss PIP",
    "offset": "Cable offset",
    "bench_gain": "Load per known load",
    "bench_offset": "Torque without load",
}
COLUMN_WORDS = {
    "score": "Error / floor",
    "final_score": "Error / floor, effects added",
    "alone.coulomb_friction.coulomb_mcp": "MCP friction, Coulomb",
    "alone.coulomb_friction.coulomb_pip": "PIP friction, Coulomb",
    "alone.viscous_friction.viscous_mcp": "MCP friction, viscous",
    "alone.viscous_friction.viscous_pip": "PIP friction, viscous",
    "alone.motor_coulomb_friction.coulomb": "Motor friction, Coulomb",
    "alone.motor_viscous_friction.viscous": "Motor friction, viscous",
    "alone.transport_delay.delay": "Delay",
}


def outcome_words(row: Row) -> str:
    """What a session lacks, in words."""
    words = {"nothing_missing": NOTHING_WORDS, "not_in_catalogue": UNKNOWN_WORDS}
    if row["verdict"] in words:
        return words[row["verdict"]]
    return effect_title(row["set"][0] if row["set"] else str(row["first_effect"]))


def not_shown_sentence(rows: Sequence[Row]) -> str:
    """What the sessions in which nothing is missing leave open, and how many of them; or nothing."""
    left = [row["set"] for row in rows if row["verdict"] == "nothing_missing" and row["set"]]
    if not left:
        return ""
    titles = Counter(in_sentence(effect_title(effect)) for effects in left for effect in effects)
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
    words = PARAMETER_WORDS.get(key, key.replace("_", " "))
    return f"{words}, {routing}" if routing else words


def trend_cells(trend: Trend) -> tuple[str, str, str, str, str, str]:
    """Quantity, median, unit, change a month, its 90 % interval, number of sessions."""
    unit = screen_unit(trend.unit, largest_of((trend.median, trend.low, trend.high)))
    slope, low, high = (value * unit.factor for value in (trend.per_month, trend.low, trend.high))
    digits = min(decimals_for((high - low) / 4), MOST_DECIMALS)
    return (
        column_words(trend.column),
        with_minus(f"{trend.median * unit.factor:.4g}"),
        unit.symbol,
        fixed(slope, digits),
        f"{fixed(low, digits)} to {fixed(high, digits)}",
        str(trend.sessions),
    )


MOST_DECIMALS = 4


def change_sentence(change: Change) -> str:
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
    many = len(change.others)
    others = f" With it moved {many} other number{'s' * (many > 1)}." if many else ""
    return f"{when} {what}. {sure}{others}"

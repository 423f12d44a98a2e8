"""How the bench ages, on the terminal: sessions in order of time, trends, and what was found how often."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fingerlab.batch.rows import Row, recorded_at
from fingerlab.batch.table import LEAST_TIMES, Contents, Trend, ageing_rows
from fingerlab.core.text import decimals_for, fixed, largest_of, score_text, screen_unit, with_minus
from fingerlab.report.diagnosis_words import (
    NOTHING_WORDS,
    UNKNOWN_WORDS,
    effect_title,
    in_sentence,
    listed,
)

if TYPE_CHECKING:
    from rich.table import Table

SHOWN_SESSIONS = 30
"""The latest sessions that are listed; the table holds them all."""

SHOWN_COLUMNS = (
    ("arm\nMCP", ("param.arm_mcp@extension", "param.arm_mcp@flexion")),
    ("arm\nPIP", ("param.arm_pip@extension", "param.arm_pip@flexion")),
    ("joint\nfriction", ("alone.coulomb_friction.coulomb_pip",)),
    ("motor\nfriction", ("alone.motor_coulomb_friction.coulomb",)),
    ("\noffset", ("param.offset@extension", "param.offset@flexion")),
    ("\ndelay", ("alone.transport_delay.delay",)),
)
"""Heading, and the columns that may stand under it: the first one that any session has."""

NARROW = 100
"""On a terminal of fewer columns the sessions are listed without what is missing and without the delay."""

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
MOST_DECIMALS = 4


def print_summary(contents: Contents, trends: Sequence[Trend]) -> None:
    """Everything that a person wants to see at once; the rest is in the table."""
    from rich.text import Text

    from fingerlab.cli.output import table_console

    console = table_console()
    good = [row for row in contents.rows if not row["error"]]
    if not good:
        console.print(Text("No session could be diagnosed."))
        return
    console.print(_sessions(good, contents, console.width < NARROW))
    if len(good) > SHOWN_SESSIONS:
        console.print(Text(f"The latest {SHOWN_SESSIONS} of {len(good)} sessions.", style="dim"))
    console.print()
    if trends:
        console.print(_trends(trends))
        console.print(
            Text(
                "Trends are medians over all pairs of sessions (Theil-Sen), with 90 % intervals; * where the "
                "interval leaves out zero, which one steady quantity in ten does by chance.",
                style="dim",
            )
        )
    else:
        times = len({row["created"] for row in ageing_rows(contents.rows)})
        console.print(Text(f"A trend needs sessions of {LEAST_TIMES} times at least; there are {times}."))
    console.print()
    for words, count in _outcomes(good):
        console.print(Text(f"{count:5d}  {words}"))
    unseen = not_shown_sentence(good)
    if unseen:
        console.print(Text(f"\n{unseen}"))


def _outcomes(rows: Sequence[Row]) -> list[tuple[str, int]]:
    """What was found how often, most frequent first."""
    return Counter(_outcome(row) for row in rows).most_common()


def _outcome(row: Row) -> str:
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


def _sessions(rows: Sequence[Row], contents: Contents, narrow: bool) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("recorded", no_wrap=True)
    table.add_column("session", no_wrap=True, overflow="ellipsis", max_width=16 if narrow else 24)
    if not narrow:
        table.add_column("missing", overflow="ellipsis", no_wrap=True, max_width=24)
    table.add_column("error", justify="right")
    table.add_column("left", justify="right")
    wanted = SHOWN_COLUMNS[:-1] if narrow else SHOWN_COLUMNS
    shown = [_column(heading, names, rows, contents) for heading, names in wanted]
    columns = [column for column in shown if column is not None]
    for heading, _, _ in columns:
        table.add_column(heading, justify="right")
    for row in rows[-SHOWN_SESSIONS:]:
        when = recorded_at(row["created"])
        cells = [fixed(_value(row, name) * factor, 2) for _, name, factor in columns]
        table.add_row(
            "–" if when is None else when.strftime("%Y-%m-%d"),
            row["session"],
            *([] if narrow else [_outcome(row)]),
            score_text(_value(row, "score")),
            score_text(_value(row, "final_score")),
            *cells,
        )
    return table


def _column(
    heading: str, names: Sequence[str], rows: Sequence[Row], contents: Contents
) -> tuple[str, str, float] | None:
    """Heading with unit, the column's name, and the factor from SI; None where no session has it."""
    for name in names:
        if any(name in row for row in rows):
            largest = largest_of(_value(row, name) for row in rows)
            unit = screen_unit(contents.units.get(name, "1"), largest)
            return f"{heading}\n{unit.symbol}", name, unit.factor
    return None


def _value(row: Row, name: str) -> float:
    value: Any = row.get(name)
    return float(value) if isinstance(value, (int, float)) else math.nan


def _trends(trends: Sequence[Trend]) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("quantity")
    for title in ("median", "unit", "per month", "90 % interval", "", "sessions"):
        table.add_column(title, justify="left" if title in ("unit", "") else "right", no_wrap=True)
    for trend in trends:
        unit = screen_unit(trend.unit, largest_of((trend.median, trend.low, trend.high)))
        slope, low, high = (value * unit.factor for value in (trend.per_month, trend.low, trend.high))
        digits = min(decimals_for((high - low) / 4), MOST_DECIMALS)
        table.add_row(
            column_words(trend.column),
            with_minus(f"{trend.median * unit.factor:.4g}"),
            unit.symbol,
            fixed(slope, digits),
            f"{fixed(low, digits)} to {fixed(high, digits)}",
            "*" if trend.changes else "",
            str(trend.sessions),
        )
    return table


def column_words(column: str) -> str:
    """A column of the table in words, such as ``Moment arm MCP, extension``."""
    if column in COLUMN_WORDS:
        return COLUMN_WORDS[column]
    key, _, routing = column.partition(".")[2].partition("@")
    words = PARAMETER_WORDS.get(key, key.replace("_", " "))
    return f"{words}, {routing}" if routing else words

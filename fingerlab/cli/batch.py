"""``fingerlab batch``: every session below a folder, one row each, and how the bench ages."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fingerlab.batch.benches import BenchSessions, SharedEffect, shared_effects, two_groups
from fingerlab.batch.changes import BenchChange, NumberCourse, beside, changes, courses
from fingerlab.batch.followed import LEAST_TIMES, Trend, ageing_rows, trends
from fingerlab.batch.run import BatchResult, locally, on_dask, run_batch
from fingerlab.batch.settings import PROBABLE
from fingerlab.batch.table import Contents, Options, Row, recorded_at
from fingerlab.cli.common import (
    NEW_FILE,
    PATH,
    added_option,
    counted,
    json_option,
    progress_bar,
    refuse_same_place,
    table_console,
    tell_own_effects,
    write_json,
    write_text_safely,
)
from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import fixed, largest_of, score_text, screen_unit
from fingerlab.report.time_words import (
    change_sentence,
    course_json,
    course_sentence,
    courses_csv,
    not_shown_sentence,
    outcome_words,
    shared_csv,
    shared_json,
    shared_sentence,
    trend_cells,
    within_a_day,
)

MOST_LISTED = 5
"""Failed sessions that are told one by one; the rest are in the table."""


@click.command(short_help="Diagnose every session below a folder.")
@click.argument("folder", metavar="FOLDER", type=PATH)
@click.option("--out", required=True, metavar="T.parquet", type=PATH, help="Table, one row a session.")
@click.option("--dask", "address", metavar="ADDRESS", help="Let the Dask cluster at ADDRESS do the work.")
@added_option
@click.option("--jobs", type=click.IntRange(min=1), metavar="N", help="Diagnoses at a time; all cores.")
@click.option("--retry", is_flag=True, help="Try sessions again that could not be diagnosed.")
@click.option(
    "--between",
    nargs=2,
    metavar="A B",
    help="Two benches, and what they share: folders below FOLDER, or patterns of names such as 'left-*'.",
)
@click.option(
    "--over-time", "time_table", metavar="C.csv", type=NEW_FILE, help="Table of what became of each number."
)
@click.option(
    "--shared", "shared_table", metavar="S.csv", type=NEW_FILE, help="With --between: table of effects."
)
@json_option
def batch(
    folder: Path,
    out: Path,
    address: str | None,
    added: tuple[str, ...],
    jobs: int | None,
    retry: bool,
    between: tuple[str, str] | None,
    time_table: Path | None,
    shared_table: Path | None,
    json_target: str | None,
) -> None:
    """Diagnose every session below FOLDER, and show how the bench changed over time.

    Every number of the bench is told to be steady, to have changed at one moment, to wear, to settle, to warm
    up or to be off in one session, with probabilities. With --between, of two benches apart.

    A table that is there already is continued: a session in it, with the same content, program and effects,
    is not diagnosed again. Stopped or killed, it goes on where it was when the same command is given again.
    """
    if out.suffix.lower() != ".parquet":
        raise UserError(f"--out is {out}; the table is a Parquet file, so its name should end in .parquet.")
    if address is not None and jobs is not None:
        raise UserError("--jobs is for this machine alone; leave it out with --dask.")
    if shared_table is not None and between is None:
        raise UserError("--shared is the table of what two benches share; name them with --between A B.")
    refuse_same_place({"--over-time": time_table, "--shared": shared_table, "--json": json_target})
    options = _options(added)
    runner = locally(jobs) if address is None else on_dask(address, folder.resolve())
    bar, report = progress_bar("Batch")
    with bar:
        result = run_batch(folder, out, options, runner, retry, report)
    _tell(result, out)
    contents = result.contents
    found = trends(contents.rows, contents.units)
    story = _story("", contents.rows, contents)
    two = None if between is None else _two(contents, *between)
    benches = [story] if two is None else [two.first, two.second]
    if time_table is not None:
        write_text_safely(time_table, courses_csv([(one.name, one.courses) for one in benches]))
    if shared_table is not None and two is not None:
        write_text_safely(shared_table, shared_csv(two.effects))
    if json_target is not None:
        write_json(_batch_json(folder, out, result, found, story, two), json_target)
    if json_target != "-":
        _print_summary(contents, found, story, two)


@dataclass(frozen=True)
class _Story:
    """What became of one bench; without a name it is that of the whole folder."""

    name: str
    changes: list[BenchChange]
    courses: list[NumberCourse]


@dataclass(frozen=True)
class _Two:
    """Two benches, each with its story, and the effects that any of them has."""

    groups: tuple[BenchSessions, BenchSessions]
    first: _Story
    second: _Story
    effects: list[SharedEffect]


def _story(name: str, rows: Sequence[Row], contents: Contents) -> _Story:
    number_courses = courses(rows, contents.units)
    return _Story(name, changes(rows, contents.units, number_courses), number_courses)


def _two(contents: Contents, first: str, second: str) -> _Two:
    groups = two_groups(contents.rows, first, second)
    one, other = (_story(group.name, group.rows, contents) for group in groups)
    return _Two(groups, one, other, shared_effects(*groups, contents.units))


def _options(added: tuple[str, ...]) -> Options:
    """What the diagnoses depend on; an unknown effect is found before the work."""
    from fingerlab.effects import CATALOGUE, effect, own

    for name in added:
        effect(name)
    tell_own_effects()
    return Options(tuple(dict.fromkeys(added)), own.trusted_sources(CATALOGUE))


def _tell(result: BatchResult, out: Path) -> None:
    """What was done, on standard error."""
    words = f"{result.done} sessions diagnosed, {result.kept} were in the table already"
    if result.outdated:
        words += f"; {result.outdated} were done anew, as the program or your own effects have changed"
    if result.gone:
        words += f"; {result.gone} rows are of sessions that are no longer below the folder"
    click.echo(f"{words}. {out} holds {len(result.contents.rows)} rows.", err=True)
    for first, second in _copies(result):
        click.echo(f"{first} and {second} hold the same recording and count twice; remove one.", err=True)
    if result.failed:
        count = len(result.failed)
        click.echo(f"{counted(count, 'session')} could not be diagnosed:", err=True)
        for row in result.failed[:MOST_LISTED]:
            click.echo(f"  {row['session']}: {row['error']}", err=True)
        if count > MOST_LISTED:
            click.echo(f"  and {count - MOST_LISTED} more; the table's column 'error' says why.", err=True)


def _copies(result: BatchResult) -> list[tuple[str, str]]:
    """Sessions of the table that hold the same, with the first of that content."""
    first: dict[str, str] = {}
    pairs = []
    for row in result.contents.rows:
        name = str(row["session"])
        known = first.setdefault(str(row.get("sha256") or name), name)
        if known != name:
            pairs.append((known, name))
    return pairs


def _batch_json(
    folder: Path, out: Path, result: BatchResult, found: list[Trend], story: _Story, two: _Two | None
) -> dict[str, Any]:
    rows = result.contents.rows
    between = {} if two is None else {"between": _between_json(two)}
    return {
        "schema": 1,
        "folder": str(folder),
        "table": str(out),
        "added": list(result.contents.added),
        "sessions": len(rows),
        "done": result.done,
        "kept": result.kept,
        "outdated": result.outdated,
        "gone": result.gone,
        "failed": len(result.failed),
        "verdicts": dict(Counter(row["verdict"] for row in rows if row["verdict"] is not None)),
        "trends": [json_ready(vars(trend) | {"changes": trend.changes}) for trend in found],
        **_story_json(story),
        **between,
        "units": dict(result.contents.units),
        "rows": list(rows),
    }


def _story_json(story: _Story) -> dict[str, Any]:
    return {
        "changes": [json_ready(asdict(change)) for change in story.changes],
        "over_time": [course_json(one) for one in story.courses],
    }


def _between_json(two: _Two) -> dict[str, Any]:
    groups = [
        {"name": group.name, "sessions": [row["session"] for row in group.rows], **_story_json(story)}
        for group, story in zip(two.groups, (two.first, two.second), strict=True)
    ]
    return {"groups": groups, "effects": [shared_json(one, *two.groups) for one in two.effects]}


SHOWN_SESSIONS = 30
"""The latest sessions that are listed; the table holds them all."""

SHOWN_COLUMNS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("arm\nMCP", ("param.arm_mcp@extension", "param.arm_mcp@flexion")),
    ("arm\nPIP", ("param.arm_pip@extension", "param.arm_pip@flexion")),
    ("joint\nfriction", ("alone.coulomb_friction.coulomb_pip", "param.coulomb_friction.coulomb_pip")),
    ("motor\nfriction", ("alone.motor_coulomb_friction.coulomb", "param.motor_coulomb_friction.coulomb")),
    ("\noffset", ("param.offset@extension", "param.offset@flexion")),
    ("\ndelay", ("alone.transport_delay.delay",)),
)
"""Heading, and the columns that may stand under it: the first one that any session has."""
IN_MODEL = {names[0]: names[1] for _, names in SHOWN_COLUMNS if names[0].startswith("alone.") and names[1:]}
"""Of the effect fitted alone; of the same in a session's last model, which is told where there is one."""

NARROW = 100
"""On a terminal of fewer columns the sessions are listed without what is missing and without the delay."""


def _print_summary(contents: Contents, found: Sequence[Trend], story: _Story, two: _Two | None) -> None:
    """Everything that a person wants to see at once; the rest is in the table."""
    console = table_console()
    good = [row for row in contents.rows if not row["error"]]
    if not good:
        console.print(Text("No session could be diagnosed."))
        return
    console.print(_sessions_table(good, contents, console.width < NARROW))
    if _alone_words(good[-SHOWN_SESSIONS:]):
        console.print(Text(_alone_words(good[-SHOWN_SESSIONS:]), style="dim"))
    if len(good) > SHOWN_SESSIONS:
        console.print(Text(f"The latest {SHOWN_SESSIONS} of {len(good)} sessions.", style="dim"))
    console.print()
    if found:
        console.print(_trends_table(found))
        if any(math.isfinite(trend.per_month) for trend in found):
            words = (
                "Trends are medians over all pairs of sessions (Theil-Sen), with 90 % intervals; * where the "
                "interval leaves out zero, which one steady quantity in ten does by chance."
            )
            console.print(Text(words, style="dim"))
        if within_a_day(found):
            console.print(Text(within_a_day(found), style="dim"))
    else:
        times = len({row["created"] for row in ageing_rows(contents.rows)})
        console.print(Text(f"A trend needs sessions of {LEAST_TIMES} times at least; there are {times}."))
    if two is None:
        _print_story(console, story)
    else:
        for one in (two.first, two.second):
            console.print(Text(f"\n{one.name}", style="bold"))
            _print_story(console, one)
        console.print(Text("\nBoth", style="bold"))
        for shared in two.effects:
            console.print(Text(f"\n{shared_sentence(shared, *two.groups)}"))
        if not two.effects:
            console.print(Text("\nNo effect was found in any session of either."))
    console.print()
    for words, count in Counter(outcome_words(row) for row in good).most_common():
        console.print(Text(f"{count:5d}  {words}"))
    unseen = not_shown_sentence(good)
    if unseen:
        console.print(Text(f"\n{unseen}"))


def _print_story(console: Console, story: _Story) -> None:
    """What changed at one moment, then what did otherwise, then how many numbers stayed or tell nothing."""
    for change in story.changes:
        console.print(Text(f"\n{change_sentence(change)}"))
    rest = beside(story.courses, story.changes)
    for one in rest:
        if one.course.chances["steady"] < PROBABLE:
            console.print(Text(f"\n{course_sentence(one)}"))
    steady = sum(one.course.verdict == "steady" for one in rest)
    unsure = sum(one.course.verdict == "open" and one.course.chances["steady"] >= PROBABLE for one in rest)
    if rest:
        said = f"{counted(steady, 'number')} stayed as {'it was' if steady == 1 else 'they were'}"
        more = f"; of {unsure} the sessions hardly tell" if unsure else ""
        console.print(Text(f"\n{said}{more}.", style="dim"))


def _sessions_table(rows: Sequence[Row], contents: Contents, narrow: bool) -> Table:
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
        cells = [_cell(row, name, factor) for _, name, factor in columns]
        table.add_row(
            "–" if when is None else when.strftime("%Y-%m-%d"),
            row["session"],
            *([] if narrow else [outcome_words(row)]),
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
            largest = largest_of(_told(row, name)[0] for row in rows)
            unit = screen_unit(contents.units.get(name, "1"), largest)
            return f"{heading}\n{unit.symbol}", name, unit.factor
    return None


def _cell(row: Row, name: str, factor: float) -> str:
    value, alone = _told(row, name)
    text = fixed(value * factor, 2)
    return f"({text})" if alone and math.isfinite(value) else text


def _told(row: Row, name: str) -> tuple[float, bool]:
    """A number of a session, SI, and whether it is of an effect fitted alone that might be in the model."""
    inside = _value(row, IN_MODEL[name]) if name in IN_MODEL else math.nan
    return (inside, False) if math.isfinite(inside) else (_value(row, name), name in IN_MODEL)


def _alone_words(rows: Sequence[Row]) -> str:
    """What a friction in brackets is; empty where none is."""
    if not any(_told(row, name)[1] and math.isfinite(_value(row, name)) for name in IN_MODEL for row in rows):
        return ""
    return (
        "Friction: of the session's last model; in brackets, where that does not hold it, of a fit with this "
        "friction alone, which takes up what is of other effects."
    )


def _value(row: Row, name: str) -> float:
    value: Any = row.get(name)
    return float(value) if isinstance(value, (int, float)) else math.nan


def _trends_table(found: Sequence[Trend]) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("quantity")
    for title in ("median", "unit", "per month", "90 % interval", "", "sessions"):
        table.add_column(title, justify="left" if title in ("unit", "") else "right", no_wrap=True)
    for trend in found:
        *cells, sessions = trend_cells(trend)
        table.add_row(*cells, "*" if trend.changes else "", sessions)
    return table

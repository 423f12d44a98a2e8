"""``fingerlab batch``: every session below a folder, one row each, and how the bench ages."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import json_option, progress_bar, tell_own_effects, write_json
from fingerlab.core.errors import UserError

if TYPE_CHECKING:
    from fingerlab.batch.rows import Options
    from fingerlab.batch.run import BatchResult, Runner
    from fingerlab.batch.table import Trend

TOLD_FAILURES = 5
"""Failed sessions that are told one by one; the rest are in the table."""


@click.command(short_help="Diagnose every session below a folder.")
@click.argument("folder", metavar="FOLDER", type=click.Path(path_type=Path))
@click.option(
    "--out",
    required=True,
    metavar="T.parquet",
    type=click.Path(path_type=Path),
    help="Table, one row a session.",
)
@click.option("--dask", "address", metavar="ADDRESS", help="Let the Dask cluster at ADDRESS do the work.")
@click.option(
    "--add", "added", multiple=True, metavar="ID", help="Effect that the model holds already; repeatable."
)
@click.option("--jobs", type=click.IntRange(min=1), metavar="N", help="Diagnoses at a time; all cores.")
@click.option("--retry", is_flag=True, help="Try sessions again that could not be diagnosed.")
@json_option
def batch(
    folder: Path,
    out: Path,
    address: str | None,
    added: tuple[str, ...],
    jobs: int | None,
    retry: bool,
    json_target: str | None,
) -> None:
    """Diagnose every session below FOLDER, and show how the bench changed over time.

    A table that is there already is continued: a session in it, with the same content, program and effects,
    is not diagnosed again. Stopped or killed, it goes on where it was when the same command is given again.
    """
    if out.suffix.lower() != ".parquet":
        raise UserError(f"--out is {out}; the table is a Parquet file, so its name should end in .parquet.")
    if address is not None and jobs is not None:
        raise UserError("--jobs is for this machine alone; leave it out with --dask.")
    from fingerlab.batch.run import run_batch
    from fingerlab.batch.table import trends

    options = _options(added)
    bar, report = progress_bar("Batch")
    with bar:
        result = run_batch(folder, out, options, _runner(address, jobs, folder), retry, report)
    _tell(result, out)
    found = trends(result.contents.rows, result.contents.units)
    if json_target is not None:
        write_json(_to_json(folder, out, result, found), json_target)
    if json_target != "-":
        from fingerlab.cli.batch_summary import print_summary

        print_summary(result.contents, found)


def _options(added: tuple[str, ...]) -> Options:
    """What the diagnoses depend on; an unknown effect is found before the work."""
    from fingerlab.batch.rows import Options
    from fingerlab.effects import CATALOGUE, effect, own

    for name in added:
        effect(name)
    tell_own_effects()
    return Options(tuple(dict.fromkeys(added)), own.trusted_sources(CATALOGUE))


def _runner(address: str | None, jobs: int | None, folder: Path) -> Runner:
    from fingerlab.batch.run import locally, on_dask

    return locally(jobs) if address is None else on_dask(address, folder.resolve())


def _tell(result: BatchResult, out: Path) -> None:
    """What was done, on standard error."""
    words = f"{result.done} sessions diagnosed, {result.kept} were in the table already"
    if result.outdated:
        words += f"; {result.outdated} were done anew, as the program or your own effects have changed"
    if result.gone:
        words += f"; {result.gone} rows are of sessions that are no longer below the folder"
    click.echo(f"{words}. {out} holds {len(result.contents.rows)} rows.", err=True)
    if result.failed:
        count = len(result.failed)
        sessions = "session" if count == 1 else "sessions"
        click.echo(f"{count} {sessions} could not be diagnosed:", err=True)
        for row in result.failed[:TOLD_FAILURES]:
            click.echo(f"  {row['session']}: {row['error']}", err=True)
        if count > TOLD_FAILURES:
            click.echo(f"  and {count - TOLD_FAILURES} more; the table's column 'error' says why.", err=True)


def _to_json(folder: Path, out: Path, result: BatchResult, found: list[Trend]) -> dict[str, Any]:
    rows = result.contents.rows
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
        "trends": [vars(trend) | {"changes": trend.changes} for trend in found],
        "units": dict(result.contents.units),
        "rows": list(rows),
    }

"""``fingerlab diagnose``: where the model fails and which effect is missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from fingerlab.cli.common import json_option, progress_bar, refuse_existing, tell_own_effects, write_json
from fingerlab.parallel import second_process

if TYPE_CHECKING:
    from rich.table import Table

    from fingerlab.identify.results import Diagnosis


@click.command(short_help="Where the model fails and which effect is missing.")
@click.argument(
    "sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="S.h5 [S2.h5 ...]"
)
@click.option(
    "--add", "added", multiple=True, metavar="ID", help="Effect that the model holds already; repeatable."
)
@json_option
def diagnose(sessions: tuple[Path, ...], added: tuple[str, ...], json_target: str | None) -> None:
    """Compare model and measurement, rank the effects of the catalogue, and say which is missing.

    Errors are those on runs left out of the fit, in multiples of the bench's own repeatability: 1 is the
    floor.
    """
    if json_target not in (None, "-"):
        refuse_existing(Path(str(json_target)))
    with second_process(sessions, "fingerlab.identify.diagnosis.reduction") as executor:
        from fingerlab.identify.diagnosis import diagnose as run
        from fingerlab.sessions import open_session

        opened = [open_session(path) for path in sessions]
        tell_own_effects()
        bar, report = progress_bar("Diagnosing")
        with bar:
            result = run(opened, added, progress=report, with_curves=False, executor=executor)
    if json_target is not None:
        write_json(result.to_json(), json_target)
    if json_target != "-":
        print_diagnosis(result)


def print_diagnosis(result: Diagnosis) -> None:
    """The answer on the terminal, made to fit 80 columns: verdict first, then what it rests on."""
    from rich.text import Text

    from fingerlab.cli.output import table_console
    from fingerlab.report import diagnosis_words as words

    console = table_console()
    console.print(Text(f"\n{words.verdict_sentence(result)}\n", style="bold"))
    console.print(_errors(result))
    console.print()
    console.print(_ranking(result))
    console.print(f"error: with that effect in the model{'; * cannot be ruled out' if result.set else ''}\n")
    for candidate in words.shown_best_first(result)[: len(result.set)]:
        console.print(Text(f"{candidate.title}: {candidate.explanation}\n"))
    if len(result.set) > 1:
        console.print(Text(words.set_sentence(result)))
    if words.worth_adding(result):
        console.print(Text(words.path_sentence(result)))
        console.print(Text(f"To put it into the model: --add {words.worth_adding(result)[0]}"))
    proposal = words.next_experiment_sentence(result.next_experiment)
    if proposal is not None:
        console.print(Text(proposal))
    hidden = [c.effect for c in result.candidates if not c.detectable]
    if hidden:
        console.print(Text(f"These data could not show, at a plausible strength: {', '.join(hidden)}."))
    console.print(Text(f"{result.seconds:.1f} s", style="dim"))


def _errors(result: Diagnosis) -> Table:
    from rich.table import Table

    from fingerlab.report.page_tables import error_rows
    from fingerlab.report.screen import score_text

    table = Table(box=None, pad_edge=False, title_justify="left", title_style="")
    table.title = f"Error on runs left out of the fit: {score_text(result.score)} times the floor"
    table.add_column("equations")
    for title in ("error (rms)", "floor"):
        table.add_column(title, justify="right")
    table.add_column("unit")
    for title in ("error / floor", "R2"):
        table.add_column(title, justify="right")
    for row in error_rows(result.errors):
        table.add_row(row.title, row.error, row.floor, row.unit, row.times, row.r2)
    return table


def _ranking(result: Diagnosis) -> Table:
    """What is probable, with the ids that ``--add`` takes."""
    from rich.table import Table

    from fingerlab.report.page_tables import short_ranking

    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", no_wrap=True, justify="right")
    table.add_column("error", no_wrap=True, justify="right")
    table.add_column("", no_wrap=True)
    table.add_column("effect or outcome")
    table.add_column("id", no_wrap=True)
    for row in short_ranking(result):
        table.add_row(row.chance, row.score, "*" if row.in_set else "", row.title, row.effect)
    return table

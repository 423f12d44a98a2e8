"""``trial``: by how much the force error fell in a session of ``record --feed-forward --ab``."""

from __future__ import annotations

from pathlib import Path

import click

from fingerlab.cli.common import (
    PATH,
    json_option,
    refuse_taken_early,
    result_table,
    table_console,
    write_results,
)
from fingerlab.core.plain_data import json_ready
from fingerlab.prediction.trial import CAUSES, Trial, analyse_trial, trial_json
from fingerlab.report.trial import result_sentences, trial_row
from fingerlab.sessions import open_session


@click.command()
@click.argument("session_file", metavar="S.h5", type=PATH)
@click.option("--figures", metavar="DIR", type=PATH, help="Draw wanted and measured force into a folder.")
@json_option
def trial(session_file: Path, figures: Path | None, json_target: str | None) -> None:
    """Tell by how much the force error fell in a feed-forward trial, with a 90 % interval.

    Beside it stands what the found model had foretold, and what is left by cause: what differs from run to
    run, what is constant, in proportion, late, or against the direction of the force.
    """
    refuse_taken_early(None, figures)
    found = analyse_trial(open_session(session_file))
    if json_target != "-":
        _print(found, session_file.name)
    drawn = None
    if figures is not None:
        from fingerlab.report.trial import trial_figures

        drawn = (trial_figures(found), figures)
    write_results(json_ready(trial_json(found)), json_target, None, drawn)


def _print(found: Trial, name: str) -> None:
    console = table_console()
    rows = [trial_row(one) for one in (found.nominal, found.found) if one is not None]
    columns = ("model", ">runs", ">error, rms (mN)", ">foretold (mN)", ">largest (mN)", ">run to run (mN)")
    table = result_table(*columns, title=f"{name}: force wanted and measured", padding=(0, 1, 0, 0))
    causes = result_table("model", *(f">{cause}" for cause in CAUSES), title="The squared error by cause (%)")
    for row in rows:
        table.add_row(*row[: len(columns)])
        causes.add_row(row[0], *row[len(columns) :])
    console.print(table)
    console.print(causes)
    for sentence in result_sentences(found):
        console.print(sentence, soft_wrap=True)

"""``fingerlab replicate``: the thesis' experiment on the simulated rig, beside the published numbers."""

from __future__ import annotations

from collections.abc import Sequence

import click
from rich.table import Table

from fingerlab.cli.common import json_option, progress_bar, table_console, write_json
from fingerlab.core.progress import Watch
from fingerlab.report.replicate import (
    ComparedQuantity,
    cells,
    lines_json,
    outcome_sentences,
    replicated,
)


@click.command()
@click.option("--preset", default="as-built", show_default=True, help="as-built, practice, or a TOML file.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Bench and noise.")
@click.option(
    "--benches",
    type=click.IntRange(min=1, max=100),
    default=1,
    show_default=True,
    help="How many benches to draw within the tolerances, with this seed and the following ones.",
)
@json_option
def replicate(preset: str, seed: int, benches: int, json_target: str | None) -> None:
    """The thesis' experiment end to end on the simulated rig, beside the published numbers."""
    seeds = list(range(seed, seed + benches))
    bar, report = progress_bar("Replicating")
    with bar:
        lines = replicated(preset, seeds, Watch(report))
    if json_target is not None:
        write_json({"preset": preset, "seeds": seeds, **lines_json(lines)}, json_target)
    if json_target != "-":
        _print(lines)


def _print(lines: Sequence[ComparedQuantity]) -> None:
    console = table_console()
    console.print(_table(lines))
    for sentence in outcome_sentences(lines):
        console.print(sentence, soft_wrap=True)


def _table(lines: Sequence[ComparedQuantity]) -> Table:
    table = Table(title="The thesis' experiment on the simulated rig", title_justify="left")
    table.add_column("quantity")
    for title in ("published", "ours"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("")
    table.add_column("unit")
    for line in lines:
        table.add_row(*cells(line))
    return table

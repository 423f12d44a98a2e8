"""``fingerlab replicate``: the thesis' experiment on the simulated rig, beside the published numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import json_option, progress_bar, write_json

if TYPE_CHECKING:
    from rich.table import Table

    from fingerlab.report.replicate import Line


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
    from fingerlab.report.replicate import compare, lines_json

    seeds = list(range(seed, seed + benches))
    lines = compare(_analyses(preset, seeds))
    if json_target is not None:
        write_json({"preset": preset, "seeds": seeds, **lines_json(lines)}, json_target)
    if json_target != "-":
        _show(lines)


def _analyses(preset_name: str, seeds: Sequence[int]) -> list[Any]:
    """The published quantities of each bench, simulated and analysed as the thesis did."""
    from fingerlab.thesis.analysis import thesis_analysis
    from fingerlab.twin.preset import load_preset
    from fingerlab.twin.protocols import PROTOCOLS
    from fingerlab.twin.session import simulated_session

    preset = load_preset(preset_name)
    plans = PROTOCOLS["thesis"](preset.numbers["protocol"]["contact_amplitude_deg"])
    results = []
    bar, report = progress_bar("Replicating")
    with bar:
        for number, seed in enumerate(seeds):

            def part(share: float, what: str, start: float = 0.0, number: int = number) -> None:
                report((number + start + 0.5 * share) / len(seeds), what)

            session = simulated_session(preset, "thesis", plans, seed, part)
            analysis = thesis_analysis(session, lambda share, what: part(share, f"analysing {what}", 0.5))
            results.append(analysis.quantities)
    return results


def _show(lines: Sequence[Line]) -> None:
    from fingerlab.cli.output import table_console

    console = table_console()
    console.print(_table(lines))
    outside = [line for line in lines if line.outside]
    compared = sum(line.outside is not None for line in lines)
    console.print(
        f"{compared - len(outside)} of {compared} within the published spread"
        + (f"; outside, marked *: {', '.join(line.title for line in outside)}." if outside else "."),
        soft_wrap=True,
    )
    console.print(
        "Spread in brackets: the thesis prints none, and a tolerance of ours holds in its place "
        "(its reason is in the JSON).",
        soft_wrap=True,
    )


def _table(lines: Sequence[Line]) -> Table:
    from rich.table import Table

    from fingerlab.report.replicate import TOLERANCES

    table = Table(title="The thesis' experiment on the simulated rig", title_justify="left")
    table.add_column("quantity")
    for title in ("published", "ours"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("")
    table.add_column("unit")
    for line in lines:
        digits = 3 if line.unit == "1" else 2 if line.unit == "N" else 1
        published = "-"
        if line.published is not None:
            spread = f"± {line.tolerance:.{digits}f}"
            spread = f"({spread})" if line.key in TOLERANCES else spread
            published = f"{line.published:.{digits}f} {spread}"
        ours = _number(line.ours, digits)
        if math.isfinite(line.deviation):
            ours += f" ± {_number(line.deviation, digits)}"
        table.add_row(
            line.title, published, ours, "*" if line.outside else "", "" if line.unit == "1" else line.unit
        )
    return table


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "none"

"""``fingerlab replicate``: the thesis' experiment on the simulated rig, beside the published numbers.

A number is outside where it is further from the published value than the published deviation over runs. Where
the thesis prints no deviation, the tolerance below holds in its place; each says where it comes from.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import click
from rich.table import Table

from fingerlab.cli.common import json_option, progress_bar, table_console, write_json
from fingerlab.core.plain_data import json_ready
from fingerlab.thesis.analysis import PUBLISHED, Published, PublishedQuantity, thesis_analysis
from fingerlab.thesis.onair import Spread


@dataclass(frozen=True)
class Tolerance:
    """How far from the published value still counts as the same, in the quantity's unit."""

    value: float
    reason: str


_R2 = Tolerance(0.20, "median of the deviations that the thesis prints for an R2")
_PEAK = "30 % of the value: a single run in the thesis, and force peaks differ by that from run to run"

TOLERANCES: dict[str, Tolerance] = {
    "r2_flexion": _R2,
    "r2_extension": _R2,
    "r2_static_1": _R2,
    "r2_static_2": _R2,
    "peak_measured": Tolerance(0.15, _PEAK),
    "peak_extension": Tolerance(0.05, _PEAK),
    "peak_flexion": Tolerance(0.26, _PEAK),
    "r2_flexion_findsignal_30": Tolerance(0.05, "figure 4.14 shows all but two runs above 0.9"),
    "peak_share": Tolerance(7.0, "a quarter of the value: 'almost four times lower'"),
    "speed_change_mcp": Tolerance(1.0, "one percentage point: printed to 0.1"),
    "speed_change_pip": Tolerance(1.0, "one percentage point: printed to 0.1"),
    "r2_angle_60": Tolerance(0.10, "a single run in the thesis, at angles 15 degrees apart"),
}
"""For quantities that the thesis prints without a deviation."""


@dataclass(frozen=True)
class ComparedQuantity:
    """One quantity, published and ours over the runs.

    ``tolerance`` and ``outside``, whether ours is further off than that, are None where nothing is published.
    """

    published: Published
    ours: Spread
    tolerance: Tolerance | None
    outside: bool | None


def compare(benches: Sequence[Iterable[PublishedQuantity]]) -> tuple[ComparedQuantity, ...]:
    """Every published quantity beside ours, in the thesis' order.

    Args:
        benches: the quantities of one analysis each; runs of several benches are taken together.
    """
    runs: dict[str, tuple[float, ...]] = {}
    for quantities in benches:
        for quantity in quantities:
            runs[quantity.key] = runs.get(quantity.key, ()) + quantity.runs
    return tuple(_compared(published, Spread(runs.get(published.key, ()))) for published in PUBLISHED)


def _compared(published: Published, ours: Spread) -> ComparedQuantity:
    if published.value is None:
        return ComparedQuantity(published, ours, None, None)
    if published.deviation is not None:
        tolerance = Tolerance(published.deviation, "deviation that the thesis prints")
    else:
        tolerance = TOLERANCES[published.key]
    # A number that our analysis could not give does not agree with a published one.
    outside = not math.isfinite(ours.mean) or abs(ours.mean - published.value) > tolerance.value
    return ComparedQuantity(published, ours, tolerance, outside)


def lines_json(lines: Sequence[ComparedQuantity]) -> Any:
    """For ``replicate --json``: numbers in the units of the table, null where there is none."""
    return json_ready(
        {
            "quantities": [
                {
                    "key": line.published.key,
                    "title": line.published.title,
                    "unit": line.published.unit,
                    "published": line.published.value,
                    "tolerance": None if line.tolerance is None else line.tolerance.value,
                    "tolerance_reason": "" if line.tolerance is None else line.tolerance.reason,
                    "ours": line.ours.mean,
                    "deviation": line.ours.deviation,
                    "outside": line.outside,
                }
                for line in lines
            ],
            "outside": [line.published.key for line in lines if line.outside],
            "compared": sum(line.outside is not None for line in lines),
        }
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
    lines = compare(_analyses(preset, seeds))
    if json_target is not None:
        write_json({"preset": preset, "seeds": seeds, **lines_json(lines)}, json_target)
    if json_target != "-":
        _print(lines)


def _analyses(preset_name: str, seeds: Sequence[int]) -> list[Any]:
    """The published quantities of each bench, simulated and analysed as the thesis did."""
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


def _print(lines: Sequence[ComparedQuantity]) -> None:
    console = table_console()
    console.print(_table(lines))
    outside = [line.published.title for line in lines if line.outside]
    compared = sum(line.outside is not None for line in lines)
    console.print(
        f"{compared - len(outside)} of {compared} within the published spread"
        + (f"; outside, marked *: {', '.join(outside)}." if outside else "."),
        soft_wrap=True,
    )
    console.print(
        "Spread in brackets: the thesis prints none, and a tolerance of ours holds in its place "
        "(its reason is in the JSON).",
        soft_wrap=True,
    )


def _table(lines: Sequence[ComparedQuantity]) -> Table:
    table = Table(title="The thesis' experiment on the simulated rig", title_justify="left")
    table.add_column("quantity")
    for title in ("published", "ours"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("")
    table.add_column("unit")
    for line in lines:
        one = line.published
        digits = 3 if one.unit == "1" else 2 if one.unit == "N" else 1
        published = "-"
        if line.tolerance is not None:
            spread = f"± {line.tolerance.value:.{digits}f}"
            published = f"{one.value:.{digits}f} {f'({spread})' if one.key in TOLERANCES else spread}"
        ours = f"{line.ours.mean:.{digits}f}" if math.isfinite(line.ours.mean) else "none"
        if math.isfinite(line.ours.deviation):
            ours += f" ± {line.ours.deviation:.{digits}f}"
        table.add_row(
            one.title, published, ours, "*" if line.outside else "", "" if one.unit == "1" else one.unit
        )
    return table

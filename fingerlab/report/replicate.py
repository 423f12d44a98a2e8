"""Our numbers beside the published ones, with a mark at each that falls outside.

Outside means: further from the published value than the published deviation over runs. Where the thesis
prints no deviation, the tolerance below holds in its place; each says where it comes from.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fingerlab.thesis.analysis import PUBLISHED, Published, PublishedQuantity
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
class Line:
    """One quantity: published and ours, and whether ours falls outside (None where nothing is published)."""

    key: str
    title: str
    unit: str
    published: float | None
    tolerance: float | None
    tolerance_reason: str
    ours: float
    deviation: float
    outside: bool | None


def compare(benches: Sequence[Iterable[PublishedQuantity]]) -> tuple[Line, ...]:
    """Lines of the table, in the order of the published one.

    Args:
        benches: the quantities of one analysis each; runs of several benches are taken together.
    """
    runs: dict[str, tuple[float, ...]] = {}
    for quantities in benches:
        for quantity in quantities:
            runs[quantity.key] = runs.get(quantity.key, ()) + quantity.runs
    return tuple(_line(published, Spread(runs.get(published.key, ()))) for published in PUBLISHED)


def _line(published: Published, ours: Spread) -> Line:
    if published.value is None:
        return Line(
            published.key, published.title, published.unit, None, None, "", ours.mean, ours.deviation, None
        )
    if published.deviation is not None:
        tolerance = Tolerance(published.deviation, "deviation that the thesis prints")
    else:
        tolerance = TOLERANCES[published.key]
    # A number that our analysis could not give does not agree with a published one.
    outside = not math.isfinite(ours.mean) or abs(ours.mean - published.value) > tolerance.value
    return Line(
        published.key,
        published.title,
        published.unit,
        published.value,
        tolerance.value,
        tolerance.reason,
        ours.mean,
        ours.deviation,
        outside,
    )


def lines_json(lines: Sequence[Line]) -> dict[str, Any]:
    """For ``replicate --json``: numbers in the units of the table, null where there is none."""

    def number(value: float | None) -> float | None:
        return value if value is not None and math.isfinite(value) else None

    return {
        "quantities": [
            {
                "key": line.key,
                "title": line.title,
                "unit": line.unit,
                "published": line.published,
                "tolerance": line.tolerance,
                "tolerance_reason": line.tolerance_reason,
                "ours": number(line.ours),
                "deviation": number(line.deviation),
                "outside": line.outside,
            }
            for line in lines
        ],
        "outside": [line.key for line in lines if line.outside],
        "compared": sum(line.outside is not None for line in lines),
    }

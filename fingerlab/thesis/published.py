"""The numbers that the thesis published, by key, and ours in the same form.

Source: thesis chapters 4 and 5, as collected in the table of ``physics.md``. Where the print gives no
deviation none is made up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fingerlab.thesis.pooling import Spread


@dataclass(frozen=True)
class Published:
    """A published number: key, what it is, unit, value and standard deviation (None where not printed)."""

    key: str
    title: str
    unit: str
    value: float | None
    deviation: float | None = None


PUBLISHED: tuple[Published, ...] = (
    Published("r2_flexion", "R2 of the regression, MCP and PIP, flexion", "1", 0.587),
    Published("r2_extension", "R2 of the regression, MCP and PIP, extension", "1", 0.733),
    Published("r2_static_1", "R2 of the regression, MCP and PIP, static 1", "1", 0.319),
    Published("r2_static_2", "R2 of the regression, MCP and PIP, static 2", "1", 0.230),
    Published("r2_pip_extension", "R2 of the regression, PIP, extension", "1", 0.844, 0.203),
    Published("r2_pip_static_1", "R2 of the regression, PIP, static 1", "1", 0.406, 0.319),
    Published("r2_pip_static_2", "R2 of the regression, PIP, static 2", "1", 0.213, 0.176),
    Published("r2_force_four_regions", "R2 of the force, four regions", "1", 0.36, 0.13),
    Published("peak_measured", "Peak force, measured", "N", 0.50),
    Published("peak_extension", "Peak force, extension parameters", "N", 0.16),
    Published("peak_flexion", "Peak force, flexion parameters", "N", 0.88),
    Published("delay_finddelay", "Delay of LHS after tension, finddelay", "ms", 162.2, 23.2),
    Published("delay_xcorr", "Delay of LHS after tension, cross-correlation round the period", "ms", None),
    Published("r2_extension_finddelay_20", "R2, PIP extension, finddelay, 20 %", "1", 0.450, 0.242),
    Published("r2_flexion_findsignal_30", "R2, PIP flexion, findsignal, 30 %", "1", 0.98),
    Published("peak_share", "Modelled peak as a share of the measured, findsignal 10 %", "%", 27.16),
    Published("r2_normalised", "R2 of the normalised force, findsignal 10 %", "1", 0.97, 0.01),
    Published("speed_change_mcp", "Speed range in contact against on air, MCP", "%", -99.5),
    Published("speed_change_pip", "Speed range in contact against on air, PIP", "%", -98.1),
    Published("r2_angle_60", "R2 of the force with the contact angle at 60°", "1", 0.885),
)
"""In the order of the published table; the one without a value is ours alone."""


@dataclass(frozen=True)
class Quantity:
    """One of our numbers beside the published one; NaN where the session cannot give it.

    ``value`` and ``deviation`` are in ``unit`` and over runs; ``runs`` holds the single values.
    """

    key: str
    title: str
    unit: str
    value: float
    deviation: float
    runs: tuple[float, ...]
    published: float | None
    published_deviation: float | None


def beside_published(ours: Mapping[str, Spread]) -> tuple[Quantity, ...]:
    """Our numbers in the order of the published table.

    Args:
        ours: values over runs for every key of ``PUBLISHED``, in the unit given there.
    """
    return tuple(
        Quantity(
            p.key,
            p.title,
            p.unit,
            ours[p.key].mean,
            ours[p.key].deviation,
            ours[p.key].values,
            p.value,
            p.deviation,
        )
        for p in PUBLISHED
    )

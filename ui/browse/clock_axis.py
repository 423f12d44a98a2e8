"""Time of day above the run's own time, as the lab notes have it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

import pyqtgraph as pg


class ClockAxis(pg.AxisItem):
    """Labels seconds of a run with the clock; empty while it is not known when the run began."""

    def __init__(self) -> None:
        super().__init__("top")
        self.began: datetime | None = None

    def set_began(self, began: datetime | None) -> None:
        """The moment at which the run's time is 0."""
        self.began = began
        self.picture = None
        self.update()

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[Any]:
        if self.began is None:
            return ["" for _ in values]
        return [clock_text(self.began, value, spacing) for value in values]


def clock_text(began: datetime, seconds: float, resolution: float) -> str:
    """Time of day, with as many decimals as steps of ``resolution`` seconds need."""
    decimals = 0 if resolution >= 1 else 1 if resolution >= 0.1 else 2 if resolution >= 0.01 else 3
    moment = began + timedelta(seconds=round(seconds, decimals))
    text = f"{moment:%H:%M:%S}"
    return f"{text}.{moment.microsecond:06d}"[: len(text) + 1 + decimals] if decimals else text

"""The control loop's measured cycle on the screen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel

from fingerlab.acquisition.ring import COLUMN, CycleTimes, RowFlag
from fingerlab.devices.faults import Faults

from ..hands import child


def test_the_measured_cycle_is_shown_beside_the_late_ones(connect_rig) -> None:  # type: ignore[no-untyped-def]
    rig = connect_rig(Faults(lost={1500: 3}))

    def shown() -> str:
        return next(part for part in rig.label("statusDevice").split(" · ") if part.startswith("cycle"))

    rig.run(1.0)
    assert shown() == "cycle 1.00 ms, longest 1.00 ms"
    rig.run(1.0)
    assert shown() == "cycle 1.00 ms, longest 4.00 ms"  # at 1 kHz, three cycles were lost
    assert "mean and longest" in child(rig.window, QLabel, "statusDevice").toolTip()
    rig.run(10.0)
    assert shown() == "cycle 1.00 ms, longest 1.00 ms"  # ten seconds later it is forgotten


def test_starting_anew_is_no_cycle() -> None:
    def rows(*entries: tuple[int, float, int]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        made = np.zeros((len(entries), len(COLUMN)))
        for row, (index, cycle, flags) in zip(made, entries, strict=True):
            row[[COLUMN["index"], COLUMN["cycle_time"], COLUMN["flags"]]] = index, cycle, flags
        return made

    cycles = CycleTimes(1000.0)
    assert math.isnan(cycles.longest)
    cycles.take(rows((0, 0.8, 0), (1, 0.0010, 0), (2, 0.0012, 0)))
    assert (cycles.mean, cycles.longest) == (pytest.approx(0.0011), 0.0012)
    lost = int(RowFlag.LOST_BEFORE)
    cycles.take(rows((500, 0.5, 0), (501, 0.001, 0), (504, 0.003, lost)))
    assert cycles.longest == 0.003
    assert cycles.mean == pytest.approx(0.0062 / 4)

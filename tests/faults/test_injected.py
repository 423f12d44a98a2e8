"""Faults other than kills: the motor is at zero in time, and no more than a quarter of a second is lost."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from tests.faults.injected import FAULTS, Fault, inject, possible


@pytest.mark.parametrize("card", [False, True], ids=["fake bench", "virtual card"])
@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_fault_stops_the_motor_in_time_and_costs_a_quarter_of_a_second_at_most(
    fault: Fault, card: bool, tmp_path: Path
) -> None:
    if not possible(fault, card):
        pytest.skip("no such fault here: of the system's files, or of a card's clock")
    seen = inject(fault, tmp_path, card)
    assert seen.lost_s <= 0.25
    assert re.search(fault.words, seen.sentence)
    if fault.most_ms is None:
        assert seen.reaction_ms is None
        assert seen.sentence == ""
    else:
        assert seen.reaction_ms is not None
        assert seen.reaction_ms <= (fault.card_ms if card and fault.card_ms else fault.most_ms)


@pytest.mark.parametrize("name", ["monotonic", "perf_counter"])
def test_the_clocks_that_loop_and_recorder_take_cannot_be_set(name: str) -> None:
    told = time.get_clock_info(name)
    assert told.monotonic
    assert not told.adjustable

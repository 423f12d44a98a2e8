"""Killed processes: the motor is told zero, and what was flushed can be read. The sweep has hundreds more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.killing import VICTIMS, kill_once


@pytest.mark.parametrize(("after", "motion"), [(0.25, "angle"), (0.6, "torque")])
@pytest.mark.parametrize("victim", VICTIMS)
def test_a_killed_process_stops_the_motor_and_loses_a_quarter_of_a_second_at_most(
    tmp_path: Path, victim: str, after: float, motion: str
) -> None:
    """Torque: what a wanted force needs by a model, which no position loop would hold back."""
    outcome = kill_once(tmp_path, victim, after, motion=motion)
    assert outcome.zero
    assert outcome.moving
    if victim != "loop":  # cycles of the bench, which waits for a machine that is busy; the sweep counts them
        assert outcome.plant_ms <= 250
    assert outcome.lost_s <= 0.25
    assert outcome.flushed_lost == 0
    assert outcome.wrong == 0
    assert outcome.kept >= 1000 * after - 250
    assert outcome.ended == "truncated"
    assert not (tmp_path / "session.h5.recording").exists()

"""What is new since the last look: a fault is not lost for what it made of the run."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fingerlab.acquisition.bench.bench import Kind, Status, notices
from fingerlab.acquisition.control.machine import Mode

WORTH = "Run 001 is not usable: 40 of 900 samples are missing."


@pytest.fixture
def recording() -> Status:
    return Status(
        mode=Mode.RUNNING, latched=False, enabled=True, index=900, cycles=860, late=0, lost=40, faults=0,
        fault="", run=1, run_start=0, run_active=True, recording=1, recorded=900, recorded_runs=0, unread=0,
        free_bytes=10**12, recorder="", device="simulated", loop_ended=False, safe_confirmed=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("fault", "ended"),
    [("The loop was too late.", False), ("", True), ("The loop's process is gone.", True)],
)
def test_a_run_that_a_fault_made_useless_is_told_with_that_fault(
    recording: Status, fault: str, ended: bool
) -> None:
    """Both stand in one place of the window, where the later sentence takes the place of the earlier."""
    stopped = replace(recording, fault=fault, faults=1, loop_ended=ended, recording=0)
    (first,) = notices(recording, stopped, 1000.0)
    assert first.kind is Kind.STOPPED
    assert first.grave
    written = replace(stopped, recorded_runs=1, verdict=WORTH, usable=False)
    for before in (stopped, recording):  # a look later, or at once
        last = notices(before, written, 1000.0)[-1]
        assert last.kind is Kind.RUN
        assert last.grave
        assert last.sentence == f"{first.sentence} {WORTH}"


def test_a_run_alone_is_told_by_itself(recording: Status) -> None:
    for usable in (True, False):
        written = replace(recording, recording=0, recorded_runs=1, verdict=WORTH, usable=usable)
        (only,) = notices(recording, written, 1000.0)
        assert (only.sentence, only.grave) == (WORTH, not usable)

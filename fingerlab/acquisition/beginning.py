"""Where a recorded run begins, and what it says of its motion: by hand, by protocol and from a script."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fingerlab.acquisition.bench import Bench
from fingerlab.acquisition.board import Slot
from fingerlab.acquisition.commands import SetUp
from fingerlab.acquisition.recording import RunInfo

LONGEST_BEFORE_S = 25.0
"""Pre-trigger: well within the shortest ring."""


def run_to_record(
    bench: Bench,
    set_up: SetUp,
    trajectory: Mapping[str, Any],
    before_s: float = 0.0,
    at: int | None = None,
    stop: int | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> RunInfo:
    """A run that begins ``before_s`` seconds before sample ``at``, the next one where it is None.

    It reaches back to where the sensors' references and the set-up of now began to hold, and with a known
    load to where the load was carried. Its attributes tell of the seconds before (``pre_trigger_s``) and,
    where its time is not the trajectory's own, when that began in it (``trajectory_start_s``).

    Args:
        stop: index after its last sample; None until it is ended. attributes: further ones.
    """
    status = bench.status()
    at = status.index + 1 if at is None else at
    start = max(at - round(before_s * bench.rate_hz), min(bench.board[Slot.SET_AT], at), 0)
    if set_up.load_torque:
        start = max(start, status.run_start)
    further: dict[str, Any] = {}
    if at > start:
        further["pre_trigger_s"] = (at - start) / bench.rate_hz
    if status.run_active and status.run_start != start:
        further["trajectory_start_s"] = (status.run_start - start) / bench.rate_hz
    return RunInfo(
        set_up.phase,
        set_up.cable,
        bench.rate_hz,
        trajectory,
        start,
        stop,
        set_up.load_torque,
        {**(attributes or {}), **further},
    )

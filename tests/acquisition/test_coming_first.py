"""The loop asks the system to run before other programs, as far as that hurts nobody."""

from __future__ import annotations

import os
import sys

import pytest

from fingerlab.acquisition.bench import processes as process

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has this class of programs")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Classes and priorities that were asked for; nothing is granted."""
    found: list[tuple[int, int]] = []

    def refuse(_pid: int, policy: int, parameter: os.sched_param) -> None:
        found.append((policy, parameter.sched_priority))
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "setpriority", lambda *_: None)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    return found


def test_a_loop_that_waits_for_a_clock_asks_for_real_time_and_goes_on_without(
    asked: list[tuple[int, int]],
) -> None:
    process.come_first(paced=True)
    assert asked == [(os.SCHED_RR, process.REAL_TIME)]


def test_a_loop_that_never_waits_does_not_ask(asked: list[tuple[int, int]]) -> None:
    process.come_first(paced=False)
    assert asked == []


def test_the_only_core_is_not_taken(asked: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    process.come_first(paced=True)
    assert asked == []

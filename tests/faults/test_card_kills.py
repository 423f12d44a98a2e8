"""Kills at the virtual card, driven by the real nidaqmx package. The sweep has a hundred more."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fingerlab.acquisition.check_rig import walk
from tests.faults.killing import kill_once
from tests.faults.killing_checks import STEPS, Kill, NotSoFar, kill_check
from tests.faults.live_card import Served, served

TRIES = 60
"""Checks until one is not stopped before by a control loop that came late. Beside three programs that take
both cores, four in five are, where this one may not come before others; 0.8^60 is one in a million."""


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(tmp_path_factory.mktemp("card") / "output") as serving:
        yield serving


@pytest.mark.parametrize(
    ("victim", "how"), [("loop", "SIGKILL"), ("recorder", "SIGTERM"), ("window", "SIGKILL")]
)
def test_the_card_is_told_zero_whoever_dies(tmp_path: Path, card: Served, victim: str, how: str) -> None:
    outcome = kill_once(tmp_path, victim, 0.4, how, card)
    assert outcome.zero
    assert outcome.moving
    assert outcome.plant_ms <= 250  # on a machine that is busy; the sweep counts them
    assert outcome.flushed_lost == 0
    assert outcome.wrong == 0


def killed_in(card: Served, step: str, how: str) -> Kill:
    """The first of some checks that comes as far as ``step``; a busy machine stops many on its own."""
    why: set[str] = set()
    for _ in range(TRIES):
        try:
            kill = kill_check(card, step, how, 0.3)
        except NotSoFar as early:
            why.add(str(early))
            continue
        if not kill.too_late:  # the loop had stopped the motor by itself
            return kill
    pytest.fail(f"{TRIES} checks in turn ended before '{step}', though nobody killed them: {why}")


def test_a_check_is_killed_in_each_of_its_steps() -> None:
    assert {step.partition(",")[0] for step in STEPS} == {step.name for step in walk.STEPS}


@pytest.mark.parametrize(
    ("step", "how"),
    [
        ("drive", "SIGKILL"),
        ("drive", "SIGTERM"),
        ("drive, line low", "SIGKILL"),
        ("output", "SIGTERM"),
        ("dead_man", "SIGKILL"),
    ],
)
def test_a_check_that_is_killed_leaves_no_set_value(card: Served, step: str, how: str) -> None:
    kill = killed_in(card, step, how)
    assert kill.driven
    assert kill.enabled is (step in ("drive", "dead_man"))
    assert kill.zero
    assert kill.plant_ms <= 250
    assert kill.ended

"""Simulated benches with nothing missing but noise, tolerances and wandering friction raise no alarm."""

from __future__ import annotations

import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.twin.protocols import PROTOCOLS, RunPlan, load_preset
from fingerlab.twin.session import simulated_session


def shortened(seconds: float = 12.0) -> list[RunPlan]:
    """The rich protocol with shorter runs: the same kinds of run, both cables and contact."""
    preset = load_preset()
    plans = PROTOCOLS["rich"](preset.numbers["protocol"]["contact_amplitude_deg"])
    return [RunPlan(p.phase, p.cable, {**p.trajectory, "duration_s": seconds}) for p in plans]


@pytest.mark.parametrize("seed", [101, 105])
def test_nothing_missing_is_said_so(seed: int) -> None:
    session = simulated_session(load_preset(), "rich", shortened(), seed)
    result = diagnose([session], with_curves=False)
    assert result.verdict == "nothing_missing"
    assert result.odds is not None
    assert result.odds.nothing > 0.8
    hidden = [one for one in result.candidates if one.in_set and not one.detectable]
    assert len(hidden) <= 3  # what a short rich protocol could not show
    assert len(result.set) <= 4  # and what constants of the rig speak for
    assert result.score < 1.5

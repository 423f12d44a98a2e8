"""Spikes are found where they were put, lost samples are bridged, and neither costs more than itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.signals.filters import bridged, without_spikes
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.sessions.model import Run

from . import closed_form as made

TIME = np.arange(20_000) / 1000.0
MOTION = 0.3 * np.sin(2 * np.pi * TIME) + 0.05 * np.sin(2 * np.pi * 7 * TIME)


def noisy(step: float) -> np.ndarray:
    """A motion with noise, read in steps of ``step``; as it is for 0."""
    values = MOTION + 1e-3 * np.random.default_rng(1).standard_normal(len(MOTION))
    return np.round(values / step) * step if step else values


@pytest.mark.parametrize("step", [0.0, 7e-4, 2e-2])
@pytest.mark.parametrize("size", [0.3, -2.0])
def test_spikes_are_found_where_they_were_put(step: float, size: float) -> None:
    clean = noisy(step)
    places = np.array([400, 401, 3000, 7777, 12_345, 19_500])
    values = clean.copy()
    values[places] += size
    repaired, spikes = without_spikes(values)
    assert spikes.tolist() == places.tolist()
    assert np.abs(repaired - clean).max() < max(8e-3, 1.5 * step)


def test_a_clean_channel_is_left_as_it_is() -> None:
    stepping = np.where(TIME % 2.0 < 1.0, 0.2, -0.2) + 1e-3 * np.sin(50 * TIME)
    for values in (noisy(0.0), noisy(7e-4), np.zeros_like(TIME), stepping, np.round(MOTION / 0.05) * 0.05):
        same, spikes = without_spikes(values)
        assert len(spikes) == 0
        assert same is values


def test_a_channel_full_of_spikes_is_of_that_kind() -> None:
    values = noisy(0.0)
    values[::20] += 1.0
    assert len(without_spikes(values)[1]) == 0


def test_lost_samples_are_bridged_on_a_line() -> None:
    kept = np.delete(np.arange(len(TIME)), [500, 501, 502, 9000])
    found, count = bridged({"time": TIME[kept], "x": MOTION[kept]}, 1000.0)
    assert count == 4
    assert found["time"] == pytest.approx(TIME)
    # A line over 4 ms is off by at most an eighth of the square of that times the acceleration.
    most = 0.3 * (2 * np.pi) ** 2 + 0.05 * (14 * np.pi) ** 2
    assert np.abs(found["x"] - MOTION).max() <= 0.125 * 0.004**2 * most


def test_a_long_gap_is_not_bridged() -> None:
    kept = np.delete(np.arange(len(TIME)), np.arange(500, 550))
    found, count = bridged({"time": TIME[kept]}, 1000.0)
    assert count == 0
    assert len(found["time"]) == len(kept)


def test_thirty_lost_samples_cost_no_time() -> None:
    session = made.session(made.Bench(), 2, contact=0)
    run = session.runs[0]
    whole = sum(len(m.time) - m.lead for m in segments_of(run, session.rig))
    kept = np.delete(np.arange(run.length), np.linspace(2500, 9800, 30).astype(int))
    channels = {name: values[kept] for name, values in run.load().items()}
    names = {"name": run.name, "phase": run.phase, "cable": run.cable}
    torn = Run.from_arrays(channels, **names, sample_rate_hz=made.RATE, trajectory=run.trajectory)
    segments = list(segments_of(torn, replace(session, runs=(torn,)).rig))
    assert sum(m.repairs.get("time", 0) for m in segments) == 30
    assert sum(len(m.time) - m.lead for m in segments) == pytest.approx(whole, abs=1)

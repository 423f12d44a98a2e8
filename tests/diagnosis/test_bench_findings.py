"""What is wrong with a bench is told with its size and what to do, and does not hide the physics."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.sessions.model import Run, Session

from . import closed_form as made
from .test_run_constants import ZEROS_RAD, spoiled


def with_spikes(session: Session, channel: str, every: int) -> Session:
    """Each ``every``-th sample of a channel off by half a unit."""
    runs = []
    for run in session.runs:
        channels = run.load()
        channels[channel] = channels[channel] + np.where(np.arange(run.length) % every == 7, 0.5, 0.0)
        names = {"name": run.name, "phase": run.phase, "cable": run.cable}
        runs.append(
            Run.from_arrays(channels, **names, sample_rate_hz=run.sample_rate_hz, trajectory=run.trajectory)
        )
    return replace(session, runs=tuple(runs))


def test_moved_zeros_and_spikes_are_told_with_their_size_beside_the_effect() -> None:
    bench = made.Bench(missing=made.Missing(viscous=(3e-3, 2e-3)))
    session = with_spikes(spoiled(ZEROS_RAD, np.zeros(4), bench), "pip_angle", 1000)
    found = diagnose([session])
    assert found.candidates[0].effect == "viscous_friction"
    assert found.path[-1].score < 1.3
    moved, spikes = found.bench
    assert (moved.kind, moved.channel, moved.unit) == ("moving_zero", "mcp_angle", "rad")
    # One run of each free motion, four in contact: these alone moved.
    assert 0.5 < moved.size / ZEROS_RAD.std(ddof=1) < 1.2
    assert re.findall(r"by [\d.]+(.{8})", moved.text) == [" degrees", " degrees"]  # each number has its unit
    assert "calibrate" in moved.text
    seconds = sum(run.seconds - 2.0 for run in session.runs)
    assert (spikes.kind, spikes.channel) == ("spikes", "pip_angle")
    assert "put on the line between their neighbours" in spikes.text  # as the share of the time is told
    assert 0.9 < spikes.size / seconds <= 1.0
    assert found.to_json()["bench"][1]["runs"] == [run.name for run in session.runs]
    # Each is shaded where it was put: 7 ms behind every full second.
    first = next(one for one in found.comparisons if one.equation == "pip_torque")
    shaded = [one for one in first.aside if one.reason == "spikes"]
    assert [0.5 * (one.start + one.stop) for one in shaded] == pytest.approx(
        [k + 0.007 for k in range(int(first.time[0]) + 1, int(first.time[-1]) + 1)], abs=1e-6
    )
    told = [one for one in found.excluded_by_motion if one.reason == "spikes"]
    assert sum(one.seconds for one in told) == pytest.approx(0.001 * spikes.size, rel=0.02)
    # What is shaded of a run and what is judged of it are all of it.
    length = next(run.seconds for run in session.runs if run.name == first.run)
    edges = [(one.start, one.stop) for one in first.aside if one.reason == "ramp"]
    assert sum(stop - start for start, stop in edges) + 0.04 * len(first.time) == pytest.approx(length)
    ramp = next(one for one in found.excluded_by_motion if one.reason == "ramp" and first.run in one.runs)
    assert 1.0 - 0.04 * len(first.time) / length == pytest.approx(ramp.share, abs=0.01)


def test_a_clean_bench_has_no_findings() -> None:
    found = diagnose([spoiled(np.zeros(4), np.zeros(4), made.Bench())], with_curves=False)
    assert found.bench == ()
    assert found.verdict == "nothing_missing"


def test_a_channel_that_is_lost_in_a_run_costs_that_run_and_is_told() -> None:
    session = made.session(made.Bench(), 4, contact=0)
    first = session.runs[0]
    names = {"name": first.name, "phase": first.phase, "cable": first.cable}
    left = {name: values for name, values in first.load().items() if name != "pip_angle"}
    without = Run.from_arrays(left, **names, sample_rate_hz=first.sample_rate_hz, trajectory=first.trajectory)
    found = diagnose([replace(session, runs=(without, *session.runs[1:]))], with_curves=False)
    assert found.verdict == "nothing_missing"
    (lost,) = found.bench
    assert (lost.kind, lost.channel, lost.runs) == ("missing_channel", "pip_angle", (first.name,))


def test_a_skew_between_the_channels_is_told() -> None:
    """Joint angles a sample late: in the closed form they were read at once."""
    session = made.session(made.Bench(), 4, contact=0)
    runs = []
    for run in session.runs:
        channels = run.load()
        for name in ("mcp_angle", "pip_angle"):
            channels[name] = np.interp(channels["time"] - 6e-4, channels["time"], channels[name])
        names = {"name": run.name, "phase": run.phase, "cable": run.cable}
        runs.append(
            Run.from_arrays(channels, **names, sample_rate_hz=run.sample_rate_hz, trajectory=run.trajectory)
        )
    (skew,) = diagnose([replace(session, runs=tuple(runs))], with_curves=False).bench
    assert (skew.kind, skew.unit) == ("skew", "s")
    assert 5e-4 < skew.size < 7e-4

"""Spikes are found where they were put, lost samples are bridged, and neither costs more than itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.filters import (
    BRIDGED,
    CUT_OUT,
    UNEVEN,
    at_even_times,
    between_readings,
    bridged,
    landing_samples,
    readings_of,
    usual_wait,
    without_spikes,
)
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.sessions.model import Run

from . import closed_form as made

TIME = np.arange(20_000) / 1000.0
MOTION = 0.3 * np.sin(2 * np.pi * TIME) + 0.05 * np.sin(2 * np.pi * 7 * TIME)


def noisy(step: float) -> np.ndarray:
    """A motion with noise, read in steps of ``step``; as it is for 0."""
    values = MOTION + 1e-3 * np.random.default_rng(1).standard_normal(len(MOTION))
    return np.round(values / step) * step if step else values


@pytest.mark.parametrize("where", [slice(-3, None), slice(0, 2)])
def test_a_stop_at_the_end_of_a_log_is_no_pulse_that_was_measured(where: slice) -> None:
    """A kilonewton in the last three samples; in the middle so many in a row would be kept."""
    time = np.arange(2000) / 500.0
    values = np.sin(6.0 * time) + 0.01 * np.random.default_rng(0).standard_normal(len(time))
    spoiled = values.copy()
    spoiled[where] = 1000.0
    repaired, spikes = without_spikes(spoiled)
    assert spikes.tolist() == np.arange(len(time))[where].tolist()
    assert repaired == pytest.approx(values, abs=0.1)
    assert len(without_spikes(values)[1]) == 0
    standing = np.round(values, 1)
    standing[-8:] = standing[-1] - 0.1  # the last step of a coarse encoder
    standing[-1] += 0.1
    assert len(without_spikes(standing)[1]) == 0


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


def test_the_knock_of_a_tip_that_lands_is_no_spike() -> None:
    """2 N for two milliseconds, once a second, before the force of 0.5 N; one glitch while it presses is."""
    rate = 1000
    force = 0.01 * np.random.default_rng(5).standard_normal(10 * rate)
    landings = np.arange(rate // 2, 10 * rate, rate)
    for at in landings:
        force[at : at + rate // 4] += 0.5
        force[at : at + 2] += 2.0
    glitch = int(landings[3]) + rate // 8
    force[glitch] += 2.0
    kept, spikes = without_spikes(force, landing_samples(rate))
    assert spikes.tolist() == [glitch]
    assert kept[landings] == pytest.approx(force[landings])
    assert len(without_spikes(force)[1]) > len(landings)  # of another channel each is one
    force[-3:] = 1000.0  # a stop at the end of the log, with the tip clear before, is none all the same
    assert without_spikes(force, landing_samples(rate))[1].tolist() == [glitch, *range(9997, 10_000)]


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


def at(times: np.ndarray) -> np.ndarray:
    """The motion at these times."""
    return 0.3 * np.sin(2 * np.pi * times) + 0.05 * np.sin(2 * np.pi * 7 * times)


def test_samples_that_came_early_or_late_are_taken_at_their_times() -> None:
    rng = np.random.default_rng(5)
    taken = np.sort(TIME + 0.25e-3 * rng.standard_normal(len(TIME)))
    taken = np.delete(taken, np.arange(7000, 7050))  # a gap too long to be bridged
    found, counts = at_even_times({"time": taken, "motor_position": at(taken)}, 1000.0, 0)
    assert np.diff(found["time"]).max() == pytest.approx(0.051, abs=0.002)
    assert np.median(np.diff(found["time"])) == pytest.approx(1e-3)
    # A line over 2.5 ms is off by at most an eighth of the square of that times the acceleration.
    most = 0.3 * (2 * np.pi) ** 2 + 0.05 * (14 * np.pi) ** 2
    assert np.abs(found["motor_position"] - at(found["time"])).max() <= 0.125 * 0.0025**2 * most
    # Beyond 0.4 deviations of the first sample's grid: 69 % of it in time, 80 % of it half late.
    assert 0.68 < counts[UNEVEN] / len(TIME) < 0.81
    assert counts[CUT_OUT] == pytest.approx(50, abs=2)


def test_times_of_packets_are_not_those_of_their_samples() -> None:
    stamps = np.sort(TIME + 0.3e-3 * np.random.default_rng(6).standard_normal(len(TIME)))
    for samples in ({"time": stamps, "motor_position": MOTION}, {"time": TIME, "motor_position": MOTION}):
        found, counts = at_even_times(samples, 1000.0, 0)
        assert counts == {}
        assert found["motor_position"] is MOTION


def held(values: np.ndarray, waits: np.ndarray) -> np.ndarray:
    """What is logged of a channel that is read again after so many samples each time."""
    readings = np.cumsum(waits)
    readings = np.concatenate(([0], readings[readings < len(values)]))
    return values[readings][np.searchsorted(readings, np.arange(len(values)), side="right") - 1]


@pytest.mark.parametrize("waits", [(10, 11), (6, 15)])
def test_a_channel_on_a_staircase_is_taken_at_its_readings(waits: tuple[int, int]) -> None:
    rng = np.random.default_rng(2)
    logged = held(MOTION, rng.integers(*waits, len(MOTION)))
    readings = readings_of(logged, usual_wait(logged, 60.0))
    found = between_readings(logged[readings], readings, len(logged))
    # A cubic over h is off by at most 5/384 h^4 of the fourth derivative (de Boor, A Practical Guide to
    # Splines, ch. V); at the ends a few times that.
    fourth = 0.3 * (2 * np.pi) ** 4 + 0.05 * (14 * np.pi) ** 4
    middle = slice(100, -100)
    assert np.abs(found - MOTION)[middle].max() < 2.0 * 5 / 384 * (waits[1] - 1) ** 4 * 1e-12 * fourth
    assert np.abs(logged - MOTION)[middle].max() > 50.0 * np.abs(found - MOTION)[middle].max()


def test_what_stands_still_was_read_all_the_while() -> None:
    moving = np.where(TIME % 4.0 < 2.0, np.sin(2 * np.pi * TIME), 0.0)  # stands from 2 s to 4 s, and so on
    logged = held(moving, np.full(len(moving), 10))
    readings = readings_of(logged, usual_wait(logged, 60.0))
    found = between_readings(logged[readings], readings, len(logged))
    assert np.abs(found - moving)[2050:3980].max() < 0.02
    assert np.abs(found - moving)[18_050:].max() < 0.02  # and at the end


def test_channels_that_are_read_with_each_sample_are_not_held() -> None:
    told = np.repeat(np.random.default_rng(3).uniform(-1.0, 1.0, 40), 500)  # steps that are told, and held
    stepping = np.where(TIME % 2.0 < 1.0, 0.2, -0.2) + 1e-3 * np.sin(50 * TIME)
    coarse = [np.round(MOTION / step) * step for step in (0.05, 2e-2, 1e-3)]
    coarse += [values.astype(np.float32).astype(float) + 3.0 for values in coarse]  # and rounded
    for values in (noisy(0.0), noisy(7e-4), np.zeros_like(TIME), stepping, told, *coarse):
        assert usual_wait(values, 60.0) == 1


@pytest.mark.parametrize("channel", ["motor_torque", "pip_angle"])
def test_a_channel_that_is_held_changes_no_verdict(channel: str) -> None:
    session = made.session(made.Bench(), 4, contact=0)
    usual = diagnose([session], with_curves=False)
    runs = []
    for run in session.runs:
        channels = {name: np.asarray(values) for name, values in run.load().items()}
        channels[channel] = held(channels[channel], np.full(run.length, 5))
        names = {"name": run.name, "phase": run.phase, "cable": run.cable}
        runs.append(Run.from_arrays(channels, **names, sample_rate_hz=made.RATE, trajectory=run.trajectory))
    found = diagnose([replace(session, runs=tuple(runs))], with_curves=False)
    assert (found.verdict, found.set) == (usual.verdict, usual.set)
    told = [one for one in found.bench if one.kind == "held"]
    assert [one.channel for one in told] == [channel]
    every = sum(run.length for run in session.runs)
    assert told[0].size == pytest.approx(0.8 * every, rel=0.25)


def test_thirty_lost_samples_cost_no_time() -> None:
    session = made.session(made.Bench(), 2, contact=0)
    run = session.runs[0]
    whole = sum(len(m.time) - m.lead for m in segments_of(run, session.rig))
    kept = np.delete(np.arange(run.length), np.linspace(2500, 9800, 30).astype(int))
    channels = {name: values[kept] for name, values in run.load().items()}
    names = {"name": run.name, "phase": run.phase, "cable": run.cable}
    torn = Run.from_arrays(channels, **names, sample_rate_hz=made.RATE, trajectory=run.trajectory)
    segments = list(segments_of(torn, replace(session, runs=(torn,)).rig))
    assert sum(m.repairs.get(BRIDGED, 0) for m in segments) == 30
    assert sum(len(m.time) - m.lead for m in segments) == pytest.approx(whole, abs=1)

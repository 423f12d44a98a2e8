"""The bench one sample at a time: the same physics as a whole run, to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.integrate import position_loop
from fingerlab.twin.plant import OUTPUTS, STATE
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.recording import (
    PERIOD,
    BenchStream,
    bridge_angle,
    prepare_bench,
    seeded_truth,
    simulate_run,
)

PRACTICE = load_preset()
TRUTH, _ = seeded_truth(PRACTICE, 5)
MOTION = {"kind": "chirp", "amplitude_deg": 9, "frequency_hz": 1, "offset_deg": 24, "duration_s": 3}
SETUPS = {
    "on_air": ("extension", ["coulomb_friction", "capstan_friction", "viscoelastic_creep"]),
    "contact": ("flexion", ["contact_angle", "cable_stretch", "motor_presliding"]),
    "motor_bench": ("none", ["motor_coulomb_friction", "torque_ripple"]),
}


@pytest.mark.parametrize("phase", SETUPS)
def test_a_stream_under_the_twins_own_loop_is_the_twins_run(phase: str) -> None:
    cable, names = SETUPS[phase]
    plan = RunPlan(phase, cable, MOTION, load_torque=0.03)
    effects = parse_effects(names)
    whole = simulate_run(PRACTICE, TRUTH, plan, effects, np.random.default_rng(3))
    control = prepare_bench(PRACTICE, TRUTH, plan, effects, np.random.default_rng(3)).control
    stream = BenchStream(PRACTICE, TRUTH, plan, effects, np.random.default_rng(3))
    memory = np.zeros(1, STATE)[0]
    seen = []
    for wanted in read_trajectory(MOTION).command(np.arange(3000) / 1000):
        seen.append(stream.now)
        stream.advance(position_loop(control, memory, stream.now[0], wanted, PERIOD))
    for k, name in enumerate(OUTPUTS):
        assert np.array_equal(np.array(seen)[:, k], whole.truth[name]), name


def test_sensors_of_a_stream_are_those_of_a_recording() -> None:
    """Delay, bridge and noise, by way of what really was."""
    plan = RunPlan("on_air", "extension", MOTION)
    effects = parse_effects(["transport_delay=0.0123", "angle_sensor_nonlinearity", "sensor_drift"])
    stream = BenchStream(PRACTICE, TRUTH, plan, effects, np.random.default_rng(3))
    truth, seen = [], []
    for k in range(4000):
        stream.advance(0.25 + 0.2 * math.sin(0.01 * k))
        truth.append(stream.now)
        seen.append(stream.seen())
    truth_of = dict(zip(OUTPUTS, np.array(truth).T, strict=True))
    force, mcp, pip, current, counts = np.array(seen).T
    assert np.array_equal(counts, np.floor(truth_of["theta"] / (2 * math.pi / 8600)))
    assert (current - truth_of["current"]).std() == pytest.approx(
        math.hypot(0.020, 0.005 / 12**0.5), rel=0.05
    )
    time = np.arange(4000) / 1000
    late = {name: np.interp(time - 0.0123, time, truth_of[name]) for name in ("q1", "q2", "force")}
    sensors = prepare_bench(PRACTICE, TRUTH, plan, effects, np.random.default_rng(3)).sensors
    wide, offset = 1 + sensors.bridge_mismatch, sensors.bridge_offset
    for name, angle in (("q1", mcp), ("q2", pip)):
        true = late[name]
        bent = 0.5 * np.arctan2(np.sin(2 * true) + offset, wide * np.cos(2 * true))
        bent -= 0.5 * math.atan2(offset, wide)
        if name == "q1":  # warm-up with a time constant of half a run of 30 s
            bent += sensors.drift * (1 - np.exp(-(time + 0.001) / 15)) / (1 - math.exp(-2))
        error = np.degrees(angle - bent)[20:]
        assert abs(error.mean()) < 0.01
        assert error.std() == pytest.approx(math.hypot(0.05, 0.04 / 12**0.5), rel=0.05)
    assert force.std() == pytest.approx(0.015, rel=0.06)
    assert bridge_angle(0.3, sensors) != 0.3


def test_a_motor_bench_has_no_finger_to_see() -> None:
    stream = BenchStream(PRACTICE, TRUTH, RunPlan("motor_bench", "none", {}), {}, np.random.default_rng(1))
    stream.advance(0.1)
    force, mcp, pip, current, counts = stream.seen()
    assert all(math.isnan(v) for v in (force, mcp, pip))
    assert current == pytest.approx(0.1, abs=0.15)
    assert counts >= 0


def test_a_stream_that_runs_away_says_so() -> None:
    effects = parse_effects(["motor_viscous_friction=-50"])
    stream = BenchStream(
        PRACTICE, TRUTH, RunPlan("on_air", "extension", {}), effects, np.random.default_rng(1)
    )

    def drive() -> None:
        for _ in range(20000):
            stream.advance(0.5)

    with pytest.raises(UserError, match="ran away"):
        drive()

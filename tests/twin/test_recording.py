"""Recordings of the simulated bench: converged, repeatable, and of the kind that the sensors allow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.twin.bench import build_bench, draw_truth
from fingerlab.twin.effects import apply_effects, parse_effects
from fingerlab.twin.protocols import PROTOCOLS, RunPlan, load_preset, single_run
from fingerlab.twin.recording import STEPS, approach, drive, simulate_session

PRACTICE = load_preset()
SHORT = {"kind": "chirp", "amplitude_deg": 11.0, "frequency_hz": 0.5, "offset_deg": 22.0, "duration_s": 6.0}
ON_AIR = RunPlan("on_air", "extension", SHORT)


def drive_with(effects: list[str], plan: RunPlan, steps: int) -> dict[str, Any]:
    """True motion with a fine encoder: counts would turn rounding into chance."""
    truth = draw_truth(PRACTICE, np.random.default_rng(4))
    bench = build_bench(PRACTICE, truth, plan.cable)
    chosen = parse_effects(effects)
    apply_effects(bench, chosen)
    bench.control["count"] = 1e-12
    trajectory = dict(plan.trajectory)
    if plan.phase == "contact":
        trajectory["offset_deg"] = approach(PRACTICE, truth, chosen, plan.cable)
    command = read_trajectory(trajectory).command(np.arange(6000) / 1000)
    return drive(bench, command, plan.phase == "contact", steps)


@pytest.mark.parametrize(
    "effects", [[], ["coulomb_friction"], ["capstan_friction"], ["cable_slack"], ["motor_presliding"]]
)
def test_halving_the_step_changes_less_than_the_sensors_see(effects: list[str]) -> None:
    """A thousandth of a degree and a milliampere, where the sensors resolve 0.04 degrees and 5 mA."""
    for plan in (ON_AIR, PROTOCOLS["contact"](2.0)[0]):
        coarse, fine = drive_with(effects, plan, STEPS), drive_with(effects, plan, 2 * STEPS)
        for name, limit in (("q1", 2e-5), ("q2", 2e-5), ("theta", 2e-5), ("current", 1e-3), ("force", 5e-3)):
            assert np.sqrt(np.mean((coarse[name] - fine[name]) ** 2)) < limit, name


def test_same_seed_same_recording_to_the_last_bit() -> None:
    first, again, other = (next(iter(simulate_session(PRACTICE, [ON_AIR], {}, seed))) for seed in (7, 7, 8))
    for name, values in first.channels.items():
        assert np.array_equal(values, again.channels[name])
        if name != "motor_command":
            assert not np.array_equal(values, other.channels[name])


def test_static_balance_holds_in_the_recording() -> None:
    """At rest under the cable: spring and weight equal arm times tension; torque over radius too."""
    hold = {
        "kind": "ramp_hold",
        "amplitude_deg": 10.0,
        "frequency_hz": 0.1,
        "offset_deg": 22.0,
        "duration_s": 10.0,
    }
    run = next(iter(simulate_session(PRACTICE, [RunPlan("on_air", "extension", hold)], {}, 3)))
    truth = draw_truth(PRACTICE, np.random.default_rng(np.random.SeedSequence(3).spawn(1)[0]))
    f = {k: v * truth.factors[k] for k, v in vars(PRACTICE.rig.finger).items()}
    last = {name: float(values[4000:4900].mean()) for name, values in run.truth.items()}
    weight2 = (
        f["distal_mass"]
        * 9.81
        * f["distal_half_length"]
        * math.cos(last["q1"] + last["q2"] - f["wrist_angle"])
    )
    weight1 = weight2 + 9.81 * (f["proximal_mass"] + 2 * f["distal_mass"]) * f[
        "proximal_half_length"
    ] * math.cos(f["wrist_angle"] - last["q1"])
    arm1, arm2 = truth.arms["extension"]
    assert (weight1 - f["mcp_stiffness"] * last["q1"]) / arm1 == pytest.approx(last["tension"], rel=2e-3)
    assert (weight2 - f["pip_stiffness"] * last["q2"]) / arm2 == pytest.approx(last["tension"], rel=2e-3)
    torque = 0.0302 * truth.factors["torque_constant"] * 4.3 * last["current"]
    radius = 0.015 * truth.factors["pulley_radius"]
    assert torque / radius == pytest.approx(last["pulley_tension"], rel=5e-3)


def test_sensors_have_the_resolution_and_noise_of_their_data_sheets() -> None:
    run = next(iter(simulate_session(PRACTICE, [ON_AIR], {}, 1)))
    counts = run.channels["motor_position"] / (2 * math.pi / 8600)
    assert np.allclose(counts, np.round(counts), atol=1e-6)
    steps = np.degrees(run.channels["mcp_angle"]) / 0.04
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    noise = run.channels["mcp_angle"] - run.truth["q1"]
    assert np.degrees(noise.std()) == pytest.approx(math.hypot(0.05, 0.04 / math.sqrt(12)), rel=0.05)
    assert run.channels["endpoint_force"].std() == pytest.approx(0.015, rel=0.05)
    np.testing.assert_allclose(run.channels["motor_torque"], 0.0302 * 4.3 * run.channels["motor_current"])


def test_slack_cable_never_pushes() -> None:
    run = next(iter(simulate_session(PRACTICE, [ON_AIR], parse_effects(["cable_slack=6e-3"]), 1)))
    assert run.truth["tension"].min() == 0.0
    assert (run.truth["tension"] == 0.0).mean() > 0.2


def test_operator_finds_the_contact_force_that_the_protocol_wants() -> None:
    plan = PROTOCOLS["contact"](2.0)[0]
    for effects in ([], ["cable_stretch"], ["capstan_friction"]):
        run = next(iter(simulate_session(PRACTICE, [plan], parse_effects(effects), 5)))
        force = run.truth["force"][5000:]
        assert force.mean() == pytest.approx(0.8, abs=0.35)
        free = next(
            iter(simulate_session(PRACTICE, [PROTOCOLS["thesis"](2.0)[0]], parse_effects(effects), 5))
        )
        assert np.ptp(run.truth["q2"][5000:]) < 0.05 * np.ptp(free.truth["q2"][5000:])


def test_proposed_run_is_taken_as_proposed() -> None:
    plan = single_run('{"kind": "sine", "amplitude_deg": 8, "frequency_hz": 2, "offset_deg": 20}', "on_air")
    assert (plan.phase, plan.cable) == ("on_air", "extension")
    run = next(iter(simulate_session(PRACTICE, [plan], {}, 1)))
    position = np.degrees(run.truth["theta"][4000:])
    assert position.mean() == pytest.approx(20.0, abs=0.3)
    assert np.ptp(position) / 2 == pytest.approx(8.0, abs=0.5)
    spectrum = np.abs(np.fft.rfft(position - position.mean()))
    assert np.argmax(spectrum) / (len(position) / 1000) == pytest.approx(2.0, abs=0.05)


def test_bench_that_runs_away_is_told_in_one_sentence() -> None:
    with pytest.raises(UserError, match="ran away"):
        list(simulate_session(PRACTICE, [ON_AIR], parse_effects(["motor_viscous_friction=-50"]), 1))

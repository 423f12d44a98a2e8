"""The population of benches: what is drawn, and what a bench of another size, rate and care records."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions import Run, Session, check_session, open_session
from fingerlab.twin.effects import EFFECTS
from tests.hidden.sweep.disguise import DIRT, Size, decimated, dirty, noisier, resized
from tests.hidden.sweep.surroundings import KINDS, open_varied, population, record_varied, surroundings
from tests.hidden.sweep.trials import Trial

RIG = Rig(
    Finger(0.012, 0.014, 0.023, 0.024, 2.3e-6, 2.8e-6, 0.115, 0.062),
    Motor(pulley_radius=0.015, inertia=2.9e-4),
    {"inertia": 0.2},
)


def session(seconds: float = 20.0) -> Session:
    time = np.arange(0.0, seconds, 1e-3)
    current = 0.3 + 0.2 * np.sin(2 * math.pi * time)
    channels = {
        "motor_command": np.sin(2 * math.pi * time),
        "motor_position": np.sin(2 * math.pi * time),
        "motor_current": current,
        "motor_torque": RIG.motor.torque_constant * RIG.motor.gear_ratio * current,
        "mcp_angle": 0.4 + 0.2 * np.sin(2 * math.pi * time),
        "pip_angle": 0.3 + 0.1 * np.sin(2 * math.pi * time),
        "endpoint_force": 0.5 + 0.1 * np.sin(2 * math.pi * time),
    }
    told = {"kind": "sine", "frequency_hz": 1.0, "amplitude_deg": 57.3, "duration_s": seconds}
    run = Run.from_arrays(channels, phase="contact", cable="flexion", trajectory=told)
    return Session(Path("made up"), "made up", "", RIG, (run,))


def weights(one: Session) -> tuple[float, float, float, float]:
    """Torques of a finger at one moment, N m: weight, spring, inertia of the motion, pull of the force."""
    f, run = one.rig.finger, one.runs[0]
    assert f is not None
    angle, time = run.channel("mcp_angle"), run.channel("time")
    acceleration = np.gradient(np.gradient(angle, time), time)
    return (
        f.proximal_mass * f.gravity * f.proximal_half_length,
        f.mcp_stiffness * float(angle[250]),
        f.proximal_inertia * float(acceleration[250]),
        2 * f.distal_half_length * float(run.channel("endpoint_force")[250]),
    )


def test_a_bench_of_another_size_has_every_torque_in_the_same_proportion() -> None:
    size = Size(mass=20.0, length=0.5, time=1.7)
    torque = 20.0 * 0.5**2 / 1.7**2  # kg m^2 / s^2
    before, after = session(), resized(session(), size)
    assert weights(after) == pytest.approx([torque * w for w in weights(before)], rel=1e-6)
    run, motor = after.runs[0], after.rig.motor
    told = motor.torque_constant * motor.gear_ratio * run.channel("motor_current")
    assert run.channel("motor_torque") == pytest.approx(told)
    assert run.channel("motor_torque")[77] == pytest.approx(
        torque * before.runs[0].channel("motor_torque")[77]
    )
    assert run.sample_rate_hz == pytest.approx(1000.0 / 1.7)
    assert run.trajectory["frequency_hz"] == pytest.approx(1.0 / 1.7)
    assert run.trajectory["duration_s"] == pytest.approx(20.0 * 1.7)
    assert run.seconds == pytest.approx(20.0 * 1.7)
    assert motor.inertia == pytest.approx(2.9e-4 * 20.0 * 0.25)
    assert after.rig.tolerance == before.rig.tolerance


def test_rate_and_noise_change_nothing_else() -> None:
    slow = decimated(session(), 4).runs[0]
    assert slow.sample_rate_hz == 250.0
    assert slow.channel("mcp_angle") == pytest.approx(session().runs[0].channel("mcp_angle")[::4])
    loud = noisier(session(), 3.0, np.random.default_rng(1)).runs[0]
    added = loud.channel("mcp_angle") - session().runs[0].channel("mcp_angle")
    # With what is there already, 0.05 degrees, three times as much: sqrt(9 - 1) of it is added.
    assert np.std(added) == pytest.approx(math.radians(0.05) * math.sqrt(8.0), rel=0.02)


@pytest.mark.parametrize("kind", DIRT)
def test_dirt_is_what_it_says(kind: str) -> None:
    clean, spoilt = session().runs[0], dirty(session(), (kind,), np.random.default_rng(5)).runs[0]
    if kind == "gaps":
        steps = np.diff(spoilt.channel("time"))
        assert 0 < clean.length - spoilt.length <= 4 * clean.length / 3000 + 4
        assert (steps > 1.5e-3).sum() == pytest.approx(clean.length / 3000, abs=1)
        return
    change = {name: spoilt.channel(name) - clean.channel(name) for name in clean.units}
    touched = {name for name, by in change.items() if np.abs(by).max() > 1e-9}
    current = {"motor_current", "motor_torque"}
    assert (
        touched
        == {
            "zeros": {"mcp_angle", "pip_angle"},
            "offset": current,
            "hum": current,
            "skew": {"mcp_angle"},
            "spikes": {*current, "mcp_angle", "pip_angle", "endpoint_force"},
        }[kind]
    )
    if kind in ("zeros", "offset"):
        assert all(np.ptp(change[name]) < 1e-12 for name in touched)
    if kind == "hum":
        assert np.abs(change["motor_current"]).max() == pytest.approx(0.05, rel=1e-3)
    if kind == "spikes":
        assert (np.abs(change["pip_angle"]) > 0.3).mean() == pytest.approx(1 / 2000, rel=0.8)
    if kind == "skew":
        # Late by 1.5 ms: the difference is the speed times as much.
        assert np.abs(change["mcp_angle"]).max() == pytest.approx(1.5e-3 * 0.4 * math.pi, rel=0.01)


def test_population_holds_what_it_promises() -> None:
    every = list(population(1, 4000))
    assert [t.seed for t in every] == list(range(1, 4001))
    assert len({t.key for t in every}) == len(every)
    kinds = Counter("outside" if t.left_out else len(t.effects) for t in every)
    assert kinds[0] / 4000 == pytest.approx(KINDS["nothing"], abs=0.02)
    assert kinds[2] / 4000 == pytest.approx(KINDS["pairs"], abs=0.02)
    assert kinds["outside"] / 4000 == pytest.approx(KINDS["outside"], abs=0.02)
    for parity in (0, 1):  # the trials that are fitted to, and those that judge
        counted = Counter(t.effects[0] for t in every if len(t.effects) == 1 and t.seed % 2 == parity)
        assert set(counted) == set(EFFECTS)
        assert min(counted.values()) > 0.5 * max(counted.values())
    assert {(t.source, t.protocol) for t in every} == {
        *((s, p) for s in ("twin", "engine") for p in ("rich", "thesis", "short")),
        ("twin", "motor-bench"),
    }
    around = [surroundings(t) for t in every]
    mass = np.log10([a.size.mass for a in around])
    assert np.ptp(mass) == pytest.approx(3.0, abs=0.05)
    assert np.mean(mass > 0) == pytest.approx(0.5, abs=0.03)
    assert np.mean([bool(a.dirt) for a in around]) == pytest.approx(1 / 3, abs=0.03)


def test_a_recorded_bench_is_the_same_each_time_and_at_any_size(tmp_path: Path) -> None:
    trial = Trial("twin", "short", ("coulomb_friction",), 6, varied=True)
    record_varied(trial, tmp_path / "one.h5")
    record_varied(trial, tmp_path / "two.h5")
    one, two = open_session(tmp_path / "one.h5"), open_session(tmp_path / "two.h5")
    assert not check_session(one).errors
    for a, b in zip(one.runs, two.runs, strict=True):
        assert np.array_equal(a.channel("motor_torque"), b.channel("motor_torque"))
    size, resized_one = surroundings(trial).size, open_varied(trial, tmp_path / "one.h5")
    assert len(resized_one.runs) == len(one.runs)
    assert resized_one.runs[0].seconds == pytest.approx(one.runs[0].seconds * size.time)
    assert resized_one.rig.motor.pulley_radius == pytest.approx(0.015 * size.length)

"""Scales of a machine: units and their powers, and a session in reduced units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.scales import (
    SI,
    Scales,
    as_recorded,
    find_scales,
    powers_of,
    reduced_sessions,
    scaled_trajectory,
)
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.physics.friction_states import slip_state
from fingerlab.physics.motion import Motion, strongest_lines
from fingerlab.rig.file import Finger, Motor, Rig, default_rig
from fingerlab.sessions.model import Run, Session

MADE = Scales(torque=8.0, length=2.0, time=0.5)


@pytest.mark.parametrize(
    ("unit", "powers"),
    [
        ("N m", (1, 0, 0, 0)), ("N", (1, -1, 0, 0)), ("m/N", (-1, 2, 0, 0)), ("kg m^2", (1, 0, 2, -1)),
        ("kg", (1, -2, 2, -1)), ("N m s/rad", (1, 0, 1, -1)), ("N m/rad^3", (1, 0, 0, -3)),
        ("m s/N", (-1, 2, 1, 0)), ("m/s^2", (0, 1, -2, 0)), ("rad/s", (0, 0, -1, 1)), ("deg", (0, 0, 0, 1)),
        ("1/turn", (0, 0, 0, -1)), ("1", (0, 0, 0, 0)), ("mN m", (1, 0, 0, 0)), ("Hz", (0, 0, -1, 0)),
        ("of the distal length", (0, 0, 0, 0)), ("N m/A", (1, 0, 0, 0)),
    ],
)  # fmt: skip
def test_a_unit_says_how_it_grows_with_torque_length_time_and_angle(
    unit: str, powers: tuple[int, int, int, int]
) -> None:
    assert powers_of(unit) == powers


def _session(rig: Rig, frequency: float = 1.0, rate: float = 1000.0, torque: float = 1.0) -> Session:
    time = np.arange(round(20.0 / frequency * rate / 1000.0 * 1000.0)) / rate
    position = 0.3 + 0.2 * np.sin(2 * np.pi * frequency * time)
    run = Run.from_arrays(
        {"motor_position": position, "motor_torque": torque * position, "endpoint_force": torque * position},
        sample_rate_hz=rate,
        trajectory={"kind": "custom", "frequency_hz": frequency, "amplitude_deg": 12.0, "load_torque": 0.4},
    )
    return Session(Path("made.h5"), "made", "", rig, (run,))


def test_the_finger_of_the_thesis_is_told_in_si() -> None:
    session = _session(default_rig())
    assert find_scales([session]) == SI
    assert reduced_sessions([session], SI)[0] is session


def test_scales_grow_with_the_machine_as_the_units_do() -> None:
    """Torques eight times, lengths twice, times half as large; masses follow, kg = N s^2/m."""
    rig = default_rig()
    finger = rig.finger
    assert finger is not None
    large = Finger(
        finger.proximal_mass * 0.5, finger.distal_mass * 0.5, finger.proximal_half_length * 2,
        finger.distal_half_length * 2, finger.proximal_inertia * 2, finger.distal_inertia * 2,
        finger.mcp_stiffness * 8, finger.pip_stiffness * 8, finger.wrist_angle, finger.gravity * 8,
    )  # fmt: skip
    session = _session(replace(rig, finger=large), frequency=2.0, rate=2000.0, torque=8.0)
    found = find_scales([session])
    assert (found.torque, found.length, found.time) == pytest.approx((8.0, 2.0, 0.5), rel=1e-12)
    reduced = reduced_sessions([session], found)[0]
    assert vars(reduced.rig.finger or finger) == pytest.approx(vars(finger), rel=1e-12)
    run, usual = reduced.runs[0], _session(rig).runs[0]
    assert run.sample_rate_hz == pytest.approx(1000.0)
    assert run.trajectory == {
        "kind": "custom", "frequency_hz": 1.0, "amplitude_deg": 12.0, "load_torque": pytest.approx(0.05),
    }  # fmt: skip
    for name in ("time", "motor_position", "motor_torque"):
        assert run.channel(name, 5, 9) == pytest.approx(usual.channel(name, 5, 9), rel=1e-12)
    assert run.channel("endpoint_force", 5, 9) == pytest.approx(2.0 * usual.channel("endpoint_force", 5, 9))
    assert as_recorded(run) is session.runs[0]


def test_constants_that_a_rig_does_not_give_stay_unknown() -> None:
    session = _session(Rig(default_rig().finger, Motor()))
    motor = reduced_sessions([session], MADE)[0].rig.motor
    assert (motor.inertia, motor.pulley_radius, motor.gear_ratio) == (None, None, 4.3)
    assert motor.torque_constant == pytest.approx(0.0302 / 8.0)


def test_a_proposed_trajectory_is_told_in_si() -> None:
    told = {
        "kind": "sine",
        "frequency_hz": 3.0,
        "amplitude_deg": 9.0,
        "duration_s": 20.0,
        "load_torque": 0.05,
    }
    assert scaled_trajectory(told, MADE) == {
        "kind": "sine", "frequency_hz": 6.0, "amplitude_deg": 9.0, "duration_s": 10.0, "load_torque": 0.4,
    }  # fmt: skip


def _alone(
    frequency: float = 1.0, rate: float = 1000.0, torque: float = 1.0, seconds: float = 20.0
) -> Session:
    session = _session(Rig(None, Motor()), frequency, rate, torque)
    length = round(seconds * rate)
    runs = tuple(replace(run, phase="motor_bench", cable="none", length=length) for run in session.runs)
    return replace(session, runs=runs)


def test_a_motor_alone_is_as_large_as_its_torque() -> None:
    """A sine of 0.2 N m has a standard deviation of 0.2 / sqrt(2), the thesis' motor one of 0.04 N m."""
    found = find_scales([_alone()])
    assert found.torque == pytest.approx(0.2 / np.sqrt(2) / 0.04, rel=1e-3)
    assert (found.length, found.time) == (1.0, 1.0)
    assert find_scales([_alone(torque=100.0)]).torque == pytest.approx(100.0 * found.torque, rel=1e-9)


@pytest.mark.parametrize(
    ("factor", "linear", "angle"),
    # A sine of 0.2 rad is 0.141 rad root mean square, above 0.05; on an arc of 10 mm 1.41 mm of an axis along
    # a line, of which 200 mm are 0.2 rad.
    [(1.0, False, 1.0), (0.36, False, 1.0), (0.35, False, 0.5), (2.0, True, 2.0**-7 / 0.01),
     (1.0, True, 2.0**-8 / 0.01), (1e-3, False, 2.0**-9), (1e-3, True, 2.0**-18 / 0.01)],
)  # fmt: skip
def test_a_motor_alone_that_hardly_moves_has_its_own_unit_of_angle(
    factor: float, linear: bool, angle: float
) -> None:
    session = _moved(_alone(), factor, {"axis": {"radius_m": 0.01}} if linear else {})
    found = find_scales([session])
    assert found.angle == angle
    reduced = reduced_sessions([session], found)[0].runs[0]
    given = session.runs[0].channel("motor_position", 0, 99)
    assert reduced.channel("motor_position", 0, 99) == pytest.approx(given / angle, rel=1e-12)
    assert reduced.trajectory["amplitude_deg"] == pytest.approx(12.0 / angle)
    (motion,) = segments_of(reduced, session.rig)
    assert motion.revolute == (not linear and angle == 1.0)
    largest = 0.2 * factor / angle * 2 * np.pi  # rad/s, of a sine of 1 Hz
    assert np.abs(motion.velocity[motion.lead :]).max() == pytest.approx(largest, rel=1e-2)


def _moved(session: Session, factor: float, extra: dict[str, object]) -> Session:
    """The session of a motor alone whose angle is ``factor`` times as large, with the same torque."""
    runs = []
    for run in session.runs:
        known = {name: run.channel(name, 0, run.length) for name in ("motor_position", "motor_torque")}
        known["motor_position"] = factor * known["motor_position"]
        runs.append(
            Run.from_arrays(
                known, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=run.sample_rate_hz,
                trajectory=run.trajectory,
            )
        )  # fmt: skip
    return replace(session, rig=replace(session.rig, extra=extra), runs=tuple(runs))


@pytest.mark.parametrize("extra", [{}, {"axis": {"radius_m": 0.01}}], ids=["turns", "along a line"])
def test_a_verdict_does_not_depend_on_how_far_a_motor_moves(extra: dict[str, object]) -> None:
    """Friction of a travel of 1 % of the motion, and 1/256 of both; a law of the catalogue in closed form."""
    time = np.arange(8000) / 500.0
    rng = np.random.default_rng(5)
    runs = []
    for number, tones in enumerate([(0.3, 0.7, 1.1), (0.5, 0.9, 1.7), (0.2, 0.6, 1.3)]):
        waves = [np.sin(2 * np.pi * tone * time + k) for k, tone in enumerate(tones)]
        position = 0.1 * np.sum(waves, axis=0)
        acceleration = np.gradient(np.gradient(position, time), time)
        torque = 0.03 * slip_state(position, np.radians(0.3)) + 1e-3 * acceleration
        known = {
            "motor_position": position,
            "motor_torque": torque + 1e-3 * rng.standard_normal(len(time)),
        }
        runs.append(
            Run.from_arrays(
                known, name=f"{number:03}", phase="motor_bench", cable="none", sample_rate_hz=500.0
            )
        )
    large = replace(_alone(), runs=tuple(runs))
    # As far as the largest that has a unit of its own, so that both are looked at in steps of the same size.
    usual = _moved(large, 0.25 if not extra else 1.0, extra)
    small = _moved(usual, 2.0**-8, extra)
    one, other = diagnose([usual]), diagnose([small])
    assert one.verdict == other.verdict == "missing_effect"
    for a, b in zip(one.candidates, other.candidates, strict=True):
        assert (a.effect, a.probability) == (b.effect, pytest.approx(b.probability, abs=1e-6))
    first = one.candidates[0]
    assert first.parameters["coulomb"].value == pytest.approx(0.03, rel=0.1)
    assert other.candidates[0].parameters["coulomb"].value == pytest.approx(first.parameters["coulomb"].value)
    travel = other.candidates[0].parameters["travel_deg"].value
    assert travel == pytest.approx(first.parameters["travel_deg"].value / 256.0, rel=1e-6)


@pytest.mark.parametrize(
    ("frequency", "rate", "seconds", "time"),
    [
        (1.0, 1000.0, 20.0, 1.0), (2.0, 1000.0, 20.0, 0.5), (0.25, 1000.0, 20.0, 4.0),
        (2.0, 100.0, 20.0, 1.0), (0.25, 1000.0, 6.0, 2.0), (1.0, 10000.0, 3.0, 1.0),
    ],
)  # fmt: skip
def test_time_follows_the_motion_as_far_as_rate_and_length_allow(
    frequency: float, rate: float, seconds: float, time: float
) -> None:
    """100 samples and three reduced seconds are needed at least."""
    assert find_scales([_alone(frequency, rate, seconds=seconds)]).time == time


@pytest.mark.parametrize(
    ("frequencies", "time"),
    [((0.1,) * 4 + (2.0,), 1.0), ((0.5, 1.0, 1.0, 2.0), 1.0), ((0.1, 0.1, 0.25), 8.0), ((0.25,) * 5, 4.0)],
)
def test_one_quick_run_among_slow_ones_is_not_lost(frequencies: tuple[float, ...], time: float) -> None:
    """The quickest run has 2 pi f at most twice 7 rad/s, told by octaves: 8 Hz over the time is its band."""
    runs = [_alone(frequency, 1000.0, seconds=60.0).runs[0] for frequency in frequencies]
    session = replace(_alone(1.0, 1000.0), runs=tuple(runs))
    assert find_scales([session]).time == time


@pytest.mark.parametrize(
    ("phase", "whose"), [("free", "finger"), ("on_air", "finger"), ("motor_bench", "motor alone")]
)
def test_a_run_that_lacks_a_channel_says_what_a_diagnosis_needs(phase: str, whose: str) -> None:
    run = Run.from_arrays({"motor_position": np.zeros(9)}, phase=phase, cable="none", sample_rate_hz=1e3)
    with pytest.raises(UserError, match=f"Run 001 has no channel '.*'; a diagnosis of the {whose} needs"):
        next(segments_of(run, Rig(None, Motor())))


@pytest.mark.parametrize("rate", [100.0, 200.0, 333.0, 1000.0, 10000.0])
def test_any_rate_is_read_at_250_hz(rate: float) -> None:
    """A sine of 2 Hz, its speed and acceleration, from runs of 3 s on; delays count in samples of 4 ms."""
    time = np.arange(round(3.0 * rate)) / rate
    run = Run.from_arrays(
        {"motor_position": np.sin(4 * np.pi * time), "motor_torque": np.cos(4 * np.pi * time)},
        phase="motor_bench", cable="none", sample_rate_hz=rate,
    )  # fmt: skip
    (motion,) = segments_of(run, Rig(None, Motor()))
    inner = slice(motion.lead, None)
    seen = motion.time[inner]
    assert motion.sample_rate_hz == pytest.approx(250.0, rel=1e-9)
    assert np.diff(motion.time) == pytest.approx(0.004, rel=1e-6)
    assert 2.5 < seen[-1] - seen[0] < 2.7  # it moves at once: 0.3 s at the start, and the ends of the filters
    size = 4 * np.pi
    assert motion.position[inner] == pytest.approx(np.sin(size * seen), abs=2e-3)
    assert motion.velocity[inner] == pytest.approx(size * np.cos(size * seen), abs=0.04 * size)
    assert motion.acceleration[inner] == pytest.approx(-(size**2) * np.sin(size * seen), abs=0.06 * size**2)


def test_ripple_orders_come_from_the_torque_over_the_angle() -> None:
    """A motor of 14 poles and 12 slots has 84; friction, inertia and noise beside it."""
    rng = np.random.default_rng(3)
    time = np.arange(5000) / 250.0
    angle = 1.3 * time + 3.0 * np.sin(0.9 * time)
    speed, acceleration = 1.3 + 2.7 * np.cos(0.9 * time), -2.43 * np.sin(0.9 * time)
    torque = 0.02 * np.sign(speed) + 1e-3 * acceleration + 2e-3 * np.sin(84 * angle)
    motion = Motion(
        phase="motor_bench", cable_sign=0, sample_rate_hz=250.0, time=time, position=angle, velocity=speed,
        acceleration=acceleration, torque=torque + 2e-3 * rng.standard_normal(len(time)), motor=Motor(),
    )  # fmt: skip
    orders = strongest_lines([motion])
    assert 84.0 in orders
    assert len(orders) <= 16

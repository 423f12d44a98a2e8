"""Scales of a machine: units and their powers, and a session in reduced units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis.signals.scales import (
    SI,
    Scales,
    as_recorded,
    find_scales,
    powers_of,
    reduced_sessions,
    scaled_trajectory,
)
from fingerlab.rig.constants import Finger, Motor, Rig
from fingerlab.rig.file import default_rig
from fingerlab.sessions.model import Run, Session

MADE = Scales(torque=8.0, length=2.0, time=0.5)


@pytest.mark.parametrize(
    ("unit", "powers"),
    [
        ("N m", (1, 0, 0)), ("N", (1, -1, 0)), ("m/N", (-1, 2, 0)), ("kg m^2", (1, 0, 2)), ("kg", (1, -2, 2)),
        ("N m s/rad", (1, 0, 1)), ("N m/rad^3", (1, 0, 0)), ("m s/N", (-1, 2, 1)), ("m/s^2", (0, 1, -2)),
        ("rad/s", (0, 0, -1)), ("1/turn", (0, 0, 0)), ("1", (0, 0, 0)), ("mN m", (1, 0, 0)),
        ("Hz", (0, 0, -1)),
        ("of the distal length", (0, 0, 0)), ("N m/A", (1, 0, 0)),
    ],
)  # fmt: skip
def test_a_unit_says_how_it_grows_with_torque_length_and_time(
    unit: str, powers: tuple[int, int, int]
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


def test_a_motor_alone_says_nothing_of_a_fingers_size() -> None:
    session = _session(Rig(None, Motor()))
    runs = tuple(replace(run, phase="motor_bench", cable="none") for run in session.runs)
    assert find_scales([replace(session, runs=runs)]) == SI

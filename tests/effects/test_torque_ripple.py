"""Lines of a motor's torque over its angle that have nothing to do with each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.effects import CATALOGUE
from fingerlab.physics.motion import Motion, strongest_lines
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Run, Session

LINES = {12.0: 4e-3, 7.0: 2.5e-3, 20.0: 1.5e-3}
"""Amplitudes in N m by periods a turn: slots, pole pairs, teeth."""


def _turning(number: int, rate: float = 500.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, angle and torque: to and fro by turns, so that inertia, drift and lines are apart."""
    time = np.arange(round(20.0 * rate)) / rate
    paces = np.array([(0.11, 0.23), (0.13, 0.19), (0.09, 0.27)][number])[:, None] * 2.0 * np.pi
    reach = np.array([5.0, 1.5])[:, None]
    angle = (reach * np.sin(paces * time + number)).sum(axis=0)
    acceleration = -(reach * paces**2 * np.sin(paces * time + number)).sum(axis=0)
    ripple = sum(size * np.sin(order * angle + order) for order, size in LINES.items())
    return time, angle, 1e-3 * acceleration + ripple


def _session() -> Session:
    runs = []
    for number in range(3):
        time, angle, torque = _turning(number)
        noise = 1e-4 * np.random.default_rng(number).standard_normal(len(time))
        channels = {"motor_position": angle, "motor_torque": torque + noise}
        told = {"phase": "motor_bench", "cable": "none", "sample_rate_hz": 500.0}
        runs.append(Run.from_arrays(channels, name=f"{number:03}", **told))
    return Session(Path("lines.h5"), "lines", "", Rig(None, Motor()), tuple(runs))


def test_lines_have_the_power_of_their_amplitudes() -> None:
    time, angle, torque = _turning(0)
    motion = Motion(
        phase="motor_bench", cable_sign=0, sample_rate_hz=500.0, time=time, position=angle,
        velocity=np.gradient(angle, time), acceleration=np.gradient(np.gradient(angle, time), time),
        torque=torque, motor=Motor(),
    )  # fmt: skip
    found = strongest_lines([motion])
    assert list(found)[:3] == [12.0, 7.0, 20.0]
    for order, size in LINES.items():
        assert found[order] == pytest.approx((size / LINES[12.0]) ** 2, rel=0.2)


def test_three_lines_are_one_ripple() -> None:
    session = _session()
    found = diagnose([session], with_curves=False)
    assert found.verdict == "missing_effect"
    assert found.final_model == ("torque_ripple",)
    assert found.path[-1].score < 1.2
    told = found.candidates[0].parameters
    assert [told[name].value for name in ("order", "second_order", "third_order")] == [12.0, 7.0, 20.0]
    for part, (order, size) in zip(("", "double_", "triple_"), LINES.items(), strict=True):
        sine, cosine = (told[f"{part}{one}"].value for one in ("sine", "cosine"))
        assert np.hypot(sine, cosine) == pytest.approx(size, rel=0.02), order


def test_a_multiple_is_no_line_of_its_own() -> None:
    one = CATALOGUE["torque_ripple"]
    time, angle, _ = _turning(0)
    torque = 4e-3 * np.sin(9.0 * angle) + 2e-3 * np.sin(18.0 * angle) + 1e-3 * np.sin(27.0 * angle)
    motion = Motion(
        phase="motor_bench", cable_sign=0, sample_rate_hz=500.0, time=time, position=angle,
        velocity=np.gradient(angle, time), acceleration=np.zeros_like(angle), torque=torque, motor=Motor(),
    )  # fmt: skip
    assert one.shapes_seen is not None
    shapes = one.shapes_seen([motion])
    assert {"order": 9.0} in [dict(shape) for shape in shapes]
    assert not any("second_order" in shape for shape in shapes)


def test_a_second_look_at_the_lowest_usual_order_finds_no_spring() -> None:
    """Of order 1.5 a finger's motor turns by a quarter of a period, which is as well an elastic torque."""
    closer = CATALOGUE["torque_ripple"].closer
    assert min(shape["order"] for shape in closer({"order": 4.0})) == 4.0
    assert min(shape["order"] for shape in closer({"order": 22.0})) == 19.0
    assert min(shape["order"] for shape in closer({"order": 1.0})) == 0.5  # a motor alone that turns further

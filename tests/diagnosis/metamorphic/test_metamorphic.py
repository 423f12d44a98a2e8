"""A machine of another size gives the same verdict; the wider table is made by ``__main__``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Run, Session

from .changes import resized, shuffled


@pytest.fixture(scope="module")
def axis() -> Session:
    """An axis with Coulomb friction of 20 mN m, in runs of 8 s at three frequencies, twice each."""
    rng, runs = np.random.default_rng(8), []
    time = np.arange(2000) / 250.0
    for number, frequency in enumerate((0.5, 1.0, 1.5, 0.5, 1.0, 1.5), 1):
        pace = 2 * np.pi * frequency
        position, speed = 0.25 * np.sin(pace * time), 0.25 * pace * np.cos(pace * time)
        torque = 0.02 * np.tanh(speed / 0.01) - 1e-3 * pace**2 * position + 0.05 * position
        channels = {
            "motor_position": position + 1e-5 * rng.standard_normal(len(time)),
            "motor_torque": torque + 5e-4 * rng.standard_normal(len(time)),
        }
        told = {"kind": "sine", "frequency_hz": frequency, "amplitude_deg": 14.324}
        runs.append(
            Run.from_arrays(
                channels, name=f"{number:03d}", phase="motor_bench", cable="none", sample_rate_hz=250.0,
                trajectory=told,
            )
        )  # fmt: skip
    return Session(Path("axis.h5"), "", "", Rig(None, Motor()), tuple(runs))


def test_a_machine_of_another_size_has_the_same_verdict(axis: Session) -> None:
    usual = diagnose([axis], with_curves=False)
    large = diagnose([shuffled(resized(axis, mass=100.0, length=3.0, time=2.0))], with_curves=False)
    assert large.verdict == usual.verdict == "missing_effect"
    assert large.path[1].added == usual.path[1].added
    assert set(large.set) == set(usual.set)
    assert large.score == pytest.approx(usual.score, rel=1e-3)
    told = {c.effect: c.probability for c in usual.candidates}
    assert {c.effect: c.probability for c in large.candidates} == pytest.approx(told, abs=0.05)
    torque = 100.0 * 9.0 / 4.0
    errors = usual.errors["motor_torque"]
    assert large.errors["motor_torque"].rmse == pytest.approx(torque * errors.rmse, rel=1e-3)

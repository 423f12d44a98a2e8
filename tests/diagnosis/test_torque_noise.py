"""A motor alone: what is logged late is no friction, and what no law of the state tells need not be noise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.diagnosis_words import verdict_sentence
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Run, Session

RATE_HZ, SECONDS, INERTIA = 500.0, 12.0, 2e-3
TONES_HZ = [(0.7, 1.9, 3.1), (0.5, 1.3, 2.7), (0.9, 2.3, 3.7), (0.6, 1.7, 3.3)]
"""Of each run: none repeats another, nor itself within it."""

Impedance = Callable[[np.ndarray, int], np.ndarray]
"""Torque for an angle (N m/rad, complex) at angular frequencies (rad/s) in the run of a number."""


def steady(impedance: Impedance, late: float = 0.0, noise: float = 1e-2) -> Session:
    """A linear machine in its steady state, exact at every sample.

    Args:
        late: samples by which the torque is logged after its position. noise: of the torque, in its spread.
    """
    time, runs = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ, []
    for number, tones in enumerate(TONES_HZ):
        omega = 2.0 * np.pi * np.array(tones)[:, None]
        angle = 0.2 * np.exp(1j * (omega * time + 1.0))
        delayed = np.exp(-1j * omega * late / RATE_HZ)
        torque = (impedance(omega, number) * angle * delayed).sum(axis=0).imag
        torque = torque + noise * torque.std() * np.random.default_rng(number).standard_normal(len(time))
        channels = {"motor_position": angle.sum(axis=0).imag, "motor_torque": torque}
        told = {"phase": "motor_bench", "cable": "none", "sample_rate_hz": RATE_HZ}
        runs.append(Run.from_arrays(channels, name=f"{number:03}", **told))
    return Session(Path("made.h5"), "made", "", Rig(None, Motor()), tuple(runs))


def inert(omega: np.ndarray, number: int) -> np.ndarray:
    return -INERTIA * omega**2 + 0j


def viscous(omega: np.ndarray, number: int) -> np.ndarray:
    return inert(omega, number) + 4e-3j * omega


def wound_up(omega: np.ndarray, number: int) -> np.ndarray:
    """A load of the rotor's size behind a shaft of 1.2 N m/rad with some damping: it swings at 3.9 Hz."""
    shaft, load = 1.2 + 4e-3j * omega, -INERTIA * omega**2
    return -0.5 * INERTIA * omega**2 + shaft * load / (shaft + load)


def loaded(omega: np.ndarray, number: int) -> np.ndarray:
    """A mass that is there in every other run."""
    return (1.0 + number % 2) * inert(omega, number)


def told(session: Session) -> Diagnosis:
    return diagnose([session], with_curves=False)


@pytest.mark.parametrize("late", [-1.0, -0.5, 0.0, 0.5, 1.0, 5.0], ids=lambda one: f"{one:g} samples late")
def test_a_torque_that_is_logged_at_another_moment_is_no_effect(late: float) -> None:
    found = told(steady(inert, late))
    assert found.verdict == "nothing_missing"
    assert found.errors["motor_torque"].r2 > 0.999
    assert [one.kind for one in found.bench] == (["skew"] if late else [])
    for skew in found.bench:
        assert skew.size == pytest.approx(late / RATE_HZ, rel=0.05)
        assert f"ms {'after' if late > 0 else 'before'} its position" in skew.text


def test_viscous_friction_is_no_late_torque() -> None:
    """A lag grows with the cube of the frequency, friction with its first power; here they are 0.4 of it."""
    found = told(steady(viscous))
    assert found.verdict == "missing_effect"
    assert found.candidates[0].effect == "motor_viscous_friction"
    assert found.candidates[0].parameters["viscous"].value == pytest.approx(4e-3, rel=0.02)
    assert not found.bench


@pytest.mark.parametrize(
    ("impedance", "told_by", "words"),
    [(wound_up, "memory", "It depends on what came before"), (loaded, "runs", "It differs from run to run")],
    ids=["elastic", "another mass"],
)
def test_what_has_memory_or_differs_by_run_is_no_noise(
    impedance: Impedance, told_by: str, words: str
) -> None:
    found = told(steady(impedance))
    assert found.verdict == "not_in_catalogue"
    assert found.torque_noise.told_by == told_by
    assert found.score > 3.0
    assert words in verdict_sentence(found)


@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_noise_is_noise_however_much(noise: float) -> None:
    found = told(steady(inert, noise=noise))
    assert found.verdict == "nothing_missing"
    assert found.torque_noise.told_by == ""
    # Low-passed to 12 of 250 Hz: a tenth of white noise's variance at most.
    assert found.errors["motor_torque"].r2 == pytest.approx(1.0, abs=0.1 * noise**2)

"""A motor alone by closed forms: the sense of its torque, a lag beside a ripple, a weight that turns over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.segments import drive_sign
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Run, Session

RATE_HZ, SECONDS, INERTIA = 500.0, 10.0, 2e-3
SINES: tuple[Sequence[tuple[float, float]], ...] = (
    [(0.9, 1.0)], [(0.5, 2.0)], [(0.25, 4.0)], [(0.2, 5.0)]
)  # fmt: skip
"""Of each run amplitude (rad) and frequency (Hz): one alone, which tells inertia and spring not apart."""
SWINGS: tuple[Sequence[tuple[float, float]], ...] = ([(2.5, 0.5)], [(2.0, 0.7)], [(3.0, 0.4)])
"""Cycles that come again, so that the floor is known without any model."""
TURNS: tuple[Sequence[tuple[float, float]], ...] = ([(9.0, 0.11)], [(7.0, 0.13)], [(8.0, 0.17)])

Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Torque (N m) by angle, speed and acceleration."""


def machine(law: Law, motions: Sequence[Sequence[tuple[float, float]]], lead_s: float = 0.0) -> Session:
    """Runs whose torque, by a law of the motion, is logged so much before its position."""
    time, runs = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ, []

    def motion(at: np.ndarray, parts: Sequence[tuple[float, float]]) -> list[np.ndarray]:
        turns = [(a, 2.0 * np.pi * f) for a, f in parts]
        return [
            sum(a * np.sin(w * at) for a, w in turns),
            sum(a * w * np.cos(w * at) for a, w in turns),
            sum(-a * w**2 * np.sin(w * at) for a, w in turns),
        ]

    for number, parts in enumerate(motions):
        rng = np.random.default_rng(number)
        torque = law(*motion(time + lead_s, parts))
        channels = {
            "motor_position": motion(time, parts)[0] + 1e-5 * rng.standard_normal(len(time)),
            "motor_torque": torque + 5e-3 * torque.std() * rng.standard_normal(len(time)),
        }
        told = {"phase": "motor_bench", "cable": "none", "sample_rate_hz": RATE_HZ}
        runs.append(Run.from_arrays(channels, name=f"{number:03}", **told))
    return Session(Path("made.h5"), "made", "", Rig(None, Motor()), tuple(runs))


def inert(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    return INERTIA * acceleration


def test_a_lead_of_an_inertia_is_no_torque_of_the_other_sign() -> None:
    """On single sines it leaves what seems to help the motion; single runs had been turned for it."""
    said = diagnose([machine(inert, SINES, 5e-3)], with_curves=False)
    assert said.verdict == "nothing_missing"
    assert [one.kind for one in said.bench] == ["skew"]
    assert said.bench[0].size == pytest.approx(-5e-3, rel=0.05)


@pytest.mark.parametrize(("rubs", "sign"), [(1.0, 1), (-1.0, -1), (0.1, 0), (-0.1, 0)])
def test_what_rubs_tells_the_sign_where_it_is_no_small_share(rubs: float, sign: int) -> None:
    """Of a single sine: dry friction of so many times what inertia and spring together take."""
    time = np.arange(5000) / RATE_HZ
    motion = np.stack([np.sin(time), np.cos(time), -np.sin(time)])
    torque = 0.3 * motion[0] + 0.3 * rubs * np.sign(motion[1])
    assert drive_sign(torque, motion) == sign


def test_a_lag_beside_a_ripple_is_found() -> None:
    """Half a sample: small beside inertia, but not beside what turns 24 times as fast."""

    def law(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        return inert(angle, speed, acceleration) + 0.05 * np.sin(24.0 * angle + 0.4)

    said = diagnose([machine(law, SWINGS, 0.5 / RATE_HZ)], with_curves=False)
    assert said.final_model == ("torque_ripple",)
    assert said.path[-1].score < 1.2
    skew = {one.channel: one.size for one in said.bench if one.kind == "skew"}
    assert skew == {"motor_torque": pytest.approx(-0.5 / RATE_HZ, rel=0.2)}


def test_a_weight_through_full_turns_is_as_heavy_as_it_is() -> None:
    """What goes once a turn is most of the torque then, and no small ripple of it."""

    def law(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        return inert(angle, speed, acceleration) + 1.2 * np.sin(angle + 0.3)

    said = diagnose([machine(law, TURNS)], with_curves=False)
    assert said.final_model == ("torque_ripple",)
    sine, cosine = (said.final_parameters[f"torque_ripple.{part}"].value for part in ("sine", "cosine"))
    assert (sine, cosine) == pytest.approx((1.2 * np.cos(0.3), 1.2 * np.sin(0.3)), rel=0.01)

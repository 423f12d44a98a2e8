"""A motor alone by closed forms: the sense of its torque, a lag beside a ripple, a weight that turns over."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.segments import drive_sign
from fingerlab.report.score_words import machine_sentence
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


def machine(
    law: Law, motions: Sequence[Sequence[tuple[float, float]]], lead_s: float = 0.0, noise: float = 5e-3
) -> Session:
    """Runs whose torque, by a law of the motion and with noise, is logged so much before its position."""
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
            "motor_torque": torque + noise * torque.std() * rng.standard_normal(len(time)),
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


TRAVEL, DAMPING_S, DRY, VISCOUS = 4e-3, 5e-3, 0.12, 0.02
"""Of a LuGre friction: travel (rad) and damping (s) of its bristles, friction (N m) and what grows with the
speed (N m s/rad)."""
STROKES: tuple[Sequence[tuple[float, float]], ...] = (
    [(0.5, 0.5), (0.2, 1.5)], [(0.4, 0.6), (0.25, 1.2)], [(0.6, 0.4), (0.3, 0.8)]
)  # fmt: skip


def lugre(extra: float, stribeck_speed: float) -> Law:
    """Inertia and LuGre friction (Canudas de Wit et al. 1995) that falls from DRY + extra to DRY.

    Between samples the bristles relax towards the friction of the moment, exactly.
    """

    def law(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        level = 1.0 + extra / DRY * np.exp(-((speed / stribeck_speed) ** 2))
        bent, states = 0.0, np.zeros(len(angle))
        for k in range(1, len(angle)):
            step = angle[k] - angle[k - 1]
            kept = np.exp(-abs(step) / (TRAVEL * level[k]))
            bent = kept * bent + (1.0 - kept) * level[k] * np.sign(step)
            states[k] = bent
        bending = speed - np.abs(speed) * states / level
        friction = DRY * (states + DAMPING_S * bending / TRAVEL)
        return inert(angle, speed, acceleration) + friction + VISCOUS * speed

    return law


def test_bristles_with_damping_are_coulomb_friction_and_not_stribeck() -> None:
    """Their damping looks like friction that is larger near standstill; both had been told, side by side."""
    said = diagnose([machine(lugre(0.0, 1.0), STROKES, noise=0.05)], with_curves=False)
    assert set(said.final_model) == {"motor_coulomb_friction", "motor_viscous_friction"}
    assert said.path[-1].score < 1.3  # of 120
    found = {name: one.value for name, one in said.final_parameters.items()}
    assert found["motor_coulomb_friction.coulomb"] == pytest.approx(DRY, rel=0.03)
    assert found["motor_viscous_friction.viscous"] == pytest.approx(VISCOUS, rel=0.05)


def test_stribeck_friction_stands_alone_without_the_coulomb_friction_that_it_contains() -> None:
    said = diagnose([machine(lugre(0.08, 0.4), STROKES, noise=0.05)], with_curves=False)
    assert set(said.final_model) == {"motor_stribeck_friction", "motor_viscous_friction"}
    found = {name: one.value for name, one in said.final_parameters.items()}
    assert found["motor_stribeck_friction.coulomb"] == pytest.approx(DRY, rel=0.05)
    assert found["motor_stribeck_friction.extra"] == pytest.approx(0.08, rel=0.2)


SPINS: tuple[Sequence[tuple[float, float]], ...] = ([(15.0, 1.0)], [(30.0, 0.4)], [(20.0, 0.7)])


def test_of_a_rotor_that_spins_viscous_friction_is_no_trace() -> None:
    """As much as passes unsaid at the thesis' speeds brakes a rotor of 80 g cm^2 in a third of a second."""
    inertia, viscous = 8e-5, 2e-4

    def law(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        return inertia * acceleration + viscous * speed

    said = diagnose([machine(law, SPINS)], with_curves=False)
    assert said.final_model == ("motor_viscous_friction",)
    assert said.final_parameters["motor_viscous_friction.viscous"].value == pytest.approx(viscous, rel=0.02)
    told = re.search(
        r"inertia J ([\d.]+) ± [\d.]+ g cm²; viscous coefficient ([\d.]+) ", machine_sentence(said)
    )
    assert told is not None
    assert [float(one) for one in told.groups()] == pytest.approx([800.0, 0.2], rel=0.02)


UNREPEATED: tuple[Sequence[tuple[float, float]], ...] = tuple(
    [(0.5, 0.37 + 0.05 * k), (0.21, 1.13 - 0.04 * k), (0.09, 2.71 + 0.07 * k)] for k in range(4)
)
"""Three sines that make no cycle in ten seconds."""


def with_zeros(session: Session, zeros: Sequence[float]) -> Session:
    """The session with a torque that reads too high by one number (N m) in every run."""
    runs = []
    for run, zero in zip(session.runs, zeros, strict=True):
        channels = dict(run.load(list(run.units), 0, run.length))
        channels["motor_torque"] = channels["motor_torque"] + zero
        told = {"phase": run.phase, "cable": run.cable, "sample_rate_hz": run.sample_rate_hz}
        runs.append(Run.from_arrays(channels, name=run.name, **told))
    return replace(session, runs=tuple(runs))


@pytest.mark.parametrize("viscous", [0.0, 8e-3])
def test_a_zero_of_each_run_s_own_is_told_where_no_motion_comes_again(viscous: float) -> None:
    """Up to twice the torque's spread: the floor was as large, and all that is missing hid below it."""
    plain = machine(lambda angle, speed, acceleration: INERTIA * acceleration + viscous * speed, UNREPEATED)
    size = float(plain.runs[0].channel("motor_torque").std())
    said = diagnose([with_zeros(plain, [0.0, 2.0 * size, -size, 0.7 * size])], with_curves=False)
    assert said.verdict == ("missing_effect" if viscous else "nothing_missing")
    assert said.final_model == (("motor_viscous_friction",) if viscous else ())
    assert said.path[-1].score < 1.1
    assert "amplifier_offset" in [one.to_json()["finding"] for one in said.bench]


def test_drag_by_the_square_of_the_speed_is_no_other_friction() -> None:
    """A fan's, of which friction in proportion to the speed leaves hundreds of floors."""
    drag = 4e-3
    said = diagnose(
        [machine(lambda a, speed, acc: INERTIA * acc + drag * speed * np.abs(speed), TURNS)],
        with_curves=False,
    )
    assert said.final_model == ("motor_viscous_friction",)
    assert said.path[-1].score < 1.1
    found = said.candidates[0].parameters
    assert found["turbulent"].value == pytest.approx(drag, rel=0.01)
    assert abs(found["viscous"].value) < 0.02 * drag * 9.0


def along_a_line(session: Session, radius: float) -> Session:
    """A machine whose angle is a way of 15 mm per radian, told as an arc of another radius (m)."""
    runs, share = [], 0.015 / radius
    for run in session.runs:
        channels = dict(run.load(list(run.units), 0, run.length))
        channels["motor_position"] = channels["motor_position"] * share
        channels["motor_torque"] = channels["motor_torque"] / share
        told = {"phase": run.phase, "cable": run.cable, "sample_rate_hz": run.sample_rate_hz}
        runs.append(Run.from_arrays(channels, name=run.name, **told))
    rig = replace(session.rig, extra={"axis": {"radius_m": radius}})
    return replace(session, rig=rig, runs=tuple(runs))


def test_an_axis_along_a_line_is_the_same_told_as_any_arc() -> None:
    """Its friction turns round over a way, which is no angle: the verdict went by the radius."""

    def rubs(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        return INERTIA * acceleration + 0.02 * np.tanh(speed / 0.05) + 4e-3 * speed

    plain = machine(rubs, TURNS)
    first, second = (diagnose([along_a_line(plain, radius)], with_curves=False) for radius in (0.01, 0.3))
    assert first.final_model == ("motor_coulomb_friction", "motor_viscous_friction")
    assert second.final_model == first.final_model
    assert second.set == first.set
    assert second.candidates[0].probability == pytest.approx(first.candidates[0].probability, abs=1e-3)
    assert second.score == pytest.approx(first.score, rel=1e-3)


def test_teeth_that_are_no_whole_number_a_turn_are_told_by_their_line() -> None:
    """21.4 a turn, larger than all else that moves the axis: a quarter beside it left eight floors."""

    def cogs(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        return INERTIA * acceleration + 0.05 * np.sin(21.4 * angle)

    said = diagnose([machine(cogs, TURNS)], with_curves=False)
    assert said.final_model == ("torque_ripple",)
    assert said.path[-1].score < 1.2
    assert said.candidates[0].parameters["order"].value == pytest.approx(21.4, abs=2e-3)


def test_an_inertia_that_is_not_the_rig_file_s_is_told() -> None:
    rig = Rig(None, Motor(inertia=1.5 * INERTIA), {"inertia": 0.1})
    said = diagnose([replace(machine(inert, SWINGS), rig=rig)], with_curves=False)
    (told,) = said.bench
    assert told.sentence.startswith(
        "By these runs the inertia is 20 kg cm², and 30 kg cm² ± 10 % by the rig file"
    )
    near = replace(machine(inert, SWINGS), rig=replace(rig, motor=Motor(inertia=1.05 * INERTIA)))
    assert diagnose([near], with_curves=False).bench == ()


def test_friction_of_one_direction_is_told_as_a_constant_beside_it() -> None:
    """30 mN m one way and 10 the other."""

    def one_sided(angle: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        return INERTIA * acceleration + 0.02 * np.tanh(speed / 0.02) + 0.01

    said = diagnose([machine(one_sided, SWINGS)], with_curves=False)
    assert said.final_model == ("motor_coulomb_friction",)
    (told,) = [one for one in said.bench if one.channel == "motor_torque"]
    assert told.size == pytest.approx(0.01, rel=0.1)
    assert "larger in one direction" in told.sentence

"""Two sessions run by run: sines of known size and phase, written with plain h5py."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.rig.file import LINEAR_AXIS
from fingerlab.sessions import Session, open_session
from fingerlab.signals.run_pairs import compare_runs, compare_sessions, paired

SAMPLES = 14_000
TORQUE = 0.02  # N m
BUMP = 0.003  # N m, of the third harmonic that only one bench has
ZERO = 0.001  # N m
NOISE = 2e-4  # N m


def bench(
    make_session: Callable[..., Path], name: str, late: float, bump: float, zero: float, seed: int
) -> Session:
    """A run whose sine begins ``late`` s after the recording."""

    def change(file: h5py.File) -> None:
        run = file["runs/001"]
        turn = 2 * np.pi * (np.arange(SAMPLES) / 1000.0 - late)
        rng = np.random.default_rng(seed)
        run["motor_position"][...] = np.radians(22 + 14.9 * np.sin(turn))
        torque = zero + TORQUE * np.sin(turn + 0.3) + bump * np.sin(3 * turn)
        run["motor_torque"][...] = torque + NOISE * rng.standard_normal(SAMPLES)

    return open_session(make_session(name, change, (("on_air", "extension"),), SAMPLES))


def test_a_difference_is_found_in_phase_whatever_the_start(make_session: Callable[..., Path]) -> None:
    a = bench(make_session, "a.h5", 0.0, 0.0, 0.0, 1)
    b = bench(make_session, "b.h5", 0.317, BUMP, ZERO, 2)
    pair = compare_runs(a.runs[0], b.runs[0])
    assert pair.periodic
    assert pair.lag == pytest.approx(0.317, abs=1e-3)
    assert pair.cycles[0] >= 10
    torque = pair.channels["motor_torque"]
    assert torque.offset == pytest.approx(ZERO, rel=0.05)
    assert torque.rms == pytest.approx(BUMP / np.sqrt(2), rel=0.02)
    assert torque.usual == pytest.approx(NOISE, rel=0.1)
    expected = ZERO + BUMP * np.sin(3 * 2 * np.pi * pair.axis)
    assert np.abs(torque.second - torque.first - expected).max() < 4 * NOISE / np.sqrt(5)
    assert torque.times == pytest.approx(np.hypot(ZERO, BUMP / np.sqrt(2)) / NOISE, rel=0.1)
    peaks = (np.arange(6) + 0.5) / 6  # of a third harmonic
    assert min(abs(torque.largest_at - peaks)) < 0.03
    assert pair.channels["motor_position"].rms < np.radians(0.02)


def test_the_same_bench_twice_differs_by_its_scatter(make_session: Callable[..., Path]) -> None:
    a, b = (bench(make_session, f"{seed}.h5", 0.1 * seed, 0.0, 0.0, seed) for seed in (3, 4))
    torque = compare_runs(a.runs[0], b.runs[0]).channels["motor_torque"]
    assert torque.times < 1.0


def test_a_motion_without_a_period_is_laid_over_in_time(make_session: Callable[..., Path]) -> None:
    def chirp(name: str, late: float, gain: float) -> Session:
        def change(file: h5py.File) -> None:
            run = file["runs/001"]
            run.attrs["trajectory"] = json.dumps({"kind": "chirp", "frequency_hz": 0.5, "amplitude_deg": 9.0})
            time = np.arange(SAMPLES) / 1000.0 - late
            swing = np.sin(2 * np.pi * (0.5 + 0.1 * time) * time)
            run["motor_position"][...] = np.radians(22 + 9 * swing)
            run["motor_torque"][...] = gain * swing

        return open_session(make_session(name, change, (("on_air", "extension"),), SAMPLES))

    a, b = chirp("a.h5", 0.0, 0.02), chirp("b.h5", 0.25, 0.023)
    pair = compare_runs(a.runs[0], b.runs[0])
    assert not pair.periodic
    assert pair.lag == pytest.approx(0.25, abs=0.01)
    torque = pair.channels["motor_torque"]
    assert torque.rms == pytest.approx(0.003 / np.sqrt(2), rel=0.1)
    assert np.isnan(torque.times)


def test_runs_find_their_partner_by_motion(make_session: Callable[..., Path]) -> None:
    def told(*hertz: float) -> Callable[[h5py.File], None]:
        def change(file: h5py.File) -> None:
            for number, frequency in enumerate(hertz, start=1):
                trajectory = {"kind": "sine", "amplitude_deg": 15.0 - number, "frequency_hz": frequency}
                file[f"runs/{number:03d}"].attrs["trajectory"] = json.dumps(trajectory)

        return change

    a = open_session(make_session("a.h5", told(1.0, 0.5, 2.0), (("on_air", "extension"),) * 3))
    b = open_session(make_session("b.h5", told(2.0, 0.5), (("on_air", "extension"),) * 2))
    pairs, left, right = paired(a, b)
    assert [(one.name, two.name) for one, two in pairs] == [("002", "002"), ("003", "001")]
    assert [run.name for run in left] == ["001"]
    assert right == []


def test_sessions_without_a_common_motion_are_refused(make_session: Callable[..., Path]) -> None:
    a = open_session(make_session("a.h5", phases=(("on_air", "extension"),)))
    b = open_session(make_session("b.h5", phases=(("on_air", "flexion"),)))
    with pytest.raises(UserError, match="no motion in common"):
        compare_sessions(a, b)
    assert len(compare_sessions(a, a).pairs) == 1


def test_axes_told_of_other_arcs_are_refused(make_session: Callable[..., Path]) -> None:
    """A radian of one is another length of the other."""

    def arc(radius: float) -> Callable[[h5py.File], None]:
        def change(file: h5py.File) -> None:
            rig = json.loads(file.attrs["rig"])
            file.attrs["rig"] = json.dumps({**rig, LINEAR_AXIS: {"radius_m": radius}})

        return change

    one, other = (open_session(make_session(f"{r}.h5", arc(r))) for r in (0.01, 0.02))
    with pytest.raises(UserError, match=r"an arc of 10 mm and 0\.02\.h5 of a linear axis kept .* 20 mm"):
        compare_sessions(one, other)
    turning = open_session(make_session("turning.h5"))
    with pytest.raises(UserError, match=r"turning\.h5 of an axis that turns"):
        compare_sessions(one, turning)

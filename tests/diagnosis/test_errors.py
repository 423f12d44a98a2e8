"""Errors and floors by equation, in the units of the contract, against noise that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, firwin, freqz, sosfiltfilt

from fingerlab.diagnosis.answer.error_parts import EquationError
from fingerlab.diagnosis.answer.errors import equation_errors, equation_floors, run_shares
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.effects import CATALOGUE
from tests.reduced import reduce_sessions

from . import closed_form as made


def errors_of(missing: made.Missing) -> dict[str, EquationError]:
    scorer = Scorer(reduce_sessions([made.session(made.Bench(missing=missing), 4)], []))
    return equation_errors(scorer.reduced, scorer.score_held_out(scorer.fit_reweighted([]), residuals=True))


@pytest.fixture(scope="module")
def plain() -> dict[str, EquationError]:
    return errors_of(made.Missing())


def passed(power: int) -> float:
    """Share of the variance of white noise at 1 kHz that passes 8 Hz, differentiated ``power`` times."""
    frequency, response = freqz(firwin(81, 8.0, fs=250.0), worN=16384, fs=250.0)
    density = 2.0 / 1000.0 * np.abs(response) ** 2 * (2 * np.pi * frequency) ** (2 * power)
    return float(np.trapezoid(density, frequency))


def test_floor_of_the_cable_is_the_sensors_noise(plain: dict[str, EquationError]) -> None:
    """Encoder over the pulley and both angle sensors over their arms, after the low-pass."""
    bench = made.Bench()
    arms = [np.hypot(*bench.arms[s]) for s in (-1, 1)]
    counts = [5, 6]  # runs with either cable
    variance = [(made.RADIUS * bench.position_noise) ** 2 + (a * bench.angle_noise) ** 2 for a in arms]
    expected = np.sqrt(np.average(variance, weights=counts) * passed(0))
    assert plain["cable_kinematics"].floor == pytest.approx(expected, rel=0.15)


def test_floor_of_the_motor_is_at_least_the_noise_of_its_current(plain: dict[str, EquationError]) -> None:
    bench = made.Bench()
    inertial = made.INERTIA * bench.position_noise * np.sqrt(passed(2))
    own = np.hypot(bench.torque_noise * np.sqrt(passed(0)), inertial)
    assert own < plain["motor_torque"].floor < 1.5 * own


def test_floor_holds_what_friction_differs_by_from_run_to_run() -> None:
    """No run is told twice: a twentieth of the friction's own torque on top, from the joints' true speeds."""
    friction = (3e-3, 2e-3)  # N m s/rad
    bench = made.Bench(missing=made.Missing(viscous=friction))
    session = made.session(bench, 4, contact=0)
    effect = CATALOGUE["viscous_friction"]
    scorer = Scorer(reduce_sessions([session], [effect]))
    fitted = scorer.score_held_out(scorer.fit_reweighted([Choice(effect)]), residuals=True)
    cycles, whole = (
        equation_floors(scorer.reduced, fitted, alone)["joint_torque"] for alone in (True, False)
    )
    low_pass = butter(4, 8.0, fs=made.RATE, output="sos")
    squares = []
    for run in session.runs:
        channels = run.load()
        for name, coefficient in zip(("mcp_angle", "pip_angle"), friction, strict=True):
            speed = made.RATE * np.gradient(sosfiltfilt(low_pass, channels[name]))[1000:-1000]
            squares.append(np.mean((0.05 * (coefficient + bench.trace) * speed) ** 2))
    assert whole**2 - cycles**2 == pytest.approx(np.mean(squares), rel=0.06)


def test_a_whole_model_is_at_its_floor(plain: dict[str, EquationError]) -> None:
    assert set(plain) == {"joint_torque", "cable_kinematics", "motor_torque", "endpoint_force"}
    for error in plain.values():
        assert error.rmse == pytest.approx(error.floor, rel=0.25)
        assert error.r2 > 0.99


def test_a_lost_motor_torque_shows_in_its_own_unit() -> None:
    """Viscous loss c times speed, of which the nuisances can hide a part but not the whole."""
    loss = 3e-3
    bench = made.Bench(missing=made.Missing(motor_viscous=loss))
    speeds = [np.gradient(run.channel("motor_position"), 1e-3) for run in made.session(bench, 4).runs[:8]]
    size = loss * np.sqrt(np.mean([np.mean(v[2000:] ** 2) for v in speeds]))
    error = errors_of(made.Missing(motor_viscous=loss))["motor_torque"]
    assert 0.3 * size < error.rmse < 1.1 * size
    assert error.rmse > 5 * error.floor


def test_an_unread_share_of_the_force_shows_in_newtons() -> None:
    error = errors_of(made.Missing(read_share=0.85))["endpoint_force"]
    assert error.unit == "N"
    assert 0.002 < error.rmse < 0.2
    assert error.rmse > 2 * error.floor


def test_parts_of_the_score_sum_to_its_square() -> None:
    session = made.session(made.Bench(missing=made.Missing(viscous=(2e-3, 1e-3))), 4)
    scorer = Scorer(reduce_sessions([session], []))
    fitted = scorer.score_held_out(scorer.fit_reweighted([]), residuals=True)
    shares, parts = run_shares([("s.h5", run) for run in session.runs], scorer.reduced, fitted)
    assert 1.0 + sum(part.squared for part in parts) == pytest.approx(fitted.score**2, rel=1e-9)
    runs = {part.runs: part.samples for part in parts}
    assert sorted(name for names in runs for name in names) == sorted(run.name for run in session.runs)
    assert sum(runs.values()) == pytest.approx(1.0)
    # The same run by run: the floor's 1 is dealt to runs and equations, of which each run has three.
    assert sum(one.share for one in shares) == pytest.approx(fitted.score**2, rel=1e-9)
    assert 1.0 + sum(one.squared for one in shares) == pytest.approx(fitted.score**2, rel=1e-9)
    assert len({(one.run, one.equation) for one in shares}) == len(shares)
    assert sum(one.share - one.squared for one in shares) == pytest.approx(1.0)
    by_run = {run.name: [one for one in shares if one.run == run.name] for run in session.runs}
    lengths = {name: sum(one.share - one.squared for one in mine) for name, mine in by_run.items()}
    longest = max(run.seconds for run in session.runs)
    for run in session.runs:
        if run.seconds == longest:
            assert lengths[run.name] == pytest.approx(max(lengths.values()))
    # A joint that rubs is no matter of the cable's length, and shows the more the faster it turns.
    joint, cable = (
        {one.run: one.squared for one in shares if one.equation == family}
        for family in ("joint_torque", "cable_kinematics")
    )
    free = [run for run in session.runs if run.phase == "on_air"]
    assert sum(joint.values()) > 20 * abs(sum(cable.values()))
    assert all(joint[run.name] > cable[run.name] for run in free)
    for part in parts:
        if len(part.runs) == 1 and part.equation == "cable_kinematics":
            assert part.squared == pytest.approx(cable[part.runs[0]])


def floors_of_runs(
    coefficients: Sequence[float], constants: Sequence[float] = (0.0,) * 4
) -> tuple[dict[str, EquationError], float]:
    """Floors of runs of one motion, by the motor's viscous friction in each, and their speed, rad/s.

    ``constants``: torque that the motor of each run gives beside, N m.
    """
    runs = []
    for number, (coefficient, constant) in enumerate(zip(coefficients, constants, strict=True)):
        bench = made.Bench(missing=made.Missing(motor_viscous=coefficient))
        session = made.session(bench, number + 1, contact=0)
        told = {**session.runs[0].trajectory, "amplitude_deg": 20.0}
        run = made.with_motor_torque(session.runs[0], lambda _, constant=constant: constant)
        runs.append(replace(run, name=f"{number + 1:03d}", trajectory=told))
    scorer = Scorer(reduce_sessions([replace(session, runs=tuple(runs))], []))
    found = scorer.score_held_out(scorer.fit_reweighted([]), residuals=True)
    speed = np.gradient(runs[0].channel("motor_position"), 1e-3)[2000:]
    assert scorer.reduced.floor_from == "runs"
    return equation_errors(scorer.reduced, found), float(np.sqrt(np.mean((speed - speed.mean()) ** 2)))


def test_what_runs_of_one_motion_differ_by_is_part_of_the_floor() -> None:
    """A friction c times speed that differs from run to run adds c's variance times mean square speed."""
    run_varying = (0.6e-3, 1.4e-3, 1.0e-3, 1.8e-3)
    steady, _ = floors_of_runs([1.2e-3] * 4)
    found, speed = floors_of_runs(run_varying)
    added = found["motor_torque"].floor ** 2 - steady["motor_torque"].floor ** 2
    assert np.sqrt(added) == pytest.approx(np.std(run_varying, ddof=1) * speed, rel=0.15)


def test_what_runs_of_one_motion_differ_by_on_their_averages_is_part_of_it() -> None:
    """A torque that is another one in each run, as of a tip that was set down, adds its variance."""
    held = (-2e-3, 1e-3, 3e-3, 0.0)
    steady, _ = floors_of_runs([1.2e-3] * 4)
    found, _ = floors_of_runs([1.2e-3] * 4, held)
    added = found["motor_torque"].floor ** 2 - steady["motor_torque"].floor ** 2
    assert np.sqrt(added) == pytest.approx(np.std(held, ddof=1), rel=0.05)

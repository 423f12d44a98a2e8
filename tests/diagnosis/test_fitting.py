"""Fits: steps within bounds against scipy, noisy regressors, and unknowns of an invented bench."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.signal import firwin, freqz

from fingerlab.diagnosis.answer.candidates import deviations, parameters
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.bounded_step import bounded_step
from fingerlab.diagnosis.fit.data import Data
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import Z90
from fingerlab.diagnosis.signals.scales import SI
from fingerlab.effects import CATALOGUE
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Run, Session
from tests.reduced import reduce_sessions

from . import closed_form as made


@pytest.mark.parametrize("seed", range(40))
def test_bounded_step_is_the_bounded_least_squares_solution(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 30))
    matrix = rng.standard_normal((size + 10, size)) * 10.0 ** rng.uniform(-3, 3, size)
    wanted = rng.standard_normal(size + 10) * 10.0
    width = 10.0 ** rng.uniform(-3, 2, size) / np.linalg.norm(matrix, axis=0)
    low, high = -width * rng.uniform(0, 1, size), width * rng.uniform(0, 1, size)
    values = np.clip(rng.choice([0.0, 1.0, -1.0], size) * width, low, high)  # some stand at a bound
    gradient = matrix.T @ (matrix @ values - wanted)
    step = bounded_step(values, gradient, matrix.T @ matrix, low, high)
    best = lsq_linear(matrix, wanted, (low, high), method="bvls", tol=1e-14)
    reached = values + step
    assert np.all(reached >= low - 1e-9 * width)
    assert np.all(reached <= high + 1e-9 * width)
    assert 0.5 * np.sum((matrix @ reached - wanted) ** 2) == pytest.approx(best.cost, rel=1e-6)
    assert reached == pytest.approx(best.x, abs=1e-4 * float(width.max()))


BENCH_INERTIA, POSITION_NOISE, OMEGA, AMPLITUDE = 3e-3, 8e-3, 2 * np.pi * 0.5, 0.4


def bench_session() -> Session:
    """Sines of the motor alone, torque exact and position so noisy that its acceleration is drowned."""
    rng = np.random.default_rng(5)
    time = np.arange(30000) / 1000.0
    runs = []
    for number in range(4):
        turn = OMEGA * time + number
        position = AMPLITUDE * np.sin(turn)
        torque = -BENCH_INERTIA * OMEGA**2 * position + 0.02 + 1e-5 * rng.standard_normal(len(time))
        channels = {
            "time": time,
            "motor_command": position,
            "motor_position": position + POSITION_NOISE * rng.standard_normal(len(time)),
            "motor_torque": torque,
            "load_torque": np.zeros_like(time),
        }
        trajectory = {"kind": "sine", "frequency_hz": 0.5}
        runs.append(
            Run.from_arrays(
                channels, name=f"{number:03d}", phase="motor_bench", cable="none", trajectory=trajectory
            )
        )
    return Session(Path("bench.h5"), "", "", Rig(None, Motor()), tuple(runs))


def attenuation() -> float:
    """Share of the acceleration's variance that is signal after the low-pass at 8 Hz (Fuller 1987, 1.1)."""
    frequency, response = freqz(firwin(81, 8.0, fs=250.0), worN=16384, fs=250.0)
    density = 2 * POSITION_NOISE**2 / 1000.0 * (2 * np.pi * frequency) ** 4
    noise = np.trapezoid(np.abs(response) ** 2 * density, frequency)
    signal = 0.5 * (AMPLITUDE * OMEGA**2) ** 2
    return float(signal / (signal + noise))


@pytest.mark.parametrize("corrected", [True, False])
def test_a_noisy_regressor_is_not_pulled_to_zero(corrected: bool) -> None:
    """Errors in variables: plain least squares finds the inertia times the attenuation."""
    reduced = reduce_sessions([bench_session()], [], scales=SI)
    if not corrected:
        for group in reduced.groups:
            group.noise, group.noise_samples = np.zeros_like(group.noise), 0.0
    trial = Scorer(reduced).fit([])
    found = float(trial.fit.values[trial.model.index["bench_inertia"]])
    assert 0.6 < attenuation() < 0.9
    assert found == pytest.approx(BENCH_INERTIA * (1.0 if corrected else attenuation()), rel=0.05)


@dataclass(frozen=True)
class Settled:
    scorer: Scorer
    trial: FittedModel  # scored on held-out runs


@pytest.fixture(scope="module")
def settled() -> list[Settled]:
    """Three recordings of one bench with nothing missing."""
    result = []
    for seed in (1, 2, 3):
        scorer = Scorer(reduce_sessions([made.session(made.Bench(), seed)], []))
        result.append(Settled(scorer, scorer.score_held_out(scorer.fit_reweighted([]))))
    return result


def truths() -> dict[str, float]:
    """The unknowns of the bench that every session has, and whose value the prior does not give away."""
    bench = made.Bench()
    result = {"trace_mcp": bench.trace, "trace_pip": bench.trace}
    for cable, sign in (("extension", -1), ("flexion", 1)):
        for i, joint in enumerate(("mcp", "pip")):
            result[f"arm_{joint}@{cable}"] = bench.arms[sign][i]
            result[f"loss_{joint}@{cable}"] = bench.losses[i]
        result[f"offset@{cable}"] = 0.004
    return result


def test_arms_losses_and_offsets_come_back_within_their_intervals(settled: list[Settled]) -> None:
    """Stiffness and masses are off by up to 2 %, as the tolerance allows; nine in ten hold the truth."""
    inside, number = 0, 0
    for one in settled:
        spread = deviations(one.trial, 1.0)
        for key, truth in truths().items():
            error = abs(float(one.trial.fit.values[one.trial.model.index[key]]) - truth)
            assert error < 3.5 * spread[key], key
            inside += error <= Z90 * spread[key]
            number += 1
    assert inside / number > 0.8


def test_arms_are_known_to_half_a_per_cent(settled: list[Settled]) -> None:
    bench = made.Bench()
    for one in settled:
        for cable, sign in (("extension", -1), ("flexion", 1)):
            for i, joint in enumerate(("mcp", "pip")):
                found = float(one.trial.fit.values[one.trial.model.index[f"arm_{joint}@{cable}"]])
                assert found == pytest.approx(bench.arms[sign][i], rel=5e-3)


def test_a_true_model_scores_one_floor(settled: list[Settled]) -> None:
    assert np.mean([one.trial.score for one in settled]) == pytest.approx(1.0, abs=0.08)


def test_bounds_are_never_left(settled: list[Settled]) -> None:
    for one in settled:
        assert np.all(one.trial.fit.values >= one.trial.model.low)
        assert np.all(one.trial.fit.values <= one.trial.model.high)


def test_held_out_scores_are_no_better_than_scores_of_the_fit(settled: list[Settled]) -> None:
    """Whoever has seen a run explains it better; the difference is what keeps a search honest."""
    for one in settled:
        in_sample = one.scorer.score_in_sample(one.trial)
        assert one.trial.misfit > in_sample.misfit
        assert one.trial.count == pytest.approx(in_sample.count)


def test_a_held_out_run_is_not_seen_by_its_fit(settled: list[Settled]) -> None:
    """The step towards the fit without a run is that of sums which never held the run."""
    scorer, trial = settled[0].scorer, settled[0].trial
    values = trial.fit.values
    # With so little noise that the recordings do not limit it, with the run or without.
    groups = [replace(g, noise=0.1 * g.noise) for g in scorer.reduced.groups]
    rest = [replace(g, folds=g.folds[1:] if len(g.folds) > 1 else g.folds) for g in groups]
    never = Fitter(trial.model, Data(rest), trial.weights)
    gradient, information = never.normal_equations(values)
    step = bounded_step(values, gradient, information, trial.model.low, trial.model.high)
    expected = np.clip(values + step, trial.model.low, trial.model.high)
    found = Fitter(trial.model, Data(groups), trial.weights).without(values, 0)
    assert not np.allclose(found.values, values, rtol=1e-6, atol=0)
    assert found.values == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert found.information == pytest.approx(information, rel=1e-6, abs=1e-6)


def test_all_bounds_at_once_give_the_same_step_as_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both are minimisers of one strictly convex function over a box, so there is only one answer."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        size = int(rng.integers(2, 25))
        root = rng.normal(size=(size, size))
        problem = (
            np.zeros(size), rng.normal(size=size) * 3, root @ root.T + 0.1 * np.eye(size),
            -rng.uniform(0, 1, size), rng.uniform(0, 1, size),
        )  # fmt: skip
        quick = bounded_step(*problem)
        with monkeypatch.context() as patch:
            patch.setattr("fingerlab.diagnosis.fit.bounded_step._pivoted", lambda *_: None)
            slow = bounded_step(*problem)
        assert quick == pytest.approx(slow, abs=1e-5)


def test_a_step_that_goes_in_circles_is_where_all_its_turns_would_have_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without a minimum bounds are exchanged for ever: (0.8, -0.6, 1) is where 40 and 18 turns end."""
    solve, asked = np.linalg.solve, []
    monkeypatch.setattr(np.linalg, "solve", lambda *a: asked.append(None) or solve(*a))
    saddle = np.array([[2.0, 1.0, 2.0], [1.0, 3.0, -1.0], [2.0, -1.0, 2.0]])
    found = bounded_step(np.zeros(3), np.array([-3.0, 2.0, 2.0]), saddle, -np.ones(3), np.ones(3))
    assert found == pytest.approx([0.8, -0.6, 1.0], abs=1e-8)
    assert len(asked) < 15


@pytest.mark.parametrize("name", ["proximal_mass", "mcp_stiffness", "inertia", "torque_constant"])
def test_a_constant_without_tolerance_stays_as_it_is(name: str) -> None:
    """Zero is no spread to divide by: the fit is one of numbers, and the constant does not move."""
    session = made.session(made.Bench(), 2, contact=0)
    rig = replace(session.rig, tolerance={**session.rig.tolerance, name: 0.0})
    scorer = Scorer(reduce_sessions([replace(session, rig=rig)], []))
    bare = scorer.bare
    key = {"inertia": "rotor_inertia", "torque_constant": "torque_gain"}.get(name, name)
    assert np.isfinite(bare.fit.cost)
    assert abs(bare.values[key]) < 1e-5


def test_values_are_told_of_an_effect_whose_range_was_widened_twice() -> None:
    """Of equal effects a model holds the first; the values of the second were not found in it."""
    delay = CATALOGUE["transport_delay"]
    scorer = Scorer(reduce_sessions([made.session(made.Bench())], [delay]))
    for wider in (delay.wider(list(delay.gains)) for _ in range(2)):
        fitted = scorer.fit([Choice(wider)])
        found = parameters(fitted, wider, 1.0)["delay"]
        assert found.value == pytest.approx(fitted.values["delay"] * scorer.reduced.layout.scales.of("s"))

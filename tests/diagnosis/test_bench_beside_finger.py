"""Runs of the motor alone beside a finger's runs: one motor, and what it loses shows without a finger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.answer.errors import equation_errors
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.noise import torque_noise
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.next_effect import judge_all
from fingerlab.diagnosis.signals.conditions import runs_to_analyse
from fingerlab.diagnosis.signals.filters import noise_of_derivatives
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Run, Session
from tests.reduced import reduce_sessions

from . import closed_form as made

COULOMB, DIFFERENCE = 5e-3, 2e-3  # N m
SECONDS = 12.0


def rubbing(angle: np.ndarray) -> np.ndarray:
    """Dahl's friction that reverses within a few tenths of a degree, -1 to 1."""
    travel, state = np.radians(0.3), 0.0
    states = []
    for step in np.diff(angle, prepend=angle[0]).tolist():
        turned = float(np.exp(-abs(step) / travel))
        state = turned * state + np.sign(step) * (1.0 - turned)
        states.append(state)
    return np.array(states)


def bench_run(torque: float, difference: float, frequency: float = 0.5, noise: float = 4e-4) -> Run:
    """The motor alone on a sine of 30 degrees: inertia, friction of two sizes, and noise."""
    rng = np.random.default_rng(5)
    time = np.arange(int(SECONDS * made.RATE)) / made.RATE
    angle, _, acceleration = made.tones(time, ((np.radians(30.0), frequency, 0.0),))
    given = made.INERTIA * acceleration + torque * rubbing(angle) + difference
    channels = {
        "motor_command": angle,
        "motor_position": angle + 2e-5 * rng.standard_normal(len(time)),
        "motor_torque": given + noise * rng.standard_normal(len(time)),
        "time": time,
    }
    told = {"kind": "sine", "frequency_hz": frequency, "amplitude_deg": 30.0, "offset_deg": 0.0}
    return Run.from_arrays(
        channels, name="101", phase="motor_bench", cable="none", sample_rate_hz=made.RATE, trajectory=told
    )


def with_more(run: Run, torque: np.ndarray | float) -> Run:
    """The run with more of a torque on the motor, N m."""
    channels = {name: run.channel(name) for name in run.units}
    channels["motor_torque"] = channels["motor_torque"] + torque
    return Run.from_arrays(
        channels, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=made.RATE,
        trajectory=dict(run.trajectory),
    )  # fmt: skip


def with_inertia(run: Run, inertia: float) -> Run:
    """The run with a larger rotor, kg m^2; the command is the motion without the encoder's noise."""
    speed = np.gradient(run.channel("motor_command"), 1 / made.RATE)
    return with_more(run, inertia * np.gradient(speed, 1 / made.RATE))


def finger_session(torque: float, difference: float, noise: float = 4e-4) -> Session:
    """A finger whose motor rubs; the difference between the directions is a constant torque of it."""
    found = made.session(made.Bench(torque_noise=noise), contact=0)
    lost = [torque * rubbing(run.channel("motor_command")) + difference for run in found.runs]
    return replace(found, runs=tuple(with_more(*pair) for pair in zip(found.runs, lost, strict=True)))


NAMES = ("motor_coulomb_friction", "asymmetric_friction", "coulomb_friction", "motor_inertia")


def reduced(*sessions: Session, names: Sequence[str] = NAMES) -> Reduced:
    return reduce_sessions(sessions, [CATALOGUE[name] for name in names])


def judged(difference: float) -> tuple[Scorer, Evidence]:
    finger = finger_session(COULOMB, difference)
    bench = replace(finger, runs=(bench_run(COULOMB, difference),))
    scorer = Scorer(reduced(finger, bench))
    return scorer, judge_all(scorer, scorer.fit_reweighted([]), scorer.reduced.layout.effects, Watch())


@pytest.fixture(scope="module")
def with_difference() -> tuple[Scorer, Evidence]:
    return judged(DIFFERENCE)


def trial_of(evidence: Evidence, name: str) -> FittedModel:
    return next(t for t in evidence.candidates if t.model.choices[-1].effect.id == name)


def test_both_kinds_of_runs_are_read_together() -> None:
    finger = finger_session(0.0, 0.0)
    bench = replace(finger, runs=(bench_run(0.0, 0.0),))
    pairs, alone = runs_to_analyse([bench, finger])
    assert not alone
    assert [run.phase for _, run in pairs] == ["on_air"] * 8 + ["motor_bench"]
    assert runs_to_analyse([bench]) == ([(bench, bench.runs[0])], True)


def test_one_motor_in_all_runs(with_difference: tuple[Scorer, Evidence]) -> None:
    """The bench adds its own unknowns and none twice; each equation sees the signals of its own runs."""
    scorer, evidence = with_difference
    keys = [u.key for u in evidence.base.model.unknowns]
    assert len(set(keys)) == len(keys)
    assert {"torque_gain", "rotor_inertia", "torque_zero", "load_gain", "bench_trace"} <= set(keys)
    assert not {"bench_inertia", "bench_gain", "bench_offset"} & set(keys)
    layout = scorer.reduced.layout
    for group in scorer.reduced.groups:
        mine = (layout.rows() == Row.BENCH) == group.on_bench
        own, other = layout.signals[mine], layout.signals[~mine]
        assert np.all(np.diag(group.whole.products)[other] == 0.0)
        assert np.any(np.diag(group.whole.products)[own] > 0.0)
    bench = next(g for g in scorer.reduced.groups if g.on_bench)
    assert bench.equations == 1
    weights = trial_of(evidence, NAMES[0]).weights[bench.key]
    assert weights[Row.BENCH, Row.BENCH] > 0.0
    assert np.count_nonzero(weights) == 1


def test_a_difference_between_the_directions_is_told_and_measured(
    with_difference: tuple[Scorer, Evidence],
) -> None:
    _, evidence = with_difference
    found = trial_of(evidence, "asymmetric_friction")
    odds = {
        t.model.choices[-1].effect.id: o for t, o in zip(evidence.candidates, evidence.log_odds, strict=True)
    }
    assert odds["asymmetric_friction"] == 0.0
    assert max(odds[name] for name in NAMES if name != "asymmetric_friction") < -3.0
    values = dict(zip((u.key for u in found.model.unknowns), found.fit.values, strict=True))
    assert values["asymmetric_friction.coulomb"] == pytest.approx(COULOMB, rel=0.06)
    assert values["asymmetric_friction.difference"] == pytest.approx(DIFFERENCE, abs=2e-4)
    assert values["rotor_inertia"] == pytest.approx(0.0, abs=2e-5)


def test_friction_alike_in_both_directions_is_no_difference() -> None:
    _, evidence = judged(0.0)
    odds = {
        t.model.choices[-1].effect.id: o for t, o in zip(evidence.candidates, evidence.log_odds, strict=True)
    }
    assert odds["motor_coulomb_friction"] == 0.0
    assert odds["asymmetric_friction"] < -3.0


def test_a_larger_rotor_shows_beside_a_finger_and_is_fitted_without() -> None:
    """Beside a finger the motor has the rig file's inertia; with the motor alone the equation fits it."""
    extra = 4e-4
    finger = finger_session(0.0, 0.0)
    run = with_inertia(bench_run(0.0, 0.0, frequency=2.0), extra)
    runs = (*(with_inertia(r, extra) for r in finger.runs), run)
    scorer = Scorer(reduced(replace(finger, runs=runs), names=["motor_inertia"]))
    fit = scorer.fit_reweighted([Choice(CATALOGUE["motor_inertia"])])
    index, values = fit.model.index, fit.fit.values
    told = values[index["motor_inertia.inertia"]] + values[index["rotor_inertia"]]
    assert told == pytest.approx(extra, rel=0.03)

    alone = Scorer(reduced(replace(finger, runs=(run,))))
    assert "motor_inertia" not in {e.id for e in alone.reduced.layout.effects}
    base = alone.fit_reweighted([])
    found = base.fit.values[base.model.index["bench_inertia"]] * alone.reduced.layout.scales.of("kg m^2")
    assert found == pytest.approx(made.INERTIA + extra, rel=0.01)


def test_a_bench_that_never_repeats_is_as_noisy_as_the_current_beside_it() -> None:
    """White noise of 2 mN m at 1 kHz through the low-pass at 8 Hz leaves the share 2 x 8 / 1000 of it."""
    finger = finger_session(0.0, 0.0, noise=2e-3)
    run = bench_run(0.0, 0.0, noise=2e-3)
    steps = replace(run, trajectory={**run.trajectory, "kind": "steps"})
    both = reduced(replace(finger, runs=(*finger.runs, steps)), names=["motor_coulomb_friction"])
    bench = next(g for g in both.groups if g.on_bench)
    assert bench.noise_samples == 0
    found = torque_noise(both)
    assert found == pytest.approx(2e-3**2 * 16.0 / 1000.0, rel=0.3)
    Scorer(both)
    assert np.diag(bench.noise).max() / bench.noise_samples == pytest.approx(found, rel=0.1)


def test_the_share_explained_is_of_the_torque_that_was_measured() -> None:
    """R2 and error of the motor's equation tell the torque's variance: here nearly all is the bench's."""
    finger, bench = finger_session(0.0, 0.0), bench_run(0.0, 0.0)
    torque = 0.3 * np.sin(np.pi * bench.channel("time"))
    scorer = Scorer(reduced(finger, replace(finger, runs=(with_more(bench, torque),))))
    errors = equation_errors(scorer.reduced, scorer.score_held_out(scorer.bare, residuals=True))
    groups = scorer.reduced.groups
    share = sum(g.samples for g in groups if g.on_bench) / sum(g.samples for g in groups)
    variance = errors["motor_torque"].rmse ** 2 / (1.0 - errors["motor_torque"].r2)
    assert variance == pytest.approx(share * np.var(torque), rel=0.05)


def test_a_rotor_beside_a_finger_is_no_better_known_than_the_encoder_steps() -> None:
    """The acceleration's noise is the step's, though a motion that comes again has it in every cycle."""
    finger, run, step = finger_session(0.0, 0.0), bench_run(0.0, 0.0), np.radians(0.05)
    channels = {name: run.channel(name) for name in run.units}
    channels["motor_position"] = step * np.round(channels["motor_command"] / step)
    coarse = Run.from_arrays(
        channels, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=made.RATE,
        trajectory=dict(run.trajectory),
    )  # fmt: skip
    scorer = Scorer(reduced(finger, replace(finger, runs=(coarse,))))
    group = next(g for g in scorer.reduced.groups if g.on_bench)
    layout = scorer.reduced.layout
    place = next(
        i
        for i, one in enumerate(layout.features)
        if one.row is Row.BENCH and one.parameter == "rotor_inertia" and one.owner is None
    )
    signal = layout.signals[place]
    size = layout.scales.of("rad/s^2")
    least = step**2 / 12.0 * noise_of_derivatives(made.RATE)[2] / size**2
    assert group.noise[signal, signal] / group.noise_samples > 0.9 * least

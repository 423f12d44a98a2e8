"""Constants that every run has of its own: as a dense Gaussian, found in spoiled runs, and out of the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.core.errors import Cancelled
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.equations.features import FeatureSet
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import EquationWeights, RunConstants, RunTotals, schur_complement
from fingerlab.diagnosis.gram.sums import Sums
from fingerlab.diagnosis.score.bench_constants import (
    Contrasts,
    find_constants,
    likeliest_constants,
    likeliest_spreads,
    settle_constants,
)
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Run, Session

from . import closed_form as made

ZEROS_RAD = np.radians([0.4, -0.5, 0.1, -0.1])
OFFSETS_NM = np.array([3e-3, -4e-3, 1e-3, -0.5e-3])


@pytest.mark.parametrize("slack", [0, 3])
def test_what_is_integrated_out_is_a_dense_covariance(slack: int) -> None:
    """Misfit under the inverse of the whole covariance, written down sample by sample.

    Of the last ``slack`` samples the cable equation is no part of it.
    """
    rng = np.random.default_rng(3)
    samples, spreads = 7, np.array([0.3, 0.0, 2.0, 0.5, 0.7])
    root = rng.standard_normal((5, 5))
    weights = root @ root.T + np.eye(5)
    share = rng.standard_normal((5, 5))
    residual = rng.standard_normal((samples, 5))
    loose = residual[samples - slack :]
    # One feature in every equation, each a signal of its own, with coefficient 1.
    pick = FeatureSet(np.arange(5), np.arange(5))
    sums = Sums(residual.T @ residual, loose.T @ loose, samples - slack, slack)
    counts = np.array([samples, slack, 0])
    totals = RunTotals(0, np.stack([residual.sum(axis=0), loose.sum(axis=0), np.zeros(5)]), counts)
    constants = RunConstants(spreads, {("flexion", "free"): share})
    of = EquationWeights.of(weights)
    pull = constants.pull(("flexion", "free"), [totals], pick, of)
    posterior_covariance = constants.posterior_covariance(("flexion", "free"), [totals], of)
    products = EFFECTIVE_SHARE * sums.among(pick, of) - schur_complement(pull, posterior_covariance, pull)
    noise = np.kron(np.eye(samples), np.linalg.inv(EFFECTIVE_SHARE * weights))
    common = np.kron(np.ones((samples, samples)), share @ np.diag(spreads**2) @ share.T)
    told = np.ones((samples, 5), dtype=bool)
    told[samples - slack :, Row.CABLE] = False
    there = np.flatnonzero(told)
    left = residual.reshape(-1)[there]
    dense = left @ np.linalg.solve((noise + common)[np.ix_(there, there)], left)
    assert products.sum() == pytest.approx(dense, rel=1e-9)


def spoiled(zeros: np.ndarray, offsets: np.ndarray, bench: made.Bench) -> Session:
    """Free runs once each, then one contact run four times; constants on MCP angle and torque of these."""
    rng = np.random.default_rng(5)
    session = made.session(bench, 5, contact=0)
    runs = list(session.runs)
    for zero, offset in zip(zeros, offsets, strict=True):
        run = made.contact_run(bench, 1.2, 0.4, 1.0, rng, 10.0, f"{len(runs) + 1:03d}")
        channels = run.load()
        channels["mcp_angle"] = channels["mcp_angle"] + zero
        channels["motor_torque"] = channels["motor_torque"] + offset
        told = {"kind": "sine", "frequency_hz": 1.0, "amplitude_deg": 2.0}
        names = {"name": run.name, "phase": run.phase, "cable": run.cable}
        runs.append(Run.from_arrays(channels, **names, sample_rate_hz=made.RATE, trajectory=told))
    return replace(session, runs=tuple(runs))


def found_in(session: Session) -> RunConstants | None:
    reduction = Reduction([session])
    scorer = Scorer(reduction.of([]))
    bare = scorer.bare
    return find_constants(
        scorer.reduced, bare.model, bare.fit.values, bare.weights, session.rig, reduction.motions
    )


def test_a_clean_bench_has_none() -> None:
    assert found_in(spoiled(np.zeros(4), np.zeros(4), made.Bench())) is None


@pytest.mark.parametrize("missing", [made.Missing(), made.Missing(cubic=(0.3, 0.2))])
def test_moved_zeros_are_told_from_an_offset_whatever_the_law_lacks(missing: made.Missing) -> None:
    bench = made.Bench(missing=missing)
    moved = found_in(spoiled(ZEROS_RAD, np.zeros(4), bench))
    assert moved is not None
    # Either joint's sensor counts to the spread of both: here one of them moved.
    assert 0.4 < moved.spreads[0] / ZEROS_RAD.std(ddof=1) < 1.5
    assert moved.spreads[2] == moved.spreads[3] == 0.0
    drifting = found_in(spoiled(np.zeros(4), OFFSETS_NM, bench))
    assert drifting is not None
    assert 0.6 < drifting.spreads[2] / OFFSETS_NM.std(ddof=1) < 1.6
    assert drifting.spreads[0] == 0.0


def noisy(stiffer: float = 1.0) -> made.Bench:
    """A bench with an encoder of 0.2 degrees, and springs so many times as stiff as the rig file says."""
    bench = made.Bench(position_noise=3e-3, angle_noise=1e-3)
    springs = {name: getattr(made.NOMINAL, name) * stiffer for name in ("mcp_stiffness", "pip_stiffness")}
    return replace(bench, finger=replace(bench.finger, **springs))


@pytest.mark.parametrize("stiffer", [0.8, 1.0, 1.25])
def test_an_offset_is_found_beside_zeros_that_explain_far_more(stiffer: float) -> None:
    """Zeros of a degree bring two hundred times the noise, the offset two, which would turn a verdict."""
    # Not in the zeros' proportions: a spring of another stiffness would look like that.
    found = found_in(spoiled(2.0 * ZEROS_RAD, OFFSETS_NM[[0, 2, 1, 3]], noisy(stiffer)))
    assert found is not None
    assert 0.4 < found.spreads[0] / (2.0 * ZEROS_RAD).std(ddof=1) < 1.5
    assert 0.6 < found.spreads[2] / OFFSETS_NM.std(ddof=1) < 1.6


@pytest.mark.parametrize("stiffer", [0.8, 1.0, 1.25])
def test_zeros_beside_a_spring_of_another_stiffness_are_no_offset(stiffer: float) -> None:
    found = found_in(spoiled(2.0 * ZEROS_RAD, np.zeros(4), noisy(stiffer)))
    assert found is not None
    assert found.spreads[0] > 0.0
    assert found.spreads[2] == found.spreads[3] == 0.0


def test_of_what_the_cable_alone_tells_any_angle_may_have_moved() -> None:
    """A way of the cable that is another one in two runs: by a joint's zero, or by the motor's, as likely."""
    information, shares = np.zeros((1, 5, 5)), np.zeros((1, 5, 5))
    information[0, Row.CABLE, Row.CABLE] = 1e10  # 200 samples of an encoder of half a degree on 10 mm
    shares[0, Row.CABLE, [0, 1, 3]] = 0.010, 0.008, 0.012
    moved = 0.012 * np.radians(0.5)
    pull = np.zeros((1, 5))
    pull[0, Row.CABLE] = moved * information[0, Row.CABLE, Row.CABLE]
    spreads = likeliest_spreads(Contrasts(pull, information, shares, 200.0))
    assert spreads[[2, 4]].tolist() == [0.0, 0.0]
    assert spreads[0] == spreads[1] == pytest.approx(moved / np.hypot(0.010, 0.008), rel=0.3)
    assert spreads[3] == pytest.approx(np.radians(0.5), rel=0.3)


def test_an_offset_in_runs_that_repeat_no_motion_is_found_at_its_size() -> None:
    """A model that was fitted without it has bent to it: what it misses at first is less."""
    session = made.session(made.Bench(), 5, contact=0)
    offsets = [-9e-3, 6e-3, -2e-3, 5e-3]
    runs = [
        made.with_motor_torque(session.runs[k], lambda _, offset=offset: offset)
        for k, offset in zip((0, 3, 5, 7), offsets, strict=True)
    ]
    drifting = replace(session, runs=tuple(runs))
    reduction = Reduction([drifting])
    scorer = Scorer(reduction.of([]))
    bare, rig = scorer.bare, session.rig
    once = find_constants(
        scorer.reduced, bare.model, bare.fit.values, bare.weights, rig, reduction.motions, alone=True
    )
    found, _ = likeliest_constants(reduction, scorer, bare)
    assert once is not None
    assert found is not None
    assert once.spreads[2] < found.spreads[2]
    assert found.spreads[2] == pytest.approx(np.sqrt(np.mean(np.square(offsets))), rel=0.25)
    assert found.spreads[[0, 1, 3]].tolist() == [0.0, 0.0, 0.0]


OFFSETS = {0: -9e-3, 3: 6e-3, 5: -2e-3, 7: 5e-3}
"""Of the amplifier in four runs, as a torque, N m."""


def _drifting() -> Session:
    session = made.session(made.Bench(), 5, contact=2)
    presses = [run for run in session.runs if run.phase == "contact"]
    runs = [
        made.with_motor_torque(session.runs[k], lambda _, offset=offset: offset)
        for k, offset in OFFSETS.items()
    ]
    return replace(session, runs=(*runs, *presses))


def test_an_offset_is_found_where_only_runs_without_it_come_again() -> None:
    """Two presses that agree say nothing of the offsets of four free motions, none of which comes again."""
    reduction = Reduction([_drifting()])
    scorer = Scorer(reduction.of([]))
    assert settle_constants(reduction, scorer) is scorer
    found, _ = likeliest_constants(reduction, scorer, scorer.bare)
    assert found is not None
    assert found.by_averages
    assert found.spreads[2] == pytest.approx(np.sqrt(np.mean(np.square([*OFFSETS.values(), 0, 0]))), rel=0.3)
    assert found.spreads[[0, 1, 3]].tolist() == [0.0, 0.0, 0.0]


def test_constants_that_one_answer_found_are_no_part_of_the_next() -> None:
    """What the second look at a bench found, or was stopped in, is looked for anew."""
    drifting = _drifting()
    kept = Reduction([drifting])
    first = diagnose([drifting], with_curves=False, options=DiagnosisOptions(kept=kept))
    assert first.constants is not None
    assert kept.constants is first.constants

    seen: list[float] = []

    def stop() -> bool:
        return bool(seen) and seen[-1] > 0.9

    with pytest.raises(Cancelled):
        diagnose(
            [drifting], (), lambda share, _: seen.append(share), stop, options=DiagnosisOptions(kept=kept)
        )
    again = diagnose([drifting], with_curves=False, options=DiagnosisOptions(kept=kept))
    assert again.score == first.score
    assert [(c.effect, c.probability) for c in again.candidates] == [
        (c.effect, c.probability) for c in first.candidates
    ]

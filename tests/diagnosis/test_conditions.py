"""Which runs count as one condition, how they are dealt to folds, and what a condition counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fingerlab.diagnosis.answer.errors import held_out_runs
from fingerlab.diagnosis.score.fitted_model import condition_weights
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import MOST_FOLDS
from fingerlab.diagnosis.signals.conditions import folds_of
from tests.reduced import reduce_sessions

from . import closed_form as made


def run(kind: str = "sine", **told: float) -> Any:
    return SimpleNamespace(name="001", attributes={}, trajectory={"kind": kind, **told})


SLOW, FAST = {"frequency_hz": 0.5, "amplitude_deg": 10.0}, {"frequency_hz": 2.0, "amplitude_deg": 10.0}


def test_ten_runs_of_one_motion_are_left_out_one_by_one() -> None:
    folds, places = folds_of([run(**SLOW)] * 10, 10)
    assert places == list(range(10))
    assert {f.condition for f in folds} == {0}
    assert [f.split for f in folds] == list(range(10))


def test_a_further_motion_has_a_fold_of_its_own() -> None:
    folds, places = folds_of([*[run(**SLOW)] * 10, run(**FAST)], 10)
    assert len(folds) == 11
    assert places[-1] == 10
    assert folds[10].condition == 1


def test_runs_of_many_motions_are_not_left_out_all_at_once() -> None:
    folds, _ = folds_of([run(frequency_hz=0.2 * 1.3**k, amplitude_deg=10.0) for k in range(8)], 10)
    assert [f.split for f in folds] == list(range(8))
    assert [f.condition for f in folds] == list(range(8))


def test_more_runs_than_folds_are_dealt_in_turn() -> None:
    folds, places = folds_of([run(**SLOW)] * 25, 10)
    assert len(folds) == 10
    assert places == [k % 10 for k in range(25)]


def test_an_approach_that_was_found_anew_is_the_same_motion() -> None:
    folds, _ = folds_of([run(**SLOW, offset_deg=21.0), run(**SLOW, offset_deg=22.5)], 10)
    assert {f.condition for f in folds} == {0}


@pytest.mark.parametrize(
    "other", [run("chirp", **SLOW), run(**FAST), run(frequency_hz=0.5, amplitude_deg=20.0)]
)
def test_another_kind_speed_or_reach_is_another_motion(other: Any) -> None:
    folds, _ = folds_of([run(**SLOW), other], 10)
    assert [f.condition for f in folds] == [0, 1]


def test_the_number_of_folds_is_bounded() -> None:
    folds, places = folds_of([run(frequency_hz=0.1 * 1.4**k) for k in range(50)], 10)
    assert len(folds) == MOST_FOLDS
    assert set(places) == set(range(MOST_FOLDS))


def test_a_condition_counts_with_the_root_of_its_length_and_a_value_one_on_average() -> None:
    counts = np.array([1000.0, 1000.0, 250.0])
    weights = condition_weights(counts)
    assert weights * counts == pytest.approx(np.array([0.4, 0.4, 0.2]) * counts.sum())


def test_the_score_is_told_for_every_motion_and_they_make_up_the_whole() -> None:
    """Every run stands in one row; a row's square counts with its runs' samples."""
    session = made.session(made.Bench(missing=made.Missing(viscous=(3e-3, 2e-3))))
    scorer = Scorer(reduce_sessions([session], []))
    trial = scorer.fit([])
    assert held_out_runs(session.runs, scorer.reduced, trial) == ()  # not scored yet
    trial = scorer.score_held_out(trial)
    rows = held_out_runs(session.runs, scorer.reduced, trial)
    assert sorted(name for row in rows for name in row.runs) == sorted(run.name for run in session.runs)
    known = {run.name: run for run in session.runs}
    for row in rows:
        for name in row.runs:
            assert (known[name].phase, known[name].cable) == (row.phase, row.cable)
            assert known[name].trajectory["frequency_hz"] == row.trajectory["frequency_hz"]
    counts = trial.misfits[:, 1]
    squares = np.array([row.score**2 - 1.0 for row in rows])
    assert counts @ squares / counts.sum() == pytest.approx(trial.score**2 - 1.0, rel=1e-6)
    assert len(rows) > 2

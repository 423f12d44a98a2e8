"""Sums over signals against the same sums written out feature by feature and sample by sample."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.equations.columns import layout_of
from fingerlab.diagnosis.equations.features import FeatureSet
from fingerlab.diagnosis.gram.decimation import decimated_columns
from fingerlab.diagnosis.gram.run_constants import EquationWeights
from fingerlab.diagnosis.gram.sums import Sums, empty, total
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from tests.reduced import reduce_sessions

from . import closed_form as made

SIGNALS, SAMPLES = 6, 40


@pytest.fixture
def recorded() -> tuple[np.ndarray, np.ndarray, Sums]:
    """Random signals, the moments at which the cable is taut, and their sums."""
    rng = np.random.default_rng(1)
    columns, taut = rng.normal(size=(SAMPLES, SIGNALS)), rng.random(SAMPLES) > 0.3
    loose = columns[~taut]
    sums = Sums(columns.T @ columns, loose.T @ loose, int(taut.sum()), int((~taut).sum()))
    return columns, taut, sums


PICK = FeatureSet(np.array([0, 1, 1, 4, 0]), np.array([Row.MCP, Row.PIP, Row.CABLE, Row.CABLE, Row.PIP]))
OTHER = FeatureSet(np.array([5, 1, 2]), np.array([Row.CABLE, Row.MCP, Row.PIP]))


def features(columns: np.ndarray, taut: np.ndarray, pick: FeatureSet) -> np.ndarray:
    """What the equations see of the signals: nothing of the cable's at slack moments."""
    seen = columns[:, pick.signals].copy()
    seen[np.ix_(~taut, pick.cable)] = 0.0
    return seen


def test_products_are_those_of_the_features(recorded: tuple[np.ndarray, np.ndarray, Sums]) -> None:
    columns, taut, sums = recorded
    seen = features(columns, taut, PICK)
    assert sums.of(PICK) == pytest.approx(seen.T @ seen)


def test_slack_moments_count_for_the_cable_alone(recorded: tuple[np.ndarray, np.ndarray, Sums]) -> None:
    columns, taut, sums = recorded
    hanging = columns[~taut][:, PICK.signals] * PICK.cable
    slack = sums.slack_cable(PICK)
    assert slack is not None
    assert slack == pytest.approx(hanging.T @ hanging)
    assert Sums(sums.products).slack_cable(PICK) is None


def weighted(
    columns: np.ndarray, taut: np.ndarray, covariance: np.ndarray, mine: FeatureSet, theirs: FeatureSet
) -> np.ndarray:
    """Products sample by sample, under the inverse covariance of the equations that say anything then."""
    weights, others = np.linalg.inv(covariance), [r for r in Row if r != Row.CABLE]
    hanging = np.zeros_like(weights)
    hanging[np.ix_(others, others)] = np.linalg.inv(covariance[np.ix_(others, others)])
    result = np.zeros((len(mine.rows), len(theirs.rows)))
    for values, holds in zip(columns, taut, strict=True):
        of = (weights if holds else hanging)[np.ix_(mine.rows, theirs.rows)]
        result += np.outer(values[mine.signals], values[theirs.signals]) * of
    return result


@pytest.fixture
def covariance() -> np.ndarray:
    """Of the equations' noise, most of it shared by all, as the tension's is."""
    root = 0.1 * np.random.default_rng(2).normal(size=(5, 5))
    return root @ root.T + np.outer([1, 1, -1, 1, 1], [1, 1, -1, 1, 1])


def test_weighted_products_across_two_sets_of_features(
    recorded: tuple[np.ndarray, np.ndarray, Sums], covariance: np.ndarray
) -> None:
    columns, taut, sums = recorded
    left = np.random.default_rng(2).normal(size=(3, len(PICK.rows)))
    weights = EquationWeights.of(np.linalg.inv(covariance))
    expected = left @ weighted(columns, taut, covariance, PICK, OTHER)
    assert sums.across(left, PICK, weights, OTHER) == pytest.approx(expected, rel=1e-6)
    assert sums.among(PICK, weights) == pytest.approx(
        weighted(columns, taut, covariance, PICK, PICK), rel=1e-6, abs=1e-6
    )


def test_a_slack_cable_leaves_the_others_the_weight_of_their_own_noise(covariance: np.ndarray) -> None:
    """The inverse of what is left of the covariance without the cable's row and column."""
    weights = EquationWeights.of(np.linalg.inv(covariance))
    found, others = weights.everywhere + weights.where_slack, [r for r in Row if r != Row.CABLE]
    assert found[np.ix_(others, others)] == pytest.approx(np.linalg.inv(covariance[np.ix_(others, others)]))
    assert found[Row.CABLE] == pytest.approx(0.0, abs=1e-9)
    assert weights.everywhere[Row.MCP, Row.MCP] > 1.5 * found[Row.MCP, Row.MCP]
    alone = np.zeros((5, 5))
    alone[Row.BENCH, Row.BENCH] = 4.0
    assert not EquationWeights.of(alone).where_slack.any()


def test_noise_is_taken_from_every_sample_that_counts(
    recorded: tuple[np.ndarray, np.ndarray, Sums],
) -> None:
    _, _, sums = recorded
    noise = np.eye(SIGNALS)
    less = sums.of(PICK) - sums.without(noise).of(PICK)
    # Signal 1 stands in a joint's equation, where every sample counts, and in the cable's, where taut do.
    assert less[1, 1] == pytest.approx(SAMPLES)
    assert less[1, 2] == pytest.approx(sums.taut_samples)
    assert less[2, 2] == pytest.approx(sums.taut_samples)
    assert less[0, 1] == 0.0


def test_noise_of_the_taut_moments_may_differ(recorded: tuple[np.ndarray, np.ndarray, Sums]) -> None:
    _, _, sums = recorded
    noise, taut_noise = np.eye(SIGNALS), 0.25 * np.eye(SIGNALS)
    less = sums.of(PICK) - sums.of(PICK, noise[PICK.square], taut_noise[PICK.square])
    assert less[1, 1] == pytest.approx(SAMPLES)
    assert less[1, 2] == pytest.approx(0.25 * sums.taut_samples)


def test_a_total_is_the_sum_of_its_parts(recorded: tuple[np.ndarray, np.ndarray, Sums]) -> None:
    columns, taut, whole = recorded
    halves = []
    for part in (slice(0, 20), slice(20, None)):
        some, here = columns[part], taut[part]
        loose = some[~here]
        halves.append(Sums(some.T @ some, loose.T @ loose, int(here.sum()), int((~here).sum())))
    added = total([*halves, empty(SIGNALS)])
    assert added.of(PICK) == pytest.approx(whole.of(PICK))
    assert (added.taut_samples, added.slack_samples) == (whole.taut_samples, whole.slack_samples)


def test_a_shared_signal_is_the_same_in_every_run_and_phase() -> None:
    """Features that the layout takes for one signal must be one in runs that the layout has not seen."""
    session = made.session(made.Bench(), 1, contact=1)
    effects = list(CATALOGUE.values())
    layout = reduce_sessions([session], effects).layout
    assert layout.signal_count < 0.7 * len(layout.features)
    for run in (session.runs[0], session.runs[-1]):
        motion = next(segments_of(run, session.rig))
        shared = decimated_columns(motion, effects, layout.signals).columns[:, layout.signals]
        apart = decimated_columns(motion, effects, np.arange(len(layout.features))).columns
        assert np.array_equal(shared, apart)


def test_a_layout_does_not_depend_on_the_run_it_is_made_from() -> None:
    session = made.session(made.Bench(), 1, contact=1)
    effects = list(CATALOGUE.values())
    layouts = [
        layout_of(next(segments_of(run, session.rig)).head(), session, effects)
        for run in (session.runs[0], session.runs[-1])
    ]
    assert np.array_equal(layouts[0].signals, layouts[1].signals)

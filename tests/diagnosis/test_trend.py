"""Which part of a slow trend over a run counts as noise: what differs from run to run."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.gram.grouping import remove_common_trend
from fingerlab.diagnosis.gram.sums import Group, empty

RNG = np.random.default_rng(5)
SIGNALS, DEGREES, RUNS = 3, 3, 400


def group_with(trends: list[np.ndarray], phase: str = "free") -> Group:
    """A group whose noise holds the whole of its runs' trends."""
    noise = sum(t @ t.T for t in trends)
    group = Group(("extension", phase), -1, [empty(SIGNALS)], np.asarray(noise))
    group.trends[0, 0] = trends
    return group


def test_a_trend_that_comes_again_is_no_noise() -> None:
    group = group_with([np.arange(1.0, 10.0).reshape(SIGNALS, DEGREES)] * 4)
    remove_common_trend(group)
    assert group.noise == pytest.approx(np.zeros((SIGNALS, SIGNALS)), abs=1e-9)


def test_what_differs_from_run_to_run_stays_noise() -> None:
    """Independent trends of unit variance keep their products, the common one beneath them is taken out."""
    common = 50.0 * RNG.standard_normal((SIGNALS, DEGREES))
    group = group_with([common + RNG.standard_normal((SIGNALS, DEGREES)) for _ in range(RUNS)])
    remove_common_trend(group)
    assert group.noise / RUNS == pytest.approx(DEGREES * np.eye(SIGNALS), abs=0.5)


def test_runs_of_which_each_has_a_motion_of_its_own_are_compared_with_each_other() -> None:
    """A sensor warms up whatever the motion; runs of a repeated condition stay among themselves."""
    trend = np.arange(1.0, 10.0).reshape(SIGNALS, DEGREES)
    group = group_with([trend] * 2)
    other = [2.0 * trend, 2.0 * trend, 2.0 * trend]
    group.noise += sum(t @ t.T for t in other)
    group.trends.update({(k, 0): [t] for k, t in enumerate(other, start=1)})
    remove_common_trend(group)
    assert group.noise == pytest.approx(np.zeros((SIGNALS, SIGNALS)), abs=1e-9)


def test_first_and_second_minute_of_a_run_are_not_compared() -> None:
    trend = np.ones((SIGNALS, DEGREES))
    group = group_with([trend])
    group.noise += trend @ trend.T
    group.trends[0, 1] = [trend]
    remove_common_trend(group)
    assert group.noise == pytest.approx(np.full((SIGNALS, SIGNALS), 2.0 * DEGREES))


@pytest.mark.parametrize(("phase", "runs"), [("contact", 4), ("free", 1)])
def test_a_single_run_and_a_settling_tip_keep_it(phase: str, runs: int) -> None:
    group = group_with([np.ones((SIGNALS, DEGREES))] * runs, phase)
    remove_common_trend(group)
    assert group.noise == pytest.approx(np.full((SIGNALS, SIGNALS), float(runs * DEGREES)))

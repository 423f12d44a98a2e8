"""What one step of an effect's gains promises, against the step of the whole model and against whole fits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.next_effect import ScoreTest
from fingerlab.effects import CATALOGUE
from tests.reduced import reduce_sessions

from . import closed_form as made

STOP = CATALOGUE["joint_stop"]


@pytest.fixture(scope="module")
def scorer() -> Scorer:
    """A joint that meets a stiff end: without it the constants of the rig file go to theirs."""
    bench = made.Bench(missing=made.Missing(stop=(-0.3, 0.6)))
    return Scorer(reduce_sessions([made.session(bench, 2)], [STOP]))


@pytest.mark.parametrize("shape", [4, 5, 7])
def test_constants_at_their_ends_may_come_back_beside_an_effect(scorer: Scorer, shape: int) -> None:
    """The bounded least squares of scipy over every unknown of the model with the effect is the judge."""
    base = scorer.bare
    test = ScoreTest(scorer.data, base)
    assert len(test.held) > 5
    model = scorer.model([Choice(STOP, shape)], base.model.tip_law)
    values = np.array([base.values.get(unknown.key, 0.0) for unknown in model.unknowns])
    fitter = Fitter(model, scorer.data, base.weights)
    fitter.set_friction_weights(values, apart=False)
    gradient, information = fitter.normal_equations(values)
    held = {base.model.unknowns[i].key for i in test.held}
    bounded = np.array([u.key in held or u.key.startswith(STOP.id) for u in model.unknowns])
    scale = 1.0 / np.sqrt(np.diag(information))
    sizes, ways = np.linalg.eigh(information * np.outer(scale, scale))
    sizes = np.sqrt(np.maximum(sizes, 1e-12))
    low = np.where(bounded, np.minimum((model.low - values) / scale, -1e-12), -np.inf)
    high = np.where(bounded, np.maximum((model.high - values) / scale, 1e-12), np.inf)
    target = -(ways.T @ (gradient * scale)) / sizes
    step = lsq_linear(sizes[:, None] * ways.T, target, (low, high), method="bvls").x * scale
    assert test.gain(STOP, shape) == pytest.approx(-2 * gradient @ step - step @ information @ step, rel=0.01)


def test_a_point_that_promises_more_than_is_missed_is_not_the_only_one_tried(scorer: Scorer) -> None:
    """As if far less were missed: the point then is the best of those that promise no more."""
    test = ScoreTest(scorer.data, scorer.bare)
    gains = np.array([test.gain(STOP, i) for i in range(len(STOP.shapes))])
    best, second = np.argsort(-gains)[:2]
    assert test.best_of_possible(STOP, int(best)) == []
    test.missed = float(gains[[best, second]].mean())
    assert test.best_of_possible(STOP, int(best)) == [int(second)]
    test.missed = -1.0
    assert test.best_of_possible(STOP, int(best)) == []


@pytest.mark.filterwarnings("error")
def test_what_the_model_explains_entirely_promises_nothing(scorer: Scorer) -> None:
    """The effect beside itself: what is left of its curvature is rounding, whose root had been taken."""
    with_it = scorer.fit_reweighted([Choice(STOP, 5)], scorer.bare)
    test = ScoreTest(scorer.data, with_it)
    all_of_it = float(with_it.fit.cost)
    assert abs(test.gain(STOP, 5)) < 0.01 * all_of_it

"""A scorer answers the same whatever it was asked before; a fitted model stays what it is."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.effects import CATALOGUE
from tests.reduced import reduce_sessions

from . import closed_form as made

EFFECTS = [CATALOGUE[name] for name in ("coulomb_friction", "motor_viscous_friction")]


def scorer() -> Scorer:
    session = made.session(made.Bench(missing=made.Missing(motor_viscous=3e-3)), 2)
    return Scorer(reduce_sessions([session], EFFECTS))


def told(fitted: FittedModel) -> tuple[list[float], ...]:
    """Values, misfits and what the last effect would do, to the last bit."""
    return fitted.fit.values.tolist(), fitted.misfits.tolist(), fitted.sensitivity.falls.tolist()


def test_what_was_asked_before_changes_no_answer() -> None:
    fresh, asked = scorer(), scorer()
    nominal = asked.fit_reweighted([])
    for effect in EFFECTS:  # other models, under other weights
        asked.with_sensitivity(asked.score_held_out(asked.fit_reweighted([Choice(effect)], nominal)))
    answers = []
    for one in (fresh, asked):
        start = one.fit_reweighted([])
        fitted = one.fit([Choice(EFFECTS[1])], start)
        answers.append([told(one.with_sensitivity(one.score_held_out(m))) for m in (start, fitted)])
    assert answers[0] == answers[1]


def test_a_model_is_scored_under_the_weights_of_its_fit() -> None:
    """A model that leaves less calls less of it noise; under its own weights it is the likelier."""
    one = scorer()
    nominal = one.fit_reweighted([])
    better = one.fit_reweighted([Choice(EFFECTS[1])], nominal)
    under_nominal = one.fit(better.choices, better, weights=nominal.weights)
    for key, weights in nominal.weights.items():
        assert under_nominal.weights[key] is weights
        assert np.all(np.diag(better.weights[key]) >= 0.9 * np.diag(weights))
    assert one.deviance(better) < one.deviance(under_nominal) < one.deviance(nominal)


def test_a_fitted_model_cannot_be_changed() -> None:
    fitted = scorer().fit([])
    with pytest.raises(FrozenInstanceError):
        fitted.weights = {}  # type: ignore[misc]

"""Models with an effect exchanged: what their odds make of the probabilities, and how they are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.answer.results import OtherModel, PathStep
from fingerlab.diagnosis.score.evidence import judge, with_lack_of_fit, with_rivals
from fingerlab.effects import CATALOGUE
from fingerlab.report import diagnosis_words as words
from fingerlab.report.score_words import path_sentence
from tests.ui import invented

from .invented import at_score

OTHERS = [name for name in CATALOGUE if name not in ("transport_delay", "cable_slack")]


def judged(base: float):
    """Evidence where no effect changes anything."""
    return judge(at_score(base), [at_score(base, name) for name in OTHERS])


def test_a_model_three_times_as_likely_takes_three_quarters() -> None:
    before = judged(1.1)
    after = with_rivals(before, {"stribeck_friction": float(np.log(3.0))})
    place = OTHERS.index("stribeck_friction")
    assert after.nothing == pytest.approx(before.nothing / 4)
    assert after.unknown == pytest.approx(before.unknown / 4)
    assert after.probabilities[place] == pytest.approx(0.75 + before.probabilities[place] / 4)
    assert after.probabilities.sum() + after.nothing + after.unknown == pytest.approx(1.0)
    assert after.verdict == "missing_effect"
    assert after.best.last_effect.id == "stribeck_friction"
    instead = after.odds.instead
    assert instead is not None
    assert instead[place] == pytest.approx(0.75)
    assert instead.sum() + after.odds.found.sum() + after.nothing + after.unknown == pytest.approx(1.0)
    assert before.odds.instead is None


def test_two_models_as_likely_as_the_one_given_leave_it_a_third() -> None:
    before = judged(1.1)
    after = with_rivals(before, {"stribeck_friction": 0.0, "backlash": 0.0})
    assert after.nothing == pytest.approx(before.nothing / 3)
    assert with_rivals(before, {}) is before


@pytest.mark.parametrize("score", [1.45, 1.6])
def test_nothing_is_not_missing_where_a_third_of_a_floor_is_left(score: float) -> None:
    """Neither of a bare model nor after an addition."""
    for added in ((), ("coulomb_friction",)):
        evidence = replace(judged(1.1), base=at_score(score, *added))
        assert evidence.verdict == "nothing_missing"
        after = with_lack_of_fit(evidence, evidence.base)
        assert after.verdict == "not_in_catalogue"
        assert after.nothing + after.unknown == pytest.approx(evidence.nothing + evidence.unknown)
    # One long condition in which much is left weighs less in the misfit than in the score, which is told.
    long = replace(at_score(1.0), misfits=np.array([[3500.0, 3000.0], *[[0.0, 100.0]] * 5]))
    assert long.score > 1.41
    assert long.misfit < long.count
    told = replace(judged(1.1), base=long)
    assert with_lack_of_fit(told, long).verdict == "not_in_catalogue"
    plain = judged(1.1)
    assert with_lack_of_fit(plain, plain.base).verdict == "nothing_missing"


@pytest.mark.parametrize(
    ("left", "verdict"), [(1.5, "missing_effect"), (2.5, "missing_effect"), (4.0, "not_in_catalogue")]
)
def test_no_effect_is_missing_where_a_path_leaves_a_tenth_of_ten_floors(left: float, verdict: str) -> None:
    """Squared, 2.5 floors are a sixteenth of ten, and 4.0 a sixth."""
    best = at_score(left, "backlash")
    evidence = judge(at_score(10.0), [best, at_score(10.0, "viscous_friction")])
    assert evidence.verdict == "missing_effect"
    assert with_lack_of_fit(evidence, best).verdict == verdict


@pytest.mark.parametrize(("others", "verdict"), [(0, "missing_effect"), (1, "not_in_catalogue")])
def test_what_two_effects_leave_may_be_half_as_much(others: int, verdict: str) -> None:
    """Three of ten floors are a twelfth of the square."""
    evidence = judge(at_score(10.0), [at_score(3.0, "backlash")])
    path = [*["viscous_friction"][:others], "backlash"]
    assert with_lack_of_fit(evidence, at_score(3.0, *path)).verdict == verdict


@pytest.mark.parametrize(
    ("left", "verdict"), [(1.3, "missing_effect"), (1.35, "not_in_catalogue"), (1.41, "not_in_catalogue")]
)
def test_no_effect_is_missing_where_half_is_left(left: float, verdict: str) -> None:
    """Of a squared score of 1.25 above one 1.3 floors leave 0.69, 1.35 leave 0.82."""
    best = at_score(left, "backlash")
    evidence = judge(at_score(1.5), [best, at_score(1.5, "viscous_friction")])
    evidence = replace(evidence, probabilities=np.array([0.9, 0.0]), nothing=0.05, unknown=0.05)
    assert with_lack_of_fit(evidence, best).verdict == verdict
    far = replace(evidence, base=at_score(2.0))  # of which that is less than a half
    assert with_lack_of_fit(far, best).verdict == "missing_effect"


def test_an_exchange_is_told_with_its_figures() -> None:
    wrong = replace(
        invented.friction_diagnosis("s.h5"),
        score=1.6,
        better=OtherModel(("coulomb_friction",), ("stribeck_friction",), ("stribeck_friction",), 1.06, 3.0),
        path=(PathStep(None, 1.6), PathStep("stribeck_friction", 1.06, "coulomb_friction")),
    )
    assert words.verdict_sentence(wrong).startswith(
        "Another model of these recordings is better: Stribeck joint friction in place of Coulomb joint "
        "friction takes the error on runs left out of the fit from 1.60 to 1.06 times the bench's own "
        "repeatability. It is 20 times as likely."
    )
    assert "Stribeck joint friction in place of Coulomb joint friction to 1.06" in path_sentence(wrong)
    told = wrong.to_json()
    assert told["better_model"] == {
        "remove": ["coulomb_friction"],
        "add": ["stribeck_friction"],
        "score": 1.06,
        "log_odds": 3.0,
    }
    assert told["path"][1] == {"added": "stribeck_friction", "removed": "coulomb_friction", "score": 1.06}
    assert invented.friction_diagnosis("s.h5").to_json()["better_model"] is None
    same = replace(wrong, better=OtherModel(("coulomb_friction",), ("stribeck_friction",), (), 1.6, 3.0))
    assert "leaves about the same error" in words.better_sentence(same)

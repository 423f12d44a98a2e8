"""Odds turned into probabilities: closed forms, and made-up trials in which it is known what is right."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.score.calibration import (
    CalibrationTable,
    Odds,
    ProbabilityMap,
    SessionFeature,
    Verdict,
    calibrated,
    calibration,
)
from tests.hidden.sweep.calibrate import (
    KnownTrial,
    answer,
    bound,
    calibration_error,
    fit_table,
    fit_thresholds,
    page,
    weighed,
)

EFFECTS = ("coulomb_friction", "stribeck_friction", "cable_stretch")
VERDICT = Verdict.MISSING_EFFECT
NOTHING, UNKNOWN = Verdict.NOTHING_MISSING, Verdict.NOT_IN_CATALOGUE
PLAIN = ProbabilityMap(uninformative_verdict=-700.0, uninformative_effect=-700.0)
SESSION = {"runs": 10.0, "seconds": 20.0, "rate": 1000.0, "floor": 0.1, "score": 3.0, "left": 1.1}


def table(**more: object) -> CalibrationTable:
    usual = {"rate": SessionFeature("samples a second", "Hz", math.log(500.0), 1.0, 180.0, 1400.0)}
    far = tuple(np.linspace(0.0, 2.0, 41).tolist())
    return CalibrationTable(
        "0", 100, 100, "made up", PLAIN, {"any": 3.0}, usual, far, {"on_air": 1.0}, 0.0, 0.95
    )


def test_a_map_that_changes_nothing_gives_the_odds_back() -> None:
    odds = Odds(EFFECTS, np.array([0.5, 0.2, 0.1]), np.array([0.0, 0.02, 0.08]), 0.06, 0.04)
    told = PLAIN.probabilities(odds)
    assert told == pytest.approx([0.5, 0.22, 0.18, 0.06, 0.04])
    assert odds.answers == (*EFFECTS, NOTHING, UNKNOWN)


def test_sharpness_is_a_power_of_the_odds() -> None:
    odds = Odds(EFFECTS, np.array([0.8, 0.2, 0.0]), np.zeros(3), 0.0, 0.0)
    half = ProbabilityMap(uninformative_verdict=-700.0, uninformative_effect=-700.0, effect=0.5)
    told = half.probabilities(odds)
    assert told[0] / told[1] == pytest.approx(math.sqrt(0.8 / 0.2), rel=1e-6)
    assert told.sum() == pytest.approx(1.0)
    # A lapse in every second session, where all effects are as likely: 0.5 * share + 0.5 / 3.
    lapses = ProbabilityMap(
        uninformative_verdict=-700.0, uninformative_effect=0.0, sharpness_uninformative=0.0
    )
    assert lapses.probabilities(odds)[:3] == pytest.approx([0.4 + 1 / 6, 0.1 + 1 / 6, 1 / 6], abs=1e-6)
    # What a path leaves makes it likelier: the odds of it are e times as large at e floors.
    more = ProbabilityMap(
        uninformative_verdict=-700.0,
        uninformative_effect=0.0,
        uninformative_effect_slope=1.0,
        sharpness_uninformative=0.0,
    )
    share = math.e / (1.0 + math.e)
    assert more.probabilities(odds, left=math.e)[2] == pytest.approx(share / 3, abs=1e-6)


def test_what_stands_in_place_of_a_given_effect_keeps_the_odds_of_whole_models() -> None:
    """Whatever trials say of effects beside a model: three models in four are the one as given."""
    rest, instead = np.array([0.1, 0.0, 0.05]), np.array([0.0, 0.25, 0.0])
    odds = Odds(EFFECTS, rest, np.zeros(3), 0.55, 0.05, instead)
    quiet = ProbabilityMap(
        verdict=0.5, nothing_offset=-3.0, uninformative_verdict=-1.0, uninformative_effect=-700.0
    )
    beside = quiet.probabilities(Odds(EFFECTS, rest, np.zeros(3), 0.55, 0.05))
    assert quiet.probabilities(odds) == pytest.approx(0.75 * beside + [0.0, 0.25, 0.0, 0.0, 0.0])
    # Where in every second session no law is the bench's, half as much stands for the exchange.
    lapses = quiet.probabilities(odds) - replace(quiet, uninformative_effect=0.0).probabilities(odds)
    assert lapses[1] > 0.1


def test_nothing_to_try_leaves_the_two_answers_that_are_no_effect() -> None:
    told = PLAIN.probabilities(Odds((), np.zeros(0), np.zeros(0), 0.75, 0.25))
    assert told == pytest.approx([0.75, 0.25])


def test_split_conformal_bound_by_hand() -> None:
    """Of n values the ceil(0.95 (n + 1))-th smallest: of 19 the largest, of 39 the last but one."""
    assert bound(np.arange(19.0), np.ones(19)) == 18
    assert bound(np.arange(39.0), np.ones(39)) == 37
    assert bound(np.arange(99.0), np.ones(99)) == 94
    # A value that counts for three is as three of them: 0 to 36, and the last three times.
    assert bound(np.arange(37.0), np.append(np.ones(36), 3.0)) == 36


def test_every_kind_of_bench_counts_as_often_as_it_is_drawn() -> None:
    """Of a hundred trials 20, 66, 8 and 6 are drawn; here 40, 40, 10 and 10 came."""
    truths = [(NOTHING,)] * 40 + [EFFECTS[:1]] * 40 + [EFFECTS[:2]] * 10 + [(UNKNOWN,)] * 10
    made = [replace(one, truth=truth) for one, truth in zip(trials(100, 1.0, 7), truths, strict=True)]
    sums = [sum(t.weight for t in weighed(made) if t.truth == truth) for truth in dict.fromkeys(truths)]
    assert sums == pytest.approx([20.0, 66.0, 8.0, 6.0])


def test_a_single_trial_far_behind_moves_no_set_of_an_effect() -> None:
    """Twenty trials of an effect, one of them 5 nats behind, among 300 of its kin that are first."""
    usual = {"left": 1.0}

    def first(effect: str, behind: float) -> KnownTrial:
        found = np.where(np.array(EFFECTS) == effect, math.exp(-behind), 1e-6)
        found[(EFFECTS.index(effect) + 1) % len(EFFECTS)] = 1.0 if behind else 1e-6
        odds = Odds(EFFECTS, found / found.sum(), np.zeros(3), 0.0, 0.0)
        return KnownTrial(0, "twin", (effect,), odds, usual, "on_air", False, VERDICT)

    kin = [first("stribeck_friction", 0.0)] * 300
    own = [first("coulomb_friction", 0.0)] * 19 + [first("coulomb_friction", 5.0)]
    held = fit_thresholds([*kin, *own], table())
    assert held[f"{VERDICT}/coulomb_friction"] == 0.0
    assert held[f"{VERDICT}/stribeck_friction"] == 0.0
    # Six of 22 that lie so far behind are no chance, and all that far are in its set.
    often = fit_thresholds([*kin, *own[:16], *own[19:] * 6], table())
    assert often[f"{VERDICT}/coulomb_friction"] == pytest.approx(5.0)
    assert often[f"{VERDICT}/stribeck_friction"] == 0.0


def test_the_set_holds_what_lies_within_the_bound_of_its_kind() -> None:
    one = table()
    kinds = {"any": 0.5, f"{VERDICT}/cable_stretch": 4.0, f"{VERDICT}/Joint friction": 1.0}
    kinds[f"{VERDICT}/{NOTHING}"] = 0.0
    by_kind = CalibrationTable(**{**vars(one), "thresholds": kinds})
    answers = (*EFFECTS, NOTHING, UNKNOWN)
    told = 0.09 * np.exp([0.0, -1.1, -3.9, -0.1, -0.4])
    assert by_kind.conformal_set(VERDICT, answers, told) == ("coulomb_friction", UNKNOWN, "cable_stretch")
    left = ("cable_stretch",)  # what leaves too much is out, whatever the bound of its kind
    assert by_kind.conformal_set(VERDICT, answers, told, left) == ("coulomb_friction", UNKNOWN)


def test_what_is_told_with_one_in_ten_is_in_the_set() -> None:
    strict = CalibrationTable(**{**vars(table()), "thresholds": {"any": 0.0}})
    told = np.array([0.55, 0.34, 0.09, 0.01, 0.01])
    assert strict.conformal_set(VERDICT, (*EFFECTS, NOTHING, UNKNOWN), told) == EFFECTS[:2]


def test_an_unusual_session_is_told_and_its_odds_are_drawn_together() -> None:
    odds = Odds(EFFECTS, np.array([0.9, 0.09, 0.01]), np.zeros(3), 0.0, 0.0)
    usual, said = calibrated(odds, VERDICT, {"rate": 500.0}, "on_air", table())
    assert said.typicality == pytest.approx(1.0)
    assert (said.unusual, said.widening) == ((), 1.0)
    assert usual[0] == pytest.approx(0.9, abs=1e-6)
    strange, told = calibrated(odds, VERDICT, {"rate": 50000.0}, "on_air", table())
    assert told.typicality == 0.0
    assert told.widening == 2.0
    assert told.unusual == ("samples a second 50000 Hz (mostly 180 to 1400 Hz)",)
    assert strange[0] / strange[1] == pytest.approx(math.sqrt(10.0), rel=1e-3)
    assert calibrated(odds, VERDICT, {"rate": 500.0}, "motor_bench", table())[1].unusual == (
        "runs of the motor alone and no others",
    )


def trials(count: int, sharp: float, seed: int) -> list[KnownTrial]:
    """Sessions whose odds are what they should be, to the power ``sharp``: with 1 they are right."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(count):
        true = rng.dirichlet([0.4] * 5)
        truth = (*EFFECTS, NOTHING, UNKNOWN)[rng.choice(5, p=true)]
        told = true**sharp / (true**sharp).sum()
        odds = Odds(EFFECTS, told[:3], np.zeros(3), float(told[3]), float(told[4]))
        jitter = {name: v * float(np.exp(0.3 * rng.standard_normal())) for name, v in SESSION.items()}
        made.append(KnownTrial(k, "twin", (truth,), odds, jitter, "on_air", False, VERDICT))
    return made


@pytest.fixture(scope="module")
def fitted() -> CalibrationTable:
    return fit_table(trials(300, 3.0, 1), "test")


def test_odds_that_promise_too_much_are_set_right_on_trials_that_were_not_fitted_to(
    fitted: CalibrationTable,
) -> None:
    judged = trials(1500, 3.0, 2)
    before = calibration_error([answer(one, None) for one in judged])
    after = [answer(one, fitted) for one in judged]
    assert before > 0.15
    assert calibration_error(after) < 0.05
    # The mean of what is told of an answer is how often it is true.
    told = np.array([calibrated(one.odds, one.verdict, one.session, one.phases, fitted)[0] for one in judged])
    share = [np.mean([name in one.truth for one in judged]) for name in (*EFFECTS, NOTHING, UNKNOWN)]
    assert told.mean(axis=0) == pytest.approx(share, abs=0.04)


def test_sets_hold_the_truth_as_often_as_they_say(fitted: CalibrationTable) -> None:
    judged = trials(1500, 3.0, 3)
    assert np.mean([answer(one, fitted).covered for one in judged]) == pytest.approx(0.95, abs=0.03)


def test_the_page_counts_what_was_right_and_keeps_what_was_written_by_hand(fitted: CalibrationTable) -> None:
    judged = trials(40, 1.0, 4)
    said = [answer(one, fitted) for one in judged]
    right = sum(a.first in a.trial.truth for a in said)
    before = "<!-- by hand -->\nWhy it falls short.\n<!-- end of what was written by hand -->"
    text = page(judged, 3, said, fitted, "the command", before)
    row = next(line for line in text.splitlines() if line.startswith("| first answer right"))
    assert row.split("|")[3].strip() == f"{100 * right / 40:.0f} % of 40"
    assert "fitted to 300 trials; 3 more could not be diagnosed" in text
    assert "Why it falls short." in text


def test_the_table_that_comes_with_the_program_can_be_read() -> None:
    known = calibration()
    assert 0.0 <= known.error < 1.0
    assert 0.0 <= known.coverage <= 1.0
    assert list(known.typicality_quantiles) == sorted(known.typicality_quantiles)
    assert "any" in known.thresholds

"""Probabilities and steps from misfits whose verdict a person would not doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.fit.data import temperature_of
from fingerlab.diagnosis.fit.solver import Fit
from fingerlab.diagnosis.score.evidence import (
    alike,
    averaged_over_weights,
    exchanged,
    given_the_others,
    judge,
    judged_with_path,
    no_less_likely,
)
from fingerlab.diagnosis.score.selection import justified, penalty_of_small_excess
from fingerlab.effects import CATALOGUE

from .invented import at_score as trial

SMALL, LARGE = "coulomb_friction", "stribeck_friction"  # one is the other without its excess at low speed
OTHERS = [n for n in CATALOGUE if n not in (SMALL, LARGE, "transport_delay", "cable_slack")]


def judged(base: float, **scores: float):
    """Evidence where the effects named have the scores given and all others change nothing."""
    trials = [trial(score, name) for name, score in scores.items()]
    return judge(trial(base), trials + [trial(base, name) for name in OTHERS if name not in scores])


def named(evidence, name: str) -> float:
    names = [t.model.choices[-1].effect.id for t in evidence.candidates]
    return float(evidence.probabilities[names.index(name)])


def test_score_is_the_error_in_floors() -> None:
    assert trial(1.0).score == pytest.approx(1.0)
    assert trial(7.5).score == pytest.approx(7.5)


@pytest.mark.parametrize("base", [1.0, 1.02, 1.2, 3.0, 50.0])
@pytest.mark.parametrize("best", [1.0, 0.5, 0.02])
def test_probabilities_sum_to_one(base: float, best: float) -> None:
    evidence = judged(base, viscous_friction=1 + (base - 1) * best)
    assert evidence.probabilities.sum() + evidence.nothing + evidence.unknown == pytest.approx(1.0)
    assert np.all(evidence.probabilities >= 0)


@pytest.mark.parametrize("base", [1.0, 1.01, 1.1, 1.2])
def test_a_model_near_its_floor_lacks_nothing(base: float) -> None:
    assert judged(base).nothing > 0.9


@pytest.mark.parametrize("base", [4.0, 12.0, 100.0])
def test_what_no_effect_explains_is_not_in_the_catalogue(base: float) -> None:
    assert judged(base).unknown > 0.9
    assert judged(base, viscous_friction=0.97 * base).unknown > 0.9


@pytest.mark.parametrize("base", [1.6, 4.0, 12.0, 100.0])
def test_what_one_effect_explains_is_that_effect(base: float) -> None:
    assert named(judged(base, spring_hardening=1.01), "spring_hardening") > 0.99


@pytest.mark.parametrize(("base", "left"), [(6.0, 1.1), (12.0, 2.5)])
def test_equals_share_and_are_both_in_the_set(base: float, left: float) -> None:
    evidence = judged(base, viscous_friction=left, stiffness_error=left)
    names = {evidence.candidates[i].model.choices[-1].effect.id for i in alike(evidence)}
    assert names == {"viscous_friction", "stiffness_error"}
    assert named(evidence, "viscous_friction") == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("base", [2.0, 10.0])
def test_the_larger_of_a_nested_pair_must_earn_its_unknowns(base: float) -> None:
    """The larger model never fits worse; a gain of a thousandth is chance."""
    left = 1.05
    luck = np.sqrt(left**2 - 0.001 * (base**2 - left**2))
    evidence = judge(trial(base), [trial(left, SMALL), trial(float(luck), LARGE)])
    assert evidence.probabilities[0] > evidence.probabilities[1]
    earned = judge(trial(base), [trial(0.5 * (base + 1), SMALL), trial(1.05, LARGE)])
    assert earned.probabilities[1] > 0.99


def test_a_step_must_explain_a_share_of_what_is_left() -> None:
    assert justified(trial(10.0), trial(2.0, "viscous_friction"))
    assert not justified(trial(10.0), trial(9.5, "viscous_friction"))
    assert not justified(trial(1.02), trial(1.0, "viscous_friction"))
    assert not justified(trial(5.0), trial(5.0, "viscous_friction"))


def test_more_independent_values_make_a_verdict_surer() -> None:
    few = judged(1.5, viscous_friction=1.38)
    trials = [replace(t, misfits=t.misfits * 10) for t in few.candidates]
    many = judge(replace(few.base, misfits=few.base.misfits * 10), trials)
    assert max(many.nothing, named(many, "viscous_friction")) >= max(
        few.nothing, named(few, "viscous_friction")
    )


@pytest.mark.parametrize(("share", "against"), [(1.0, 0.0), (0.2, 0.0), (0.1, 2.67), (0.01, 10.0)])
def test_a_small_excess_at_low_speed_is_not_stribecks(share: float, against: float) -> None:
    """Half the square of ln(0.2 / share) in units of 0.3, and never more than settles it."""
    found = trial(1.1, LARGE)
    names = found.model.index
    values = [share if "extra" in name else 1.0 for name in names]
    fit = Fit(np.array(values), found.fit.information, found.fit.cost)
    assert penalty_of_small_excess(replace(found, fit=fit)) == pytest.approx(against, abs=0.01)
    assert penalty_of_small_excess(trial(1.1, SMALL)) == 0.0


@pytest.mark.parametrize("base", [3.0, 60.0])
def test_what_further_effects_explain_is_no_sign_of_something_outside(base: float) -> None:
    evidence = judged(base, viscous_friction=0.85 * base)
    assert evidence.unknown > 0.99
    steps = judged_with_path(evidence, trial(1.05, "viscous_friction", "motor_inertia"))
    assert named(steps, "viscous_friction") > 0.99
    assert steps.probabilities.sum() + steps.nothing + steps.unknown == pytest.approx(1.0)


def test_a_path_is_judged_in_its_own_floors() -> None:
    """In the floors of a model with nothing found two effects explain less than something unknown would."""
    first = judged(15.0, motor_inertia=12.3)
    rescored = judged(8.7, motor_inertia=4.2)
    evidence = replace(first, base=rescored.base, candidates=rescored.candidates)
    assert evidence.unknown > 0.99
    path = trial(1.2, "motor_inertia", "stribeck_friction")
    assert named(judged_with_path(evidence, path), "motor_inertia") > 0.99
    # What leaves as much as one effect does is no sign of anything.
    idle = trial(4.2, "motor_inertia", "stribeck_friction")
    assert judged_with_path(evidence, idle) is evidence


def test_odds_are_the_mean_of_those_under_both_weights() -> None:
    """The search's weights prefer a sheath, the found effect's do not: it is hardly told from another."""
    first = judged(4.2, capstan_friction=1.0, load_dependent_friction=1.2)
    last = judged(4.2, capstan_friction=1.2, load_dependent_friction=1.0)
    rescored = replace(first, base=last.base, candidates=last.candidates)
    both = averaged_over_weights(rescored, [trial(1.0, "load_dependent_friction")])
    assert named(first, "capstan_friction") > 0.99
    assert named(last, "load_dependent_friction") > 0.99
    even = 0.5 * (first.log_odds + last.log_odds)
    assert both.log_odds == pytest.approx(even - even.max(), abs=1e-5)
    assert both.probabilities.sum() == pytest.approx(first.probabilities.sum())
    # Where the mean prefers another, the one that the path begins with stays first, and as likely.
    tied = no_less_likely(both, "capstan_friction")
    assert tied.best.last_effect.id == "capstan_friction"
    assert named(tied, "capstan_friction") == pytest.approx(named(tied, "load_dependent_friction"), rel=1e-3)


def test_effects_count_as_they_are_with_refined_shapes() -> None:
    """On their grids both leave two floors; of the one that the path leads to a finer shape leaves one."""
    first = judged(5.0, capstan_friction=1.9, motor_stribeck_friction=2.2)
    assert first.best.last_effect.id == "capstan_friction"
    said = averaged_over_weights(first, [trial(1.1, "motor_stribeck_friction")])
    assert said.best.last_effect.id == "motor_stribeck_friction"
    # A rival whose shape was refined, too, is as likely again.
    near = judged(1.4, motor_presliding=1.30, motor_coulomb_friction=1.09)
    alone = averaged_over_weights(near, [trial(1.05, "motor_coulomb_friction")])
    both = averaged_over_weights(
        near, [trial(1.05, "motor_presliding"), trial(1.05, "motor_coulomb_friction")]
    )
    assert named(both, "motor_presliding") > named(alone, "motor_presliding")


def test_a_plainer_law_takes_the_odds_of_the_one_that_it_replaces() -> None:
    evidence = judged(7.8, motor_coulomb_friction=1.95, asymmetric_friction=1.9)
    before = named(evidence, "asymmetric_friction"), named(evidence, "motor_coulomb_friction")
    after = exchanged(evidence, "asymmetric_friction", "motor_coulomb_friction")
    assert (named(after, "motor_coulomb_friction"), named(after, "asymmetric_friction")) == before
    assert after.best.last_effect.id == "motor_coulomb_friction"
    assert after.probabilities.sum() == pytest.approx(evidence.probabilities.sum())
    # What is likelier already stays as it is.
    assert exchanged(after, "asymmetric_friction", "motor_coulomb_friction") is after


def test_one_effect_alone_is_judged_by_itself() -> None:
    evidence = judged(3.0, viscous_friction=1.1)
    assert judged_with_path(evidence, trial(1.1, "viscous_friction")) is evidence


def test_where_one_stood_for_two_the_verdict_names_what_does_best_beside_the_other() -> None:
    stood_for = judged(7.0, varying_moment_arm=2.3, angle_sensor_nonlinearity=2.5)
    assert named(stood_for, "varying_moment_arm") > named(stood_for, "angle_sensor_nonlinearity")
    beside = judge(
        trial(2.4, "stiffness_error"),
        [
            trial(1.1, "stiffness_error", "angle_sensor_nonlinearity"),
            trial(2.2, "stiffness_error", "varying_moment_arm"),
        ],
    )
    told = given_the_others(stood_for, beside)
    assert named(told, "angle_sensor_nonlinearity") > 0.9
    assert named(told, "stiffness_error") < 1e-100  # it is there in any case, and none of the answers
    assert told.probabilities.sum() == pytest.approx(stood_for.probabilities.sum())


@pytest.mark.parametrize(("count", "runs", "alike"), [(56.0, 4, 4.0), (560.0, 4, 10.0), (5600.0, 4, 16.0)])
def test_a_short_run_tells_as_much_as_it_has_strokes(count: float, runs: int, alike: float) -> None:
    """A misfit of one floor: of values that go together so many count as one, plus one of noise."""
    assert temperature_of(count, count, runs) == pytest.approx(1.0 + alike)
    assert temperature_of(count, count) == pytest.approx(17.0)

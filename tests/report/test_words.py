"""Sentences of an answer that have to agree with its numbers, and with each other."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fingerlab.diagnosis.answer.results import Diagnosis, EquationError, PathStep, RunShare
from fingerlab.diagnosis.score.calibration import CalibratedAnswer
from fingerlab.report.diagnosis_words import (
    calibration_sentence,
    effect_title,
    hidden_sentence,
    in_sentence,
    set_sentence,
    verdict_sentence,
)
from fingerlab.report.recording_words import next_experiment_words
from fingerlab.report.score_words import loose_sentence, row_words
from fingerlab.ui.lab.result_words import set_words


def leaving_open(diagnosis: Diagnosis, score: float) -> Diagnosis:
    """The same at so many floors, with both answers that are no effect in what cannot be ruled out."""
    said = CalibratedAnswer(
        "4", 100, 100, "", 0.7, 0.95, 0.0, ("number of runs 1",), 1.0,
        (*diagnosis.set, "nothing_missing", "not_in_catalogue"),
    )  # fmt: skip
    return replace(diagnosis, score=score, calibration=said)


@pytest.mark.parametrize(("score", "could_be_nothing"), [(35.7, False), (1.5, False), (1.3, True)])
def test_nothing_can_be_all_that_is_missing_only_near_the_floor(alike, score, could_be_nothing) -> None:
    """What leaves two squared floors, 1.41, is never told as nothing missing; so it cannot be left open."""
    text = set_sentence(leaving_open(alike, score))
    assert ("ruled out that nothing is missing or that it is not" in text) is could_be_nothing
    assert "it is not in the catalogue" in text


@pytest.mark.parametrize(("chance", "apart"), [(0.004, True), (0.009, True), (0.0149, True), (0.016, False)])
def test_what_is_told_with_one_in_a_hundred_is_not_said_to_be_below_it(alike, chance, apart) -> None:
    first, second, third = alike.candidates
    second = replace(second, probability=chance, score=2.1)  # of 1.1: nearly as good
    text = set_sentence(replace(alike, candidates=(first, second, third)))
    told = "1 %" if chance > 0.005 else "< 1 %"
    assert (f"Less likely, but not ruled out: cable stretch ({told}, 2.10 floors)." in text) is apart
    assert ("cannot tell apart Coulomb joint friction and cable stretch" in text) is not apart


def test_a_headline_names_only_what_is_probable(alike) -> None:
    """Of three that are not ruled out the last has 1 %: the headline tells of two, and their sum."""
    first, second, third = alike.candidates
    three = replace(
        alike, candidates=(first, second, replace(third, probability=0.012)), set=(*alike.set, third.effect)
    )
    said = verdict_sentence(three)
    assert (
        "(98 % probable), and these data cannot tell which: Coulomb joint friction and cable stretch;" in said
    )
    assert "Less likely, but not ruled out: tilted base (1 %, 12.4 floors)." in set_sentence(three)


def test_what_leaves_twice_the_error_is_not_called_alike(alike) -> None:
    """Of 50 %, 3 % that leaves 12.3 floors for 1.10 could be told from it; 48 % could not."""
    assert "cannot tell apart" in set_sentence(alike)
    first, second, third = alike.candidates
    poor = replace(alike, candidates=(first, replace(second, probability=0.03), third))
    apart = "Less likely, but not ruled out: cable stretch (3 %, 12.3 floors). The one that is truly missing"
    assert set_sentence(poor).startswith(apart)
    assert verdict_sentence(poor).startswith("Coulomb joint friction is missing from the nominal model (50 %")
    near = replace(alike, candidates=(first, replace(second, probability=0.03, score=2.1), third))
    assert "cannot tell apart" in set_sentence(near)


def test_nothing_is_not_said_to_be_missing_where_that_is_the_lesser_part(unseen) -> None:
    doubtful = replace(unseen, probability_nothing=0.35)
    assert verdict_sentence(doubtful).startswith(
        "No effect is shown to be missing from the nominal model, but that none is has a probability of only "
        "35 %: its error"
    )
    assert verdict_sentence(unseen).startswith(
        "Nothing is missing from the nominal model that these data could"
    )


def test_what_a_path_explains_is_said_before_what_nothing_explains(unknown) -> None:
    path = (PathStep(None, 63.2), PathStep("coulomb_friction", 9.1), PathStep("cable_stretch", 4.4))
    found = replace(unknown, path=path, final_model=("coulomb_friction", "cable_stretch"))
    assert (
        "63.2 times the bench's own repeatability; Coulomb joint friction and cable stretch explain a part "
        "of it, down to 4.40, and none of the 3 effects tried explains what is left."
        in verdict_sentence(found)
    )
    assert set_words(found) == "None of the 3 effects tried explains what the path leaves."
    assert set_sentence(found).startswith("What is left is of no effect of the catalogue")
    assert "repeatability, and none of the 3 effects tried explains it." in verdict_sentence(unknown)
    nearly = replace(unknown, candidates=(replace(unknown.candidates[0], score=1.0), *unknown.candidates[1:]))
    told = verdict_sentence(nearly)
    assert "explains it" not in told  # one would explain nearly all, and is not borne out
    assert "; of the 3 effects tried " in told
    assert " comes nearest, with 1.00 floors, and is not borne out (" in told


def test_a_run_that_would_settle_nothing_is_not_proposed(alike) -> None:
    proposal = {**(alike.next_experiment or {}), "chance_alone": 0.0}
    assert next_experiment_words(replace(alike, next_experiment=proposal)) == (
        "No run is known that would settle it: after the best, chirp, 11°, against a known load of 100 mN m, "
        "on air, flexion cable, the chance that the true one stands alone is < 1 %."
    )
    hopeful = replace(alike, next_experiment={**proposal, "chance_alone": 0.4})
    assert next_experiment_words(hopeful).startswith("Record next: chirp, 11°")


def test_an_effect_has_one_name_as_it_was_found(alike) -> None:
    """A title of its own, as a link's weight has it, stands wherever the effect is named."""
    first, second, third = alike.candidates
    weight = "Weight of a link out of balance"
    named = replace(
        alike,
        candidates=(first, replace(second, effect="torque_ripple", title=weight), third),
        set=("coulomb_friction", "torque_ripple"),
        path=(*alike.path, PathStep("torque_ripple", 1.0, title=weight)),
        titles={"torque_ripple": weight},
    )
    lower = weight[0].lower() + weight[1:]
    for said in (verdict_sentence(named), set_sentence(named), set_words(named)):
        assert lower in said
        assert "ripple" not in said


def test_a_cable_that_hung_loose_is_said_beside_its_row(nothing) -> None:
    """11 um of a cable whose floor is 1.6: near the floor over all, because slack hardly counts."""
    loose = RunShare("s.h5", "006", "on_air", "extension", "cable_kinematics", 0.07, 0.068, 0.05, 0.1)
    taut = replace(loose, run="005", left_aside=0.33, squared=0.001)
    errors = {"cable_kinematics": EquationError("m", 11e-6, 0.99996, 1.6e-6)}
    told = replace(nothing, score=1.08, errors=errors, run_shares=(taut, loose))
    assert loose_sentence(told).startswith(
        "The cable's length is that far off where the cable may hang loose, as for 7 % of run 006: its "
    )
    assert loose_sentence(replace(told, score=30.0)) == ""  # there something is missing
    assert loose_sentence(replace(told, run_shares=(replace(loose, left_aside=0.0),))) == ""
    small = {"cable_kinematics": EquationError("m", 1.7e-6, 0.99996, 1.6e-6)}
    assert loose_sentence(replace(told, errors=small)) == ""


def test_what_the_score_allows_to_a_tip_that_rubs_is_said_beside_the_rows(nothing) -> None:
    """54 mN of a floor of 6 mN: a headline of 1.16 allows 39 mN rms for how the tip sticks."""
    force = EquationError("N", 0.054, 0.97, 0.006, rubbing=0.039, seen=0.054)
    told = replace(nothing, score=1.16, errors={"endpoint_force": force}, row_and_score=None)
    said = row_words(told)
    assert said.startswith("The row of endpoint force stands that far above the floor in contact: how a tip ")
    assert "allows 39 mN rms for it" in said
    assert row_words(replace(told, score=3.0)) == ""  # there something is missing
    at_floor = replace(force, rmse=0.007)
    assert row_words(replace(told, errors={"endpoint_force": at_floor})) == ""


def test_what_only_runs_left_out_could_tell_is_said_beside_the_rows(nothing) -> None:
    """233 mN as the other runs foretell it, 31 mN where the fit has seen all, of a floor of 28 mN."""
    force = EquationError("N", 0.233, 0.997, 0.028, rubbing=0.2, seen=0.031)
    told = replace(nothing, score=1.09, errors={"endpoint_force": force}, row_and_score=None)
    said = row_words(told)
    assert said.startswith(
        "The row of endpoint force is of runs as the other runs foretell them, which hardly "
    )
    assert said.endswith("Where the fit has seen all runs, 31 mN are left.")


def needing(found: Diagnosis, *effects: str) -> Diagnosis:
    """The same with a path that takes these effects one after the other."""
    steps = [PathStep(effect, 5.0 / (k + 1)) for k, effect in enumerate(effects)]
    return replace(found, path=(found.path[0], *steps), final_model=effects)


def test_of_effects_that_are_needed_together_none_is_said_to_be_told_apart(alike) -> None:
    """One effect at a time is what probabilities are of; the path needs two."""
    single = replace(alike, set=("coulomb_friction",))
    assert "is told apart from every other effect" in set_sentence(single)
    pair = needing(single, "coulomb_friction", "gravity_tilt")
    assert set_sentence(pair).startswith(
        "No single effect is told apart: the path needs Coulomb joint friction and tilted base together. Of "
        "effects one at a time Coulomb joint friction is the likeliest."
    )
    assert set_words(pair) == "Not enough by itself: the path needs several effects together."
    both = needing(alike, "coulomb_friction", "gravity_tilt")
    assert "The one that is truly missing" in set_sentence(alike)
    assert "The one that is truly missing" not in set_sentence(both)
    assert "the path needs Coulomb joint friction and tilted base together." in set_sentence(both)
    assert verdict_sentence(alike).startswith("One of these is missing")
    assert verdict_sentence(both).startswith("At least one of these is missing")


def test_a_path_without_the_likeliest_effect_is_not_told_as_if_it_held_it(alike) -> None:
    """Its end is the error of its own effects."""
    single = replace(alike, set=("coulomb_friction",))
    other = needing(single, "gravity_tilt", "cable_stretch")
    assert "and with tilted base and cable stretch instead to 2.50" in verdict_sentence(other)
    assert "tilted base as well to 2.50" in verdict_sentence(
        needing(single, "coulomb_friction", "gravity_tilt")
    )


def test_what_the_path_holds_or_is_told_of_already_is_not_said_to_be_hidden(alike) -> None:
    """An effect that shows beside another is seen; one that is not ruled out has its own sentence."""
    unseen = tuple(replace(one, detectable=False) for one in alike.candidates)
    said = hidden_sentence(replace(alike, candidates=unseen))
    assert said == "These data could not show, at a plausible strength: tilted base."
    assert (
        hidden_sentence(needing(replace(alike, candidates=unseen), "coulomb_friction", "gravity_tilt")) == ""
    )


def test_what_no_run_can_tell_for_want_of_a_force_is_said_not_to_be_asked(alike) -> None:
    """Nothing of the contact was recorded: that it is missing must not pass for asked and found absent."""
    open_ = replace(alike, verdict="nothing_missing", errors={"joint_torque": alike.errors["joint_torque"]})
    tried = {c.effect for c in alike.candidates}
    said = set_sentence(open_)
    assert "No run tells the force at the fingertip, so these were not asked: " in said
    for name in ("contact_angle", "contact_compliance", "load_cell_gain"):
        assert name not in tried
        assert in_sentence(effect_title(name)) in said
    motor = replace(open_, errors={"motor_torque": alike.errors["joint_torque"]})
    assert "were not asked" not in set_sentence(motor)


def test_what_is_unusual_of_a_session_is_told_one_thing_after_the_other(alike) -> None:
    unusual = ("runs of the motor alone and no others", "error left 2.3 floors (mostly 1 to 1.4 floors)")
    said = CalibratedAnswer("4", 100, 100, "", 0.7, 0.95, 0.0, unusual, 1.0, alike.set)
    assert (
        "unlike nearly all of those: runs of the motor alone and no others; error left 2.3 floors (mostly 1 "
        "to 1.4 floors). So its probabilities" in calibration_sentence(replace(alike, calibration=said))
    )

"""Constants that the runs put beyond the rig file's tolerances: it is wrong, or an effect hides there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import exp, log
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.integrate import quad

from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.selection import bayes_factor
from fingerlab.report.diagnosis_words import verdict_sentence
from fingerlab.report.score_words import path_sentence
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Session
from tests.diagnosis import closed_form as made
from tests.hidden.sweep.running import record
from tests.hidden.sweep.trials import Trial


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(made.Bench())


def told(session: Session, left_out: Sequence[str] = (), **wrong: float) -> tuple[Diagnosis, list[str]]:
    """The verdict, and what it says of the rig file, of which some constants are so many times too large."""
    finger = session.rig.finger
    assert finger is not None
    finger = replace(finger, **{name: times * getattr(finger, name) for name, times in wrong.items()})
    spoilt = replace(session, rig=replace(session.rig, finger=finger))
    found = diagnose([spoilt], with_curves=False, options=DiagnosisOptions(left_out=left_out))
    return found, [one.sentence for one in found.bench if one.kind == "rig_constant"]


def test_a_right_rig_file_is_not_spoken_of(session: Session) -> None:
    assert told(session)[1] == []


def test_a_length_that_is_too_long_is_told_though_nothing_is_missing(session: Session) -> None:
    """By a tenth, in a rig file that gives it to 0.2 %: a mass that is a little off takes it up.

    So does a spring of 2 mN m/rad along both joints, in a catalogue that has one: what no rig file says is
    then believed before fifty tolerances are. The mass, which gains next to nothing beyond, is not told.
    """
    with_spring, _ = told(session, distal_half_length=1.1)
    assert with_spring.final_model == ("joint_coupling",)
    found, (sentence,) = told(session, left_out=["joint_coupling"], distal_half_length=1.1)
    assert found.verdict == "nothing_missing"
    assert sentence == (
        "By these runs the distal half length (at least 0.50 % lower) is not what the rig file says, within "
        "its tolerance"
    )
    (said,) = [one.to_json() for one in found.bench if one.kind == "rig_constant"]
    assert said["finding"] == "unit"
    assert said["channel"] == "rig"
    assert said["advice"].startswith("Measure it again")


def test_a_rotor_that_hides_behind_constants_is_told_by_them(tmp_path: Path) -> None:
    """Of 0.8 of its usual strength: the score is 1.02 either way, nine constants are off by 21 or by 2."""
    record(Trial("twin", "rich", ("motor_inertia",), 133), tmp_path / "rotor.h5")
    found = diagnose([open_session(tmp_path / "rotor.h5")], with_curves=False)
    assert found.verdict == "missing_effect"
    assert found.final_model == ("motor_inertia",)
    first = found.candidates[0]
    assert (first.effect, first.detectable) == ("motor_inertia", True)
    assert first.probability > 0.7
    assert "What speaks for it are the rig's constants: without it they are off by 2" in first.explanation
    spoken_for = {one.effect for one in found.candidates if "rig's constants" in one.explanation}
    assert spoken_for <= set(found.set)  # not of what is ruled out
    assert "rig_constant" not in [one.kind for one in found.bench]
    assert path_sentence(found).startswith("The error stays at 1.02 with other inertia")
    assert verdict_sentence(found).endswith("and what speaks for it are the rig's constants.")


def test_constants_that_have_gone_astray_are_led_back_beside_the_effect_they_stood_for() -> None:
    """Under the thesis' protocol a spring that is a quarter stiffer drives them off by 38 in chi-square.

    From there no few steps beside the spring led back: it was told as an error of the angle sensors, 72 %.
    """
    finger = replace(
        made.NOMINAL,
        mcp_stiffness=1.25 * made.NOMINAL.mcp_stiffness,
        proximal_mass=1.02 * made.NOMINAL.proximal_mass,
        distal_mass=0.985 * made.NOMINAL.distal_mass,
    )
    bench, rng = made.Bench(finger=finger), np.random.default_rng(3)
    free = [made.free_run(bench, (-1, 4.0, ((2.0, 1.0, 0.0),)), rng, 10.0, k) for k in range(4)]
    pressing = [made.contact_run(bench, 1.2, 0.6, 1.0, rng, 10.0, f"{k + 5:03d}") for k in range(4)]
    runs = (*free, *pressing)
    found = diagnose([Session(Path("x.h5"), "", "", made.RIG, runs)], with_curves=False)
    first = found.candidates[0]
    assert first.effect == "stiffness_error"
    assert first.probability > 0.85
    assert found.last is not None
    assert found.last.constants_off < 9.0
    missing = first.parameters["stiffness_mcp"].value
    assert missing == pytest.approx(0.25 * made.NOMINAL.mcp_stiffness, rel=0.2)


@pytest.mark.parametrize(("without", "beside"), [(20.0, 2.0), (4.0, 2.0), (2.0, 10.0)])
def test_constants_weigh_an_effect_by_their_tolerances(without: float, beside: float) -> None:
    """The misfit tells nothing: the mean over strengths, evenly in their logarithm, of what constants say."""
    strength = 0.8

    def likelihood(s: float) -> float:
        # Normal about the strength that was fitted; constants that are off with it are so beyond it, too.
        t = s / strength if without > beside else min(s / strength, 1.0)
        return exp(0.5 * (without - beside) * t * (2.0 - t))

    expected = quad(lambda x: likelihood(exp(x)), log(0.5), log(2.0), points=[log(strength)])[0] / log(4.0)
    base, fitted = _with_constants(without, 0.0), _with_constants(beside, strength)
    assert bayes_factor(base, fitted, fall=0.0, needed=100.0) == pytest.approx(expected, rel=0.03)


def _with_constants(off: float, strength: float) -> FittedModel:
    """What a factor asks of a model; its effect would hardly show."""
    asked = SimpleNamespace(
        constants_off=off,
        strength_beside=lambda base: strength,
        strength_of_all=lambda base: strength,
        sensitive_fall=1e-6,
    )
    return cast(FittedModel, asked)

"""Runs with a known change of the machine: their equations hold, and pairs tell what a fit cannot.

The changed machine is the independent bench of ``closed_form`` with the change in its own constants.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.gram.run_sums import sums_of_difference
from fingerlab.diagnosis.signals.conditions import changed_pairs, with_interventions
from fingerlab.report.recording_words import next_experiment_sentence, paired_sentence
from fingerlab.rig.file import Intervention
from fingerlab.sessions.model import Run, Session

from . import closed_form as made

F = made.NOMINAL
LINES: tuple[made.Line, ...] = ((-1, 4.0, ((2.0, 1.0, 0.0),)), (-1, 4.0, ((2.0, 0.5, 1.0),)))
LOAD = 0.02


def with_finger(bench: made.Bench, **more: float) -> made.Bench:
    finger = replace(bench.finger, **{name: getattr(bench.finger, name) + v for name, v in more.items()})
    return replace(bench, finger=finger)


def weighed(bench: made.Bench) -> made.Bench:
    return with_finger(bench, distal_mass=0.01)


def sprung(bench: made.Bench) -> made.Bench:
    return with_finger(bench, mcp_stiffness=0.05, pip_stiffness=-0.02)


def rerouted(bench: made.Bench) -> made.Bench:
    a, b = bench.arms[-1]
    return replace(bench, arms={**bench.arms, -1: (1.3 * a, 0.8 * b)})


def loaded(bench: made.Bench) -> made.Bench:
    return bench


CHANGES = {
    "mass": (weighed, Intervention(added_mass=0.01, added_mass_at=F.distal_half_length)),
    "springs": (sprung, Intervention(mcp_stiffness=0.05, pip_stiffness=-0.02)),
    "arms": (rerouted, Intervention(mcp_arm=1.3, pip_arm=0.8)),
    "load": (loaded, Intervention(load_torque=LOAD)),
}


def changed(bench: made.Bench, name: str, told: bool = True, number: int = 0) -> Session:
    """A session of one motion that the bench has done before, with the change in its constants."""
    make, change = CHANGES[name]
    rng = np.random.default_rng(7)
    run = made.free_run(make(bench), LINES[number], rng, 10.0, 0)
    if name == "load":
        torque = run.channel("motor_torque") + LOAD
        channels = {**{c: run.channel(c) for c in run.units}, "motor_torque": torque}
        run = Run.from_arrays(
            channels, name=run.name, phase=run.phase, cable=run.cable, trajectory=run.trajectory
        )
    attributes = change.attributes() if told else {}
    return Session(Path("changed.h5"), "", "", made.RIG, (replace(run, attributes=attributes),))


@pytest.fixture(scope="module")
def plain() -> Session:
    return unchanged()


@cache
def unchanged() -> Session:
    return made.session(made.Bench(), contact=0)


@cache
def diagnosed(name: str | None) -> Diagnosis:
    """Of the bench with this change in one run that is told, or without any."""
    more = [] if name is None else [changed(made.Bench(), name)]
    return diagnose([unchanged(), *more], with_curves=False)


@pytest.mark.parametrize("name", list(CHANGES))
def test_a_change_that_is_told_is_no_missing_effect(name: str) -> None:
    said = diagnosed(name)
    assert said.verdict == "nothing_missing"
    assert said.score < 1.1
    (pair,) = said.paired
    assert (pair.before, pair.after, pair.score) == ("001", "001", pytest.approx(1.0, abs=0.1))
    assert pair.intervention == CHANGES[name][1].to_json()
    assert said.to_json()["paired"][0]["words"] == pair.words
    assert pair.words in paired_sentence(said)


def test_the_same_mass_untold_is_a_run_of_another_set_up(plain: Session) -> None:
    """Two floors and an effect that is not there, had it been looked for in all runs."""
    said = diagnose([plain, changed(made.Bench(), "mass", told=False)], with_curves=False)
    assert said.verdict == "nothing_missing"
    assert [(one.kind, one.runs) for one in said.bench] == [("odd_run", ("001",))]
    assert said.disagreeing == {("changed.h5", "001")}
    assert not said.paired


def test_the_same_load_untold_is_a_zero_that_moved(plain: Session) -> None:
    """A constant torque in one run alone, for which a joint stop had been named."""
    said = diagnose([plain, changed(made.Bench(), "load", told=False)], with_curves=False)
    assert said.verdict == "nothing_missing"
    assert [(one.kind, one.channel) for one in said.bench] == [("moving_zero", "motor_torque")]
    assert said.score < 1.1
    assert not said.paired


def test_a_changed_machine_that_hides_an_effect_still_shows_it() -> None:
    """Stiffer springs than the rig file says, beside a known mass: the pair is told best with them."""
    bench = with_finger(made.Bench(), mcp_stiffness=0.02, pip_stiffness=0.01)
    said = diagnose([made.session(bench, contact=0), changed(bench, "mass")], with_curves=False)
    assert said.set == ("stiffness_error",)
    (pair,) = said.paired
    assert pair.with_effect["stiffness_error"] == pytest.approx(1.0, abs=0.15)


def test_a_proposed_change_is_said_with_its_chance() -> None:
    proposal = {
        "trajectory": {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0},
        "phase": "on_air", "cable": "extension", "intervention": {"load_torque": 0.02},
        "separates": ["gravity_tilt", "nothing_missing"], "expected_separation": 6.4, "chance_alone": 0.83,
    }  # fmt: skip
    said = replace(diagnosed(None), next_experiment=proposal)
    assert next_experiment_sentence(said) == (
        "Record next: sine, 15°, 1 Hz, on air, extension cable, with a known load of 20 mN m on the pulley "
        "beside the cable. It would show tilted base, if there (expected gain in log evidence 6.4; 5 "
        "decides). The chance that the run settles that is 83 %."
    )


def test_what_only_a_left_out_run_could_tell_is_no_error() -> None:
    """A changed run's own offset of the cable: its length is missed by no more than its floor."""
    said = diagnosed("mass")
    length = said.errors["cable_kinematics"]
    assert length.rmse < 1.5 * length.floor
    told = [one.change for one in said.held_out]
    assert told.count("with 10 g fixed to the finger 24 mm beyond the PIP axis") == 1


def test_sessions_without_a_change_are_left_as_they_are(plain: Session) -> None:
    assert with_interventions([plain])[0] is plain
    assert changed_pairs(plain.runs) == []
    said = diagnosed(None)
    assert said.paired == ()
    assert "paired" not in said.to_json()


def test_a_pair_is_of_one_motion_and_the_last_before_the_change(plain: Session) -> None:
    first, second = plain.runs[0], plain.runs[1]
    mass = replace(second, attributes=Intervention(added_mass=0.01).attributes())
    assert changed_pairs([first, second, second, mass]) == [(2, 3)]
    assert changed_pairs([first, mass]) == []


def test_the_sums_of_a_pair_are_those_of_its_difference() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.standard_normal((2, 40, 3))
    pair = sums_of_difference((0, 1), ("extension", "free"), first, second)
    apart = (second - first) - (second - first).mean(axis=0)
    middle = 0.5 * (first + second) - 0.5 * (first + second).mean(axis=0)
    assert pair.difference.products == pytest.approx(apart.T @ apart / 2.0)
    assert pair.across == pytest.approx(apart.T @ middle / np.sqrt(2.0))
    assert pair.mean == pytest.approx(middle.T @ middle)
    assert pair.difference.samples == 40

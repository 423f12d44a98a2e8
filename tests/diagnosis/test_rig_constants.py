"""A rig file that is wrong: constants that the runs put beyond its tolerances are told under "The bench"."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions.model import Session
from tests.diagnosis import closed_form as made


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(made.Bench())


def told(session: Session, **wrong: float) -> tuple[Diagnosis, list[str]]:
    """The verdict, and what it says of the rig file, of which some constants are so many times too large."""
    finger = session.rig.finger
    assert finger is not None
    finger = replace(finger, **{name: times * getattr(finger, name) for name, times in wrong.items()})
    found = diagnose([replace(session, rig=replace(session.rig, finger=finger))], with_curves=False)
    return found, [one.sentence for one in found.bench if one.kind == "rig_constant"]


def test_a_right_rig_file_is_not_spoken_of(session: Session) -> None:
    assert told(session)[1] == []


def test_a_length_that_is_too_long_is_told_though_nothing_is_missing(session: Session) -> None:
    """By a tenth, in a rig file that gives it to 0.2 %: a mass that is a little off takes it up."""
    found, (sentence,) = told(session, distal_half_length=1.1)
    assert found.verdict == "nothing_missing"
    assert sentence.endswith("are not what the rig file says, within its tolerance")
    assert "the distal half length (at least 0.50 % lower)" in sentence
    (said,) = [one.to_json() for one in found.bench if one.kind == "rig_constant"]
    assert said["finding"] == "unit"
    assert said["channel"] == "rig"
    assert said["advice"].startswith("Measure them again")

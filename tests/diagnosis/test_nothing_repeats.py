"""Recordings that do not say, or do not have, a motion that comes again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import pytest

from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.diagnosis_words import verdict_sentence
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Run
from fingerlab.twin.protocols import load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.lab.result_words import set_words

from .test_no_alarm import shortened

Told = Callable[..., Diagnosis]


def without_trajectory(run: Run) -> Run:
    """As a text file of another program has it."""
    return replace(run, trajectory={})


def only_chirps(run: Run) -> Run | None:
    return run if run.trajectory["kind"] == "chirp" else None


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Told:
    """The diagnosis of a simulated session with such an effect, of this seed, and with each run as given.

    ``left_out``: an effect that the catalogue is without. What is asked again is not worked out again.
    """
    return cache(partial(diagnosed, tmp_path_factory.mktemp("benches")))


def diagnosed(
    folder: Path, effect: str | None, seed: int, kept: Callable[[Run], Run | None], left_out: str = ""
) -> Diagnosis:
    path = folder / f"{effect}-{seed}.h5"
    if not path.exists():
        effects: dict[str, dict[str, float]] = {effect: {}} if effect else {}
        write_session(path, load_preset(), "rich", shortened(20.0), effects, seed)
    session = open_session(path)
    runs = tuple(one for run in session.runs if (one := kept(run)) is not None)
    return diagnose(
        [replace(session, runs=runs)],
        with_curves=False,
        options=DiagnosisOptions(left_out=[left_out] if left_out else ()),
    )


@pytest.mark.parametrize("seed", [101])
@pytest.mark.parametrize("kept", [without_trajectory, only_chirps])
def test_nothing_missing_is_said_so(told: Told, kept: Callable[[Run], Run | None], seed: int) -> None:
    answer = told(None, seed, kept)
    assert answer.verdict == "nothing_missing"
    assert answer.score < 1.15


@pytest.mark.parametrize(
    ("kept", "effect"), [(without_trajectory, "coulomb_friction"), (only_chirps, "cable_stretch")]
)
def test_what_is_missing_is_found(told: Told, kept: Callable[[Run], Run | None], effect: str) -> None:
    answer = told(effect, 105, kept)
    assert answer.verdict == "missing_effect"
    assert answer.candidates[0].effect == effect
    # Squared above one, a score is what a law misses: of that the effect explains most.
    assert answer.score**2 - 1 > 4.0 * (answer.candidates[0].score ** 2 - 1)


def test_without_repetition_the_floor_is_bounded_by_what_the_last_model_leaves(told: Told) -> None:
    """The right model leaves no more than a law of the state; the answer says what its floor stands on."""
    answer = told("coulomb_friction", 104, only_chirps)
    assert not answer.repeats
    assert answer.to_json()["floor_from_repetition"] is False
    assert 0.99 < answer.path[-1].score < 1.15
    assert "No motion in these runs comes again" in verdict_sentence(answer)
    assert set_words(answer).endswith("No motion repeats: the floor is a bound.")
    joint = answer.errors["joint_torque"]
    assert joint.floor > 0
    assert joint.rmse / joint.floor > 2.0  # the floor is the last model's, the error the first one's


def test_without_repetition_a_cause_outside_the_catalogue_is_called_so(told: Told) -> None:
    """What the model leaves could be noise; a law of the state tells it on runs that it has not seen."""
    answer = told("torque_ripple", 104, only_chirps, "torque_ripple")
    assert not answer.repeats
    assert answer.verdict == "not_in_catalogue"
    assert answer.path[-1].score > 1.3
    assert answer.probability_unknown > 0.5


def test_where_a_cycle_is_found_the_floor_is_the_bench_s_own(told: Told) -> None:
    answer = told(None, 101, without_trajectory)
    assert answer.repeats
    assert "the bench's own repeatability" in verdict_sentence(answer)

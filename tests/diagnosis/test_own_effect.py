"""The documentation's own effect, planted in recordings of closed form: found first, explained and drawn."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.effects import CATALOGUE, own, whole_catalogue
from fingerlab.sessions.model import Array, Session

from . import closed_form as made

EXAMPLE = Path(__file__).parents[2] / "docs" / "own_effect_example.py"
FREE = {name for name, e in CATALOGUE.items() if e.phases != ("contact",) and not e.cables}
PLANTED = 3.0e-3  # N m (s/rad)^0.5


def root_friction(speed: Array) -> Array:
    """A motor torque, N m, by the root of its speed, rad/s."""
    return PLANTED * np.sign(speed) * np.sqrt(np.abs(speed))


@pytest.fixture(scope="module")
def planted() -> Session:
    """The five runs with the extension cable, so that all of the misfit has one sign."""
    plain = made.session(made.Bench(), 1, contact=0)
    return replace(plain, runs=tuple(made.with_motor_torque(run, root_friction) for run in plain.runs[:5]))


@pytest.fixture(scope="module")
def answer(planted: Session, tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    folder = tmp_path_factory.mktemp("own")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path_factory.mktemp("settings")))
        shutil.copy(EXAMPLE, folder)
        own.set_folder(folder)
        file = own.trust(own.find(Path(EXAMPLE.name)), CATALOGUE)
        assert file.problem == ""
        return diagnose([planted], with_curves=True)


def test_it_is_found_first_with_its_strength(answer: Diagnosis) -> None:
    assert answer.verdict == "missing_effect"
    best = answer.candidates[0]
    assert best.effect == "motor_root_friction"
    assert "motor_root_friction" in answer.set
    assert answer.final_model[0] == "motor_root_friction"
    found = best.parameters["root"]
    assert found.unit == "N m (s/rad)^0.5"
    assert found.value == pytest.approx(PLANTED, rel=0.1)
    assert best.score < 1.2 < 2.0 < answer.score
    assert "square root of motor speed" in best.explanation
    assert "friction coefficient" in best.explanation


def test_the_whole_catalogue_was_ranked_beside_it(answer: Diagnosis) -> None:
    assert {c.effect for c in answer.candidates} == {*FREE, "motor_root_friction"}


def test_its_fingerprint_is_the_planted_curve(answer: Diagnosis) -> None:
    """Residual torque of the PIP equation over motor speed: the arm times the tension that is lost."""
    drawn = answer.candidates[0].fingerprint
    assert drawn is not None
    assert (drawn.coordinate, drawn.coordinate_unit, drawn.equation) == ("motor speed", "rad/s", "pip_torque")
    law = np.sign(drawn.centre) * np.sqrt(np.abs(drawn.centre))
    expected = -made.Bench().arms[-1][1] * PLANTED / made.RADIUS * law
    for curve in (drawn.mean, drawn.curve):
        assert np.corrcoef(expected, curve)[0, 1] > 0.97
        # The model without the effect hides a part of it in losses and a trace of viscous friction.
        assert 0.5 < np.ptp(curve) / np.ptp(expected) < 1.05


def test_without_confirmation_it_is_no_candidate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    folder = tmp_path / "own"
    folder.mkdir()
    shutil.copy(EXAMPLE, folder)
    own.set_folder(folder)
    assert set(whole_catalogue()) == set(CATALOGUE)
    own.trust(own.find(Path(EXAMPLE.name)), CATALOGUE)
    assert set(whole_catalogue()) == {*CATALOGUE, "motor_root_friction"}

"""A law that holds another one and more is looked at from where that one fits, too."""

from __future__ import annotations

from pathlib import Path

from fingerlab.diagnosis import diagnose
from tests.hidden.sweep.surroundings import open_varied, population, record_varied


def test_stribeck_friction_is_found_where_coulomb_friction_goes_by_the_speed(tmp_path: Path) -> None:
    """On its own grid, by the travel, it left 1.4 floors; Coulomb friction by the speed 1.15, and was told.

    Beside it the bench, a small one at 365 samples a second, leans by five degrees.
    """
    (trial,) = population(9490, 1)
    assert trial.effects == ("gravity_tilt", "stribeck_friction")
    path = tmp_path / "session.h5"
    record_varied(trial, path)
    said = diagnose([open_varied(trial, path)], with_curves=False)
    assert said.candidates[0].effect == "stribeck_friction"
    assert [step.added for step in said.path] == [None, "stribeck_friction"]
    assert said.path[-1].score < 1.1

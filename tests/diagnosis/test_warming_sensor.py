"""A sensor that warms up with a time constant between the points of the grid."""

from __future__ import annotations

from pathlib import Path

import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.sessions import open_session
from fingerlab.twin.protocols import load_preset
from fingerlab.twin.session import write_session

from .test_no_alarm import shortened


def test_the_time_constant_is_found_between_the_points_of_the_grid(tmp_path: Path) -> None:
    """The simulated sensor warms up with half the length of a run: 7 s, where the grid has 5 and 10."""
    path = tmp_path / "warm.h5"
    write_session(path, load_preset(), "rich", shortened(14.0), {"sensor_drift": {"angle": 0.05}}, 103)
    answer = diagnose([open_session(path)], with_curves=False)
    assert answer.final_model == ("sensor_drift",)
    assert answer.path[-1].score < 1.2
    found = next(c for c in answer.candidates if c.effect == "sensor_drift")
    assert found.parameters["time_constant"].value == pytest.approx(7.0, rel=0.1)

"""A model that is saved of a bench whose zeros move from run to run is the model of the verdict."""

from __future__ import annotations

from pathlib import Path

import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.prediction import fit_extended
from fingerlab.sessions import open_session


def test_the_saved_model_knows_that_zeros_move(shared_data: Path) -> None:
    """Same score and same numbers; fitted as if no zero had moved, it would have bent to those that did."""
    session = open_session(shared_data / "bench-moved-zeros.h5")
    said = diagnose([session], with_curves=False)
    assert "moving_zero" in {one.kind for one in said.bench}
    saved = fit_extended([session], said.final_model).extended
    assert saved.score == pytest.approx(said.path[-1].score, rel=0.01)
    for joint in ("mcp", "pip"):
        for cable in ("extension", "flexion"):
            key = f"arm_{joint}@{cable}"
            assert saved.values[key] == pytest.approx(said.final_parameters[key].value, rel=0.005)

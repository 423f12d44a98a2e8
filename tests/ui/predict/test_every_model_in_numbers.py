"""Every model has its numbers: one that switches with the region, on a run that settles first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fingerlab.models.file import ParameterEstimate, SavedModel
from fingerlab.prediction.comparing import RunForce, predict_beside
from fingerlab.sessions import SessionWriter, open_session
from fingerlab.thesis.contact import parameter_sets, predict_session

from .test_predict_tab import ALPHA, K_PIP, L2, LOSS, MCP, PEAK, PIP, RADIUS, RATE, REST, RIG, B

LATE_S = 0.04
SWING = 0.06


@pytest.fixture
def settling(tmp_path: Path) -> Path:
    """A finger that presses and swings, with the tension that its force takes ``LATE_S`` before.

    The motor drifts for the first seconds, as on a bench, so that its whole run is no repetition.
    """
    time = np.arange(20_000) / RATE
    later = 2 * np.pi * (time - LATE_S)
    force = (PEAK + REST) / 2 + (PEAK - REST) / 2 * np.sin(later)
    pip = PIP + SWING * np.sin(2 * np.pi * time)
    # As the equation has it: spring and lever of the tension's own time, and the force of that time.
    early = (PEAK + REST) / 2 + (PEAK - REST) / 2 * np.sin(2 * np.pi * time)
    tension = (K_PIP * pip - LOSS + 2 * L2 * np.cos(MCP + pip - ALPHA) * early) / B
    channels = {
        "motor_command": 0.01 * tension,
        "motor_position": 0.01 * tension + 0.3 * np.exp(-time / 2.0),
        "motor_torque": tension * RADIUS,
        "motor_current": tension * RADIUS / (0.0302 * 4.3),
        "mcp_angle": np.full(len(time), MCP),
        "pip_angle": pip,
        "endpoint_force": force,
    }
    path = tmp_path / "settling.h5"
    with SessionWriter(path, RIG, "settling") as writer:
        writer.add_run("contact", "flexion", RATE, {"kind": "sine", "frequency_hz": 1.0}, channels)
    return path


def parameters_of(*regions: str) -> dict[str, ParameterEstimate]:
    """The true parameters, as a fit by regions has them."""
    parameters = {}
    for region in regions:
        start = f"flexion/pip/{region}/"
        parameters[f"{start}moment_arm"] = ParameterEstimate(B, "m", B, B)
        parameters[f"{start}friction_loss"] = ParameterEstimate(LOSS, "N m", LOSS, LOSS)
    return parameters


def forces(path: Path, *regions: str) -> dict[str, RunForce]:
    """The force by each set that the regions make, of the true parameters, by the set's name."""
    found = predict_beside(open_session(path), {"m": SavedModel("regions", parameters_of(*regions), ())})
    return {name.split(", ")[1]: by_run["001"] for name, by_run in found.forces.items()}


def test_four_regions_and_each_alone_have_all_numbers(settling: Path) -> None:
    found = forces(settling, "flexion", "static_1", "extension", "static_2")
    assert set(found) == {"all regions", "extension", "flexion"}
    for name, force in found.items():
        numbers = force.numbers.prediction
        assert force.numbers.delay_s == pytest.approx(LATE_S, abs=3e-3), name
        assert numbers.peak_modelled == pytest.approx(PEAK, abs=0.01), name
        # A sine that is late by an angle: R2 = 1 - 2 (1 - cos).
        late = 1 - 2 * (1 - np.cos(2 * np.pi * LATE_S))
        assert numbers.r2 == pytest.approx(late, abs=0.01), name
        assert np.isfinite(list(numbers.error_by_phase.values())).all(), name
        assert numbers.error_by_phase["loading"] > 0.05 > -0.05 > numbers.error_by_phase["unloading"], name
        assert len(force.phase), name
    assert not found["all regions"].sweep
    assert found["extension"].sweep


def test_gaps_where_no_region_is_known_leave_the_delay(settling: Path) -> None:
    force = forces(settling, "flexion", "extension")["all regions"]
    gaps = ~np.isfinite(force.modelled)
    assert 0.05 < gaps.mean() < 0.3
    assert force.numbers.delay_s == pytest.approx(LATE_S, abs=6e-3)
    assert np.isfinite(force.numbers.prediction.r2)


def test_the_command_judges_by_the_same_period(settling: Path) -> None:
    """What ``fingerlab predict`` prints of a run that settles first is what the window shows."""
    regions = ("flexion", "static_1", "extension", "static_2")
    shown = forces(settling, *regions)
    model = SavedModel("regions", parameters_of(*regions), ())
    printed = predict_session(open_session(settling), parameter_sets(model, "m"))
    assert printed.runs[0].periods > 0
    assert [step.angle_deg for step in printed.sweep] == [step.angle_deg for step in shown["extension"].sweep]
    for name, prediction in printed.runs[0].predictions.items():
        there = shown[printed.sets[name].name].numbers.prediction
        for number in ("r2", "normalised_r2", "peak_measured", "peak_modelled", "rmse"):
            assert getattr(prediction, number) == pytest.approx(getattr(there, number), rel=1e-9), number
        assert prediction.error_by_phase == pytest.approx(there.error_by_phase), name

"""Contact force against a force that was put in, and against the load cell of foreign recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.models.file import ParameterEstimate
from fingerlab.sessions import open_session
from fingerlab.thesis.contact import parameter_sets, predict_session
from fingerlab.thesis.fitting import fit_session, model_of_fit
from fingerlab.thesis.onair import Parameters
from fingerlab.thesis.prediction import (
    ParameterSet,
    angle_sweep,
    delayed,
    judge,
    predicted_force,
)
from fingerlab.thesis.traces import FitSpec, Traces, trace

from . import invented as made

MCP_ANGLE, PIP_ANGLE = np.radians(20.0), np.radians(25.0)
DISTAL = MCP_ANGLE + PIP_ANGLE - np.radians(15.0)  # 30 degrees
LEVER_PIP = 2 * 0.024 * np.cos(DISTAL)
LEVER_MCP = 2 * 0.0225 * np.cos(np.radians(15.0) - MCP_ANGLE) + LEVER_PIP


def _force(seconds: float = 20.0) -> np.ndarray:
    t = np.arange(round(seconds * made.RATE)) / made.RATE
    return 1.0 + 0.8 * np.sin(2 * np.pi * t)


def _contact(force: np.ndarray | None, shown: np.ndarray | None = None, arm: float = made.B, sign: int = 1):
    """A finger that stands still and presses: tension from the PIP balance for ``force``."""
    f = _force() if force is None else force
    tension = (made.K_PIP * PIP_ANGLE + LEVER_PIP * f - made.L_PIP) / (sign * arm)
    channels = {
        "motor_position": 0.4 + 0.01 * f,
        "motor_torque": tension * made.RADIUS,
        "mcp_angle": np.full(len(f), MCP_ANGLE),
        "pip_angle": np.full(len(f), PIP_ANGLE),
    }
    if shown is not None:
        channels["endpoint_force"] = shown
    return made.run("011", channels, "contact", "flexion" if sign > 0 else "extension")


def _parameters(
    joint, arm: float, loss: float, delay_s: float = 0.0, region: str = "extension"
) -> Parameters:
    def exact(value: float, unit: str) -> ParameterEstimate:
        return ParameterEstimate(value, unit, value, value)

    return Parameters(joint, region, "extension", exact(arm, "m"), exact(loss, "N m"), 1.0, delay_s, 100, ())


def _set(joint="pip", arm: float = made.B, loss: float = made.L_PIP, delay_s: float = 0.0) -> ParameterSet:
    return ParameterSet(
        "extension", joint, "extension", {"extension": _parameters(joint, arm, loss, delay_s)}
    )


def _trace(run) -> Traces:
    return trace(run, made.RIG)


def test_the_force_that_went_in_comes_out() -> None:
    """Arms of an extension cable predict with a flexion cable: only the cable's sign changes."""
    traces = _trace(_contact(None, _force()))
    result = judge(traces, predicted_force(traces, _set()))
    assert result.r2 == pytest.approx(1.0, abs=1e-9)
    assert result.normalised_r2 == pytest.approx(1.0, abs=1e-9)
    # 1 Hz through the 5 Hz double pass loses (1/5)^8 of its amplitude
    assert result.peak_measured == pytest.approx(1.8, abs=1e-4)
    assert result.share == pytest.approx(1.0, abs=1e-6)
    assert result.rmse == pytest.approx(0.0, abs=1e-6)


def test_mcp_equation_gives_the_same_force() -> None:
    """The MCP arm for which both joints balance: a T = LHS1 + lever1 F at every F."""
    run = _contact(None, _force())
    traces = _trace(run)
    arm = made.B * LEVER_MCP / LEVER_PIP
    tension_at_rest = (made.K_PIP * PIP_ANGLE - made.L_PIP) / made.B
    loss = made.K_MCP * MCP_ANGLE - arm * tension_at_rest
    pip = predicted_force(traces, _set())
    mcp = predicted_force(traces, _set("mcp", arm, loss))
    np.testing.assert_allclose(mcp, pip, rtol=1e-9)


def test_a_quarter_of_the_force_is_a_quarter() -> None:
    """Scaled force: share 0.25, normalised R2 still 1, plain R2 from its definition."""
    traces = _trace(_contact(0.25 * _force(), _force()))
    result = judge(traces, predicted_force(traces, _set()))
    assert result.share == pytest.approx(0.25, abs=1e-6)
    assert result.normalised_r2 == pytest.approx(1.0, abs=1e-9)
    # 1 - sum (0.75 y)^2 / sum (y - 1)^2 with y = 1 + 0.8 sin: mean y^2 = 1.32, variance 0.32.
    # Not over whole periods (17.5 s), hence the tolerance.
    assert result.r2 == pytest.approx(1 - 0.5625 * 1.32 / 0.32, abs=0.1)
    assert all(value < 0 for value in result.error_by_phase.values())
    assert result.error_by_phase["peak"] < result.error_by_phase["rest"]


def test_error_by_phase_names_the_right_phase() -> None:
    """A model that is 0.1 N too high while the force falls, and right elsewhere."""
    force = _force()
    falls = np.gradient(force) < -0.2 * np.ptp(np.gradient(force)) / 2
    traces = _trace(_contact(None, force))
    modelled = traces.signals.force + 0.1 * falls
    errors = judge(traces, modelled).error_by_phase
    assert errors["unloading"] == pytest.approx(0.1, abs=2e-3)
    assert errors["loading"] == pytest.approx(0.0, abs=1e-9)
    assert errors["rest"] == pytest.approx(0.0, abs=2e-3)


def test_delay_shifts_the_tension() -> None:
    """Force measured 60 ms after the tension: the delayed tension brings the model back onto it."""
    run = _contact(None, made.late(_force(), 60))
    traces = _trace(run)
    assert judge(traces, predicted_force(traces, _set())).r2 < 0.9
    assert judge(traces, predicted_force(traces, _set(delay_s=0.060))).r2 == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_array_equal(delayed(np.arange(4.0), 1)[1:], [0, 1, 2])
    np.testing.assert_array_equal(delayed(np.arange(4.0), -1)[:3], [1, 2, 3])


def test_leaning_force_grows_as_its_lever_shrinks() -> None:
    """Axial force for a lean phi towards the base: F / (1 - tan(phi) tan(distal)), distal 30 degrees."""
    traces = _trace(_contact(None, _force()))
    sweep = angle_sweep(traces, _set(), (0.0, 15.0, 30.0, 45.0, 60.0))
    for step in sweep[:4]:
        lean = np.radians(step.angle_deg)
        expected = 1.8 / (1 - np.tan(lean) * np.tan(DISTAL))
        assert step.peak == pytest.approx(expected, rel=1e-4)
    beyond = angle_sweep(traces, _set(), (75.0,))[0]  # the force line passes behind the joint
    assert np.isnan(beyond.peak)
    assert np.isnan(beyond.r2)


def test_four_regions_switch_with_the_joints_own_speed() -> None:
    """A still-standing finger whose PIP creeps by a hundredth of a degree: losses tell the regions apart."""
    t = np.arange(20000) / made.RATE
    run = _contact(None, _force())
    base = {name: run.channel(name) for name in ("motor_position", "motor_torque", "mcp_angle")}
    base["pip_angle"] = PIP_ANGLE + np.radians(0.01) * np.sin(2 * np.pi * t)
    traces = _trace(made.run("011", base, "contact", "flexion"))
    losses = {"flexion": 0.001, "static_1": 0.002, "extension": 0.003, "static_2": 0.004}
    switching = ParameterSet(
        "all regions",
        "pip",
        "extension",
        {r: _parameters("pip", made.B, v, region=r) for r, v in losses.items()},
    )
    force = predicted_force(traces, switching)
    zero = predicted_force(traces, _set(loss=0.0))
    loss_seen = (force - zero)[5000:6000] * traces.lever("pip")[5000:6000]
    at = {"flexion": 0, "static_1": 250, "extension": 500, "static_2": 750}  # speed is a cosine
    for region, k in at.items():
        assert loss_seen[k] == pytest.approx(losses[region], rel=1e-3), region
    missing = ParameterSet("all regions", "pip", "extension", dict(list(switching.regions.items())[:3]))
    assert np.isnan(predicted_force(traces, missing)[5750])


def test_no_load_cell_no_verdict_but_a_force() -> None:
    session = made.session(_contact(None))
    result = predict_session(session, {"set": _set()})
    prediction = result.runs[0].predictions["set"]
    assert np.isnan(prediction.r2)
    assert np.isnan(prediction.share)
    assert prediction.peak_modelled == pytest.approx(1.8, abs=1e-3)


def test_a_contact_run_that_does_not_repeat() -> None:
    t = np.arange(20000) / made.RATE
    force = 1.0 + 0.8 * np.sin(2 * np.pi * (0.3 * t + 0.04 * t**2))
    run = _contact(force, force)
    traces = _trace(run)
    assert traces.grid is None
    result = judge(traces, predicted_force(traces, _set()))
    assert result.r2 == pytest.approx(1.0, abs=1e-6)
    assert result.peak_modelled == pytest.approx(1.8, abs=0.01)
    assert len(result.measured) == 0
    assert np.isnan(result.error_by_phase["peak"])


def test_no_contact_run_is_one_sentence() -> None:
    with pytest.raises(UserError, match="no contact run"):
        predict_session(made.session(made.run("001", made.on_air(made.sine_tension()))), {"set": _set()})


def test_foreign_recording_is_predicted_by_its_own_routing(shared_data: Path) -> None:
    """bench-plain: with arms fitted on air with the flexion cable both equations give the load cell's force.

    Nothing is missing there but noise and tolerances (2 % a constant): shape to 0.995, peak to 5 %.
    """
    session = open_session(shared_data / "bench-plain.h5")
    sets = parameter_sets(model_of_fit(session, fit_session(session, FitSpec("flexion-extension"))), "M")
    result = predict_session(session, {n: s for n, s in sets.items() if s.cable == "flexion"})
    for run in result.runs:
        for prediction in run.predictions.values():
            assert prediction.r2 > 0.99
            assert prediction.normalised_r2 > 0.995
            assert prediction.share == pytest.approx(1.0, abs=0.05)

"""J, gain and offset against what was put in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions import open_session
from fingerlab.thesis.fitting import fit_motor_bench

from . import invented as made

BARE = Rig(None, Motor())


def _run(name: str, load: float | None, noise: float = 0.0, amplitude: float = 0.5):
    t = np.arange(12000) / made.RATE
    w = 2 * np.pi * 1.5
    position = amplitude * np.sin(w * t)
    torque = 0.0004 * -amplitude * w**2 * np.sin(w * t) - 0.02 + 1.2 * (load or 0.0)
    random = np.random.default_rng(int(name))
    channels = {
        "motor_position": position,
        "motor_torque": torque + noise * random.normal() + noise * random.normal(size=len(t)),
    }
    if load is not None:
        channels["load_torque"] = np.full(len(t), load)
    return made.run(name, channels, "motor_bench", "none", 1.5)


def test_known_inertia_gain_and_offset_come_back() -> None:
    fit = fit_motor_bench(made.session(_run("1", 0.0), _run("2", 0.1), _run("3", 0.3), rig=BARE))
    values = {name: p.value for name, p in fit.parameters.items()}
    assert values == pytest.approx({"inertia": 4e-4, "gain": 1.2, "offset": -0.02}, rel=2e-3)
    assert fit.r2 > 0.9999
    assert fit.fixed == ()
    assert fit.absent == ()


def test_interval_from_runs_that_differ() -> None:
    runs = [_run(str(i), 0.02 * i, noise=0.004) for i in range(1, 13)]
    fit = fit_motor_bench(made.session(*runs, rig=BARE))
    gain, offset = fit.parameters["gain"], fit.parameters["offset"]
    assert gain.low < 1.2 < gain.high
    assert offset.low < -0.02 < offset.high
    # Run-to-run scatter of 4 mN m over twelve runs: about 4 / sqrt(12) * t(11), not a hundredth of it.
    assert 0.0008 < offset.high - offset.value < 0.010


def test_without_load_there_is_no_gain() -> None:
    fit = fit_motor_bench(made.session(_run("1", None), _run("2", None), rig=BARE))
    assert fit.absent == ("gain",)
    assert set(fit.parameters) == {"inertia", "offset"}
    assert fit.parameters["offset"].value == pytest.approx(-0.02, rel=1e-3)


def test_inertia_of_the_rig_is_not_fitted_again() -> None:
    rig = replace(BARE, motor=Motor(inertia=3e-4), tolerance={"inertia": 0.2})
    fit = fit_motor_bench(made.session(_run("1", 0.0), _run("2", 0.2), rig=rig))
    assert fit.fixed == ("inertia",)
    inertia = fit.parameters["inertia"]
    assert inertia.value == 3e-4
    assert inertia.high == pytest.approx(3e-4 * (1 + 0.2 * 1.6449))


def test_no_run_is_one_sentence() -> None:
    with pytest.raises(UserError, match="no motor-bench run"):
        fit_motor_bench(made.session(made.run("1", made.on_air(made.sine_tension()))))


def test_real_machine_against_plain_least_squares(shared_data: Path) -> None:
    """cable-tool: the same numbers as one least-squares fit of all filtered samples at once."""
    from fingerlab.signals import prepare

    session = open_session(shared_data / "cable-tool.h5")
    columns, torque = [], []
    for run in session.runs:
        signals = prepare(run)
        part = slice(2000, len(signals) - 500)
        load = signals.load_torque
        columns.append(
            np.stack(
                [
                    signals.motor_acceleration[part],
                    np.zeros(len(signals))[part] if load is None else load[part],
                    np.ones(len(signals))[part],
                ],
                axis=1,
            )
        )
        torque.append(signals.motor_torque[part])
    expected, *_ = np.linalg.lstsq(np.concatenate(columns), np.concatenate(torque), rcond=None)
    fit = fit_motor_bench(session)
    ours = [fit.parameters[name].value for name in ("inertia", "gain", "offset")]
    np.testing.assert_allclose(ours, expected, rtol=1e-2)

"""Channels behind a filter, not at zero or at another scale: found, told, taken off; the effect is named."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.signals.reading_errors import FORCE, ReadingError, with_reading_errors
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.prediction import fit_extended, predict_extended
from fingerlab.prediction.extended import ExtendedModel, extended_model, model_of_extended
from fingerlab.sessions import Run, Session, open_session
from fingerlab.sessions.model import Array
from fingerlab.twin.protocols import load_preset
from fingerlab.twin.session import write_session
from tests.hidden.dirt import (
    ANGLES_CUTOFF_HZ,
    CELL_CUTOFF_HZ,
    CELL_MOVES_N,
    CELL_ZERO_N,
    POSITION_LATE_S,
    SCALE,
    WAYS,
)

from . import closed_form as made
from .test_no_alarm import shortened

LAG_S = 1.0 / (2.0 * pi * CELL_CUTOFF_HZ)
"""Of a filter of first order, at frequencies well below its own."""


def recorded(path: Path, effects: dict[str, dict[str, float]], seed: int) -> Session:
    write_session(path, load_preset(), "rich", shortened(14.0), effects, seed)
    return open_session(path)


def lags(found: Diagnosis) -> list[float]:
    return [one.size for one in found.bench if one.channel == "endpoint_force"]


def test_a_bench_that_lacks_nothing_is_told_its_filter_alone(tmp_path: Path) -> None:
    """And again, by what was kept: what one answer took off the reading is no part of the next."""
    session = WAYS["filter"](recorded(tmp_path / "plain.h5", {}, 31))
    kept = Reduction([session])
    found, again = (
        diagnose([session], with_curves=False, options=DiagnosisOptions(kept=kept)) for _ in range(2)
    )
    assert lags(found) == pytest.approx([LAG_S], rel=0.1)
    assert found.verdict == "nothing_missing"
    assert found.score < 1.1
    assert again.reading_errors == found.reading_errors
    assert [(c.effect, c.probability) for c in again.candidates] == [
        (c.effect, c.probability) for c in found.candidates
    ]


def test_a_zero_is_read_in_the_air_or_found_in_contact(tmp_path: Path) -> None:
    """Of 0.3 N; where free runs hold no reading it is seen before the tip is set down."""
    session = WAYS["tare"](recorded(tmp_path / "plain.h5", {}, 34))

    def without(run: Run) -> Run:
        units = {name: unit for name, unit in run.units.items() if name != "endpoint_force"}
        return run if run.phase == "contact" else replace(run, units=units)

    blind = replace(session, runs=tuple(map(without, session.runs)))
    for one, told_by in ((session, "in free motion"), (blind, "while the tip is clear of it")):
        found = diagnose([one], with_curves=False)
        assert found.verdict == "nothing_missing"
        zeros = [b.size for b in found.bench if (b.kind, b.channel) == ("zero", "endpoint_force")]
        assert zeros == pytest.approx([CELL_ZERO_N], rel=0.1)
        assert f"N with nothing on it, {told_by}; that is taken off" in found.bench[0].text


def test_a_zero_that_moves_from_run_to_run_is_the_load_cells(tmp_path: Path) -> None:
    """By 0.1 N; no sensor of an angle, and no torque, is said to move."""
    session = recorded(tmp_path / "plain.h5", {}, 35)
    found = diagnose([WAYS["cell"](session)], with_curves=False)
    assert found.verdict == "nothing_missing"
    assert found.score < 1.15
    moved = {b.channel: b.size for b in found.bench if b.kind == "moving_zero"}
    assert moved.keys() == {"endpoint_force"}
    # Four runs in contact tell a spread within a factor of two.
    assert 0.5 < moved["endpoint_force"] / CELL_MOVES_N < 2.0


def test_the_effect_is_named_beside_it(tmp_path: Path) -> None:
    session = WAYS["filter"](
        recorded(tmp_path / "rubs.h5", {"motor_coulomb_friction": {"torque": 0.006}}, 32)
    )
    found = diagnose([session], with_curves=False)
    assert lags(found) == pytest.approx([LAG_S], rel=0.15)
    assert found.final_model == ("motor_coulomb_friction",)
    assert found.path[-1].score < 1.2
    # A fit that is asked for the same effect takes the same lag off.
    model = fit_extended([session], found.final_model)
    friction = "motor_coulomb_friction.coulomb"
    assert model.parameters[friction].value == pytest.approx(found.final_parameters[friction].value, rel=0.02)


def test_angles_behind_a_filter_are_corrected_in_a_saved_model_too(tmp_path: Path) -> None:
    """Its force is as near to the load cell's as of the same bench without the filter."""
    whole = recorded(tmp_path / "rubs.h5", {"motor_coulomb_friction": {"torque": 0.006}}, 36)
    clean = replace(whole, runs=(*whole.runs[:4], *whole.contact_runs()[:2]))
    session = WAYS["angles"](clean)
    found = diagnose([session], with_curves=False)
    late = [one.size for one in found.bench if one.kind == "skew"]
    assert late == pytest.approx([1.0 / (2.0 * pi * ANGLES_CUTOFF_HZ)], rel=0.05)
    assert found.final_model == ("motor_coulomb_friction",)
    assert found.path[-1].score < 1.2
    model = fit_extended([session], found.final_model)
    kept = extended_model(model_of_extended(model), "the model")
    assert kept.extended.readings == model.extended.readings
    assert missed(session, kept) < 1.1 * missed(clean, fit_extended([clean], found.final_model))


@pytest.mark.parametrize(
    ("way", "channel", "late"),
    [
        ("pip", "pip_angle", 1.0 / (2.0 * pi * ANGLES_CUTOFF_HZ)),
        ("position", "motor_position", POSITION_LATE_S),
    ],
)
def test_one_channel_late_of_all_is_no_law_of_motion(
    tmp_path: Path, way: str, channel: str, late: float
) -> None:
    """A joint's angle alone left two floors and viscous friction, the motor's position eight."""
    session = recorded(tmp_path / "plain.h5", {}, 38)
    short = replace(session, runs=(*session.runs[:3], *session.contact_runs()[:2]))
    found = diagnose([WAYS[way](short)], with_curves=False)
    skews = {one.channel: one.size for one in found.bench if one.kind == "skew"}
    assert skews == {channel: pytest.approx(late, rel=0.1)}
    assert found.verdict == "nothing_missing"
    assert found.score < 1.1


def misread(session: Session, channel: str, scale: float) -> Session:
    """A channel that reads what there is over ``scale``."""

    def one(run: Run) -> Run:
        channels = run.load()
        channels[channel] = channels[channel] / scale
        told = {"name": run.name, "phase": run.phase, "cable": run.cable, "trajectory": dict(run.trajectory)}
        return Run.from_arrays(channels, **told, sample_rate_hz=run.sample_rate_hz)

    return replace(session, runs=tuple(map(one, session.runs)))


@pytest.mark.parametrize(("channel", "scale"), [("pip_angle", 1.05), ("mcp_angle", 0.95)])
def test_an_angle_that_is_read_at_another_scale_is_told_by_it(channel: str, scale: float) -> None:
    """On a bench with equations of its own; as a cable's stretch it was told, or as a nonlinear sensor."""
    found = diagnose([misread(made.session(made.Bench()), channel, scale)], with_curves=False)
    assert found.verdict == "nothing_missing"
    assert found.score < 1.05
    (told,) = found.bench
    assert (told.kind, told.channel) == ("scale", channel)
    assert told.size == pytest.approx(scale, abs=3e-3)


def test_friction_is_named_beside_an_angle_of_another_scale() -> None:
    """Its law leaves much itself: the scale takes off what a further effect would have to, and no less."""
    whole = made.session(made.Bench(missing=made.Missing(motor_coulomb=5e-3)))
    # A search that ends beside the floor is long: fewer runs of each kind.
    session = replace(whole, runs=tuple(whole.runs[k] for k in (0, 1, 3, 5, 7, 8, 10)))
    clean, spoilt = (
        diagnose([misread(session, "mcp_angle", scale)], with_curves=False) for scale in (1.0, 0.95)
    )
    assert clean.bench == ()
    assert [step.added for step in spoilt.path] == [None, "motor_coulomb_friction"]
    assert spoilt.path[-1].score == pytest.approx(clean.path[-1].score, abs=0.02)
    assert [(b.kind, b.channel) for b in spoilt.bench] == [("scale", "mcp_angle")]
    assert spoilt.bench[0].size == pytest.approx(0.95, abs=5e-3)


def missed(session: Session, model: ExtendedModel) -> float:
    """By how much its forces miss the load cell's, rms, N."""
    runs = predict_extended(session, model, "the model").runs["extended"]
    away = np.concatenate([c.modelled - c.measured for run in runs for c in run.curves])
    return float(np.sqrt(np.nanmean(away**2)))


def test_a_current_that_reads_too_little_is_told_by_its_scale(tmp_path: Path) -> None:
    """Not as a load cell's span and a spring, which together would look like it."""
    found = diagnose([WAYS["scale"](recorded(tmp_path / "plain.h5", {}, 37))], with_curves=False)
    assert found.verdict == "nothing_missing"
    assert found.score < 1.1
    scales = [one.size for one in found.bench if one.kind == "scale"]
    assert scales == pytest.approx([1.0 / SCALE], rel=0.06)  # as far as the rig's tolerances tell


def test_errors_of_a_reading_add_up() -> None:
    """Of q = t^3: the second is an error of what is left when the first is taken off."""
    time = np.linspace(-1.0, 1.0, 2001)
    first, second = ReadingError(0.2, 0.1, 0.02, 0.003), ReadingError(-0.1, 0.2, -0.01, 0.001)

    def read(error: ReadingError, value: Array, rate: Array, bend: Array) -> Array:
        return (1.0 + error.gain) * (value - error.zero) + error.lag * rate + error.lag_square * bend

    value, rate, bend, jerk = time**3, 3.0 * time**2, 6.0 * time, 6.0
    once = read(first, value, rate, bend)
    its_rate = (1.0 + first.gain) * rate + first.lag * bend + first.lag_square * jerk
    its_bend = (1.0 + first.gain) * bend + first.lag * jerk
    beyond = second.lag * first.lag_square * jerk + second.lag_square * first.lag * jerk  # of third order
    both = read(first.then(second), value, rate, bend)
    assert both + beyond == pytest.approx(read(second, once, its_rate, its_bend), abs=1e-12)


def test_a_corrected_reading_is_what_went_into_the_filter(tmp_path: Path) -> None:
    """Of a filter of first order the input is its output and the time constant times its slope."""
    clean = recorded(tmp_path / "plain.h5", {}, 33)
    corrected = with_reading_errors([WAYS["filter"](clean)], {FORCE: ReadingError(lag=LAG_S)})[0]
    for was, now in zip(clean.contact_runs(), corrected.contact_runs(), strict=True):
        before, after = (next(segments_of(run, clean.rig)).force for run in (was, now))
        assert before is not None
        assert after is not None
        moved = float(np.std(before))
        assert float(np.std(after - before)) < 0.03 * moved

"""Forces of any number of models, of both kinds, on the contact runs of one session, beside the load cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.diagnosis.settings import NARROW_RATE_HZ
from fingerlab.models.file import DIAGNOSIS_METHOD, Model
from fingerlab.prediction.extended import ExtendedModel, extended_model
from fingerlab.prediction.judging import ForceNumbers, fine_grid, judge_stretches
from fingerlab.prediction.predict import RunPrediction, predict_extended, swept
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Array, Session
from fingerlab.signals.periods import REGION_TITLES, PeriodGrid, normalise, usable
from fingerlab.thesis.contact import contact_runs, parameter_sets
from fingerlab.thesis.onair import thin
from fingerlab.thesis.prediction import (
    AngleStep,
    ParameterSet,
    angle_sweep,
    judge,
    predicted_force,
)
from fingerlab.thesis.traces import JOINT_TITLES, Traces, settled, trace

LEAST_KNOWN = 0.5
"""Share of a force that must be known for its delay to mean something (assumed)."""


@dataclass(frozen=True)
class RunForce:
    """One contact run by one predictor.

    Attributes:
        time: s into the run, (n,). measured, modelled, half_width: N, (n,); ``half_width`` is half the 90 %
            interval, NaN without one. About 25 samples a second, of signals low-passed at 5 Hz.
        phase: share of the period from the least measured force, 0 to 1, (k,). measured_period,
            modelled_period: average period, each scaled to 0..1, (k,); empty for a run that does not repeat.
            Periods are cut where the force is least, so that a force that drifts has no step inside.
        held_out: whether the run was left out of the fit that predicts it; None where the model cannot tell.
        sweep: contact angles, on a run that repeats; empty for parameters that switch with the region.
    """

    time: Array
    measured: Array
    modelled: Array
    half_width: Array
    numbers: ForceNumbers
    phase: Array
    measured_period: Array
    modelled_period: Array
    held_out: bool | None = None
    sweep: tuple[AngleStep, ...] = ()


@dataclass(frozen=True)
class Beside:
    """Predictors (``FILE: what``) in the order of the files, each with its runs by name.

    ``preferred`` are those to look at first: of a fit the PIP equation with extension's parameters, as the
    thesis ended with, of the contact runs' own cable where it was fitted; all of a model with effects.
    """

    session: Path
    runs: tuple[str, ...]
    preferred: tuple[str, ...]
    forces: Mapping[str, Mapping[str, RunForce]]


@dataclass(frozen=True)
class _Given:
    """What the files hold: parameter sets of the thesis' fits by predictor, extended models by file."""

    sets: Mapping[str, ParameterSet]
    extended: Mapping[str, ExtendedModel]


def predict_beside(session: Session, models: Mapping[str, Model], progress: Progress | None = None) -> Beside:
    """Predict every contact run with every model.

    Args:
        models: content of model files by name, as shown.

    Raises:
        UserError: no contact run, or a model that cannot predict these runs.
    """
    runs = contact_runs(session)
    if not runs:
        raise UserError(
            f"{session.path} has no contact run with a cable; the endpoint force is predicted for runs of "
            "phase 'contact'."
        )
    given = _read(models)
    tell = progress or (lambda share, what: None)
    forces: dict[str, dict[str, RunForce]] = {name: {} for name in given.sets}
    for number, run in enumerate(runs if given.sets else ()):
        tell(0.7 * number / len(runs), f"run {run.name}")
        traces = settled(trace(run, session.rig))
        for name, one in given.sets.items():
            forces[name][run.name] = _by_set(traces, one)
    for number, (file, model) in enumerate(given.extended.items()):
        tell(0.7 + 0.3 * number / len(given.extended), f"predicting with {file}")
        for name, predictions in predict_extended(session, model, file).runs.items():
            words = model.words if name == "extended" else "nominal model"
            sweeps = swept(model.variants[name], session, content_hash(session), file)
            forces[f"{file}: {words}"] = {p.run: _by_variant(p, sweeps.get(p.run, ())) for p in predictions}
    names = dict.fromkeys(name for by_run in forces.values() for name in by_run)
    preferred = [name for name in forces if name not in given.sets]
    for file in models:
        ours = {n: s for n, s in given.sets.items() if n.startswith(f"{file}: ")}
        preferred += _preferred(ours, runs[0].cable)
    return Beside(session.path, tuple(names), tuple(preferred), forces)


def _preferred(sets: Mapping[str, ParameterSet], cable: str) -> list[str]:
    def rank(name: str) -> tuple[bool, bool, bool]:
        one = sets[name]
        return one.joint != "pip", one.name not in ("extension", "whole"), one.cable != cable

    return sorted(sets, key=rank)[:1]


def _read(models: Mapping[str, Model]) -> _Given:
    sets: dict[str, ParameterSet] = {}
    extended: dict[str, ExtendedModel] = {}
    for file, model in models.items():
        if model.method == DIAGNOSIS_METHOD:
            extended[file] = extended_model(model, file)
            continue
        for one in parameter_sets(model, file).values():
            region = REGION_TITLES.get(one.name, one.name)
            sets[f"{file}: {JOINT_TITLES[one.joint]}, {region}, {one.cable} cable"] = one
    return _Given(sets, extended)


def _bridged(force: Array) -> Array:
    """A force with straight lines over its gaps, where parameters that switch know no region, N, (n,).

    As it is where most of it is unknown.
    """
    known = np.isfinite(force)
    if known.all() or known.mean() < LEAST_KNOWN:
        return force
    at = np.arange(len(force))
    return np.asarray(np.interp(at, at[known], force[known]))


def _by_set(traces: Traces, given: ParameterSet) -> RunForce:
    force = predicted_force(traces, given)
    measured = traces.signals.force
    if measured is None:
        measured = np.full(len(force), np.nan)
    rate = traces.signals.sample_rate_hz
    stride = max(round(rate / NARROW_RATE_HZ), 1)
    part = slice(*usable(len(force), rate), stride)
    grid = traces.grid
    frequency = traces.frequency_hz if grid is not None else 0.0
    delay = judge_stretches([measured[part]], [_bridged(force[part])], rate / stride, frequency).delay_s
    numbers = ForceNumbers(judge(traces, force), delay)
    return _shown(
        (traces.signals.time[part], measured[part], force[part], np.full(len(force[part]), np.nan)),
        numbers,
        _period((measured, force), grid),
        None,
        angle_sweep(traces, given) if grid is not None and not given.switches else (),
    )


def _by_variant(run: RunPrediction, sweep: tuple[AngleStep, ...]) -> RunForce:
    parts = [(c.time, c.measured, c.modelled, c.half_width) for c in run.curves]
    time, measured, modelled, half = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    numbers = run.numbers["both"]
    longest = max(run.curves, key=lambda c: len(c.time))
    seconds = numbers.prediction.period_s
    frequency = 1.0 / seconds if seconds > 0 else 0.0
    pair, grid = fine_grid(longest.measured, longest.modelled, frequency, longest.rate_hz)
    return _shown((time, measured, modelled, half), numbers, _period(pair, grid), run.held_out, sweep)


def _shown(
    curves: tuple[Array, Array, Array, Array],
    numbers: ForceNumbers,
    period: tuple[Array, Array],
    held_out: bool | None,
    sweep: tuple[AngleStep, ...],
) -> RunForce:
    time, measured, modelled, half_width = (values.copy() for values in curves)
    count = len(period[0])
    return RunForce(
        time,
        measured,
        modelled,
        half_width,
        numbers,
        np.arange(count) / max(count, 1),
        _unit(period[0]),
        _unit(period[1]),
        held_out,
        sweep,
    )


def _period(pair: tuple[Array, Array], grid: PeriodGrid | None) -> tuple[Array, Array]:
    """Average period of both forces, N, (k,) each, cut at the least measured force; empty without periods.

    A second cut, a part of a period later than the first: what differs between the ends of a run then stands
    at the ends of the picture, too.
    """
    if grid is None or grid.count < 2:
        return np.empty(0), np.empty(0)
    known = pair[0] if np.isfinite(pair[0]).any() else pair[1]
    mean = grid.mean(known)
    if not np.isfinite(mean).any():
        return np.empty(0), np.empty(0)
    later = float(np.nanargmin(mean)) / len(mean) * grid.period
    cut = PeriodGrid(grid.start + later, grid.period, grid.count - 1)
    measured, modelled = (cut.mean(values) for values in pair)
    return thin(measured), thin(modelled)


def _unit(values: Array) -> Array:
    if not len(values) or not np.isfinite(values).all() or np.ptp(values) == 0:
        return np.full(len(values), np.nan)
    return normalise(values)

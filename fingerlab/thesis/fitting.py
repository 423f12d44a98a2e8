"""Moment arms and friction losses by one of the thesis' methods, and the motor bench; both as model files."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import ParameterEstimate
from fingerlab.models.file import SavedModel, hash_sessions
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.sessions.trajectory import named_frequency
from fingerlab.signals.periods import usable
from fingerlab.signals.prepare import prepare
from fingerlab.thesis.onair import CableFit, OnAirRun, Spread, pool, reduce_run
from fingerlab.thesis.traces import FitSpec, quantile, trace

LARGEST_PIECE = 300_000
"""Samples of one piece at most: five minutes at 1 kHz, ten times a run of the thesis."""


def in_pieces(runs: Iterable[Run]) -> tuple[Run, ...]:
    """The same runs, those longer than ``LARGEST_PIECE`` cut into about equal pieces.

    A piece starts with a period of its trajectory and is named ``001:2``; it is filtered, settled and
    judged like a run of its own. No sample is read here.
    """
    return tuple(piece for run in runs for piece in _pieces(run))


def _pieces(run: Run) -> tuple[Run, ...]:
    count = math.ceil(run.length / LARGEST_PIECE)
    if count <= 1:
        return (run,)
    frequency = named_frequency(run)
    period = run.sample_rate_hz / frequency if frequency > 0 else 1.0
    cuts = [round(round(k * run.length / count / period) * period) for k in range(count)]
    cuts = [*dict.fromkeys(cuts), run.length]
    return tuple(
        replace(run, name=f"{run.name}:{number}", length=stop - start, reader=_OffsetReader(run, start))
        for number, (start, stop) in enumerate(itertools.pairwise(cuts), start=1)
    )


@dataclass(frozen=True)
class _OffsetReader:
    """Samples of a run counted from one of its samples on. Picklable where the run's reader is."""

    run: Run
    offset: int

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Samples of several channels at once."""
        return self.run.load(names, self.offset + start, self.offset + stop)


@dataclass(frozen=True)
class SessionFit:
    """Fitted parameters of a session, for each cable with which it was moved on air.

    Attributes:
        cables: result of each joint and region, by cable. used: runs that took part, by cable.
        skipped: runs on air that did not, each with the reason in words.
        runs: what was kept of each run, in the order taken.
    """

    session: Path
    spec: FitSpec
    cables: Mapping[str, CableFit]
    used: Mapping[str, tuple[str, ...]]
    skipped: tuple[tuple[str, str], ...]
    runs: tuple[OnAirRun, ...]


def on_air_runs(session: Session) -> tuple[Run, ...]:
    """Runs on air with a cable, in the order taken, long ones in pieces.

    Raises:
        UserError: the session has none.
    """
    runs = in_pieces(
        run for run in session.runs if run.phase == "on_air" and run.cable_sign != 0 and not run.changed
    )
    if not runs:
        raise UserError(
            f"{session.path} has no run on air with a cable; moment arms and losses are fitted to runs of "
            "phase 'on_air' with an extension or flexion cable."
        )
    return runs


def fit_session(session: Session, spec: FitSpec, progress: Progress | None = None) -> SessionFit:
    """Fit the on-air runs of a session, run by run.

    Runs that do not repeat a trajectory serve the method ``whole`` only; the result says which were left.

    Raises:
        UserError: no run on air, none that repeats where the method needs it, or a method and a delay
            that do not go together.
    """
    if spec.method == "whole" and spec.delay == "findsignal":
        raise UserError(
            "The delay 'findsignal' belongs to a region and the method 'whole' has none; "
            "choose '--method regions' or 'flexion-extension', or '--delay xcorr'."
        )
    reduced = reduce_runs(session, on_air_runs(session), [spec], progress)
    return assemble(session, spec, reduced)


def reduce_runs(
    session: Session, runs: Sequence[Run], specs: Sequence[FitSpec], progress: Progress | None
) -> tuple[OnAirRun, ...]:
    """Each run reduced on its own, so that memory does not grow with the data."""
    reduced = []
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number / len(runs), f"run {run.name}")
        reduced.append(reduce_run(trace(run, session.rig), specs))
    return tuple(reduced)


def assemble(session: Session, spec: FitSpec, reduced: Sequence[OnAirRun], strict: bool = True) -> SessionFit:
    """Pool reduced runs cable by cable.

    Args:
        strict: whether a fit for which no run could be used is an error; else it comes back empty.

    Raises:
        UserError: no run could be used.
    """
    skipped = tuple((run.name, _why_not(run)) for run in reduced if not _usable(run, spec))
    used: dict[str, list[OnAirRun]] = {}
    for run in reduced:
        if _usable(run, spec):
            used.setdefault(run.cable, []).append(run)
    if strict and not used:
        raise UserError(
            f"No on-air run in {session.path} can be used for '{spec.method}' with delay '{spec.delay}' "
            f"(run {skipped[0][0]} {skipped[0][1]}); record a sine of several periods, or choose "
            "'--method whole --delay none'."
        )
    return SessionFit(
        session.path,
        spec,
        {cable: pool(runs, spec) for cable, runs in used.items()},
        {cable: tuple(run.name for run in runs) for cable, runs in used.items()},
        skipped,
        tuple(reduced),
    )


def _usable(run: OnAirRun, spec: FitSpec) -> bool:
    return spec in run.fits and any(fit.line is not None for fit in run.fits[spec].values())


def _why_not(run: OnAirRun) -> str:
    if run.periods == 0:
        return "does not repeat a trajectory over two whole periods"
    return "shows no region in which tension varies"


def model_of_fit(session: Session, fit: SessionFit) -> SavedModel:
    """The model file's content; parameters are named ``cable/joint/region/moment_arm`` and so on."""
    parameters: dict[str, ParameterEstimate] = {}
    r2: dict[str, float] = {}
    for cable, results in fit.cables.items():
        for (joint, region), result in results.items():
            if result.pooled is None:
                continue
            key = f"{cable}/{joint}/{region}"
            parameters[f"{key}/moment_arm"] = result.pooled.moment_arm
            parameters[f"{key}/friction_loss"] = result.pooled.loss
            if fit.spec.delay != "none":
                parameters[f"{key}/delay"] = delay_estimate(result.pooled.delay_s, result.delays_s)
            r2[key] = result.pooled.r2
    details: dict[str, Any] = {
        "delay": fit.spec.delay,
        "threshold_percent": fit.spec.threshold,
        "runs": {cable: list(names) for cable, names in fit.used.items()},
        "skipped": [{"run": name, "because": reason} for name, reason in fit.skipped],
        "r2": r2,
    }
    return SavedModel(fit.spec.method, parameters, hash_sessions([session]), details=details)


def delay_estimate(mean: float, delays: Spread) -> ParameterEstimate:
    """Mean delay over runs, s, with the 90 % interval of the mean; NaN bounds for a single run."""
    good = [value for value in delays.values if np.isfinite(value)]
    half = float("nan")
    if len(good) > 1:
        half = quantile(len(good) - 1) * delays.deviation / float(np.sqrt(len(good)))
    return ParameterEstimate(mean, "s", mean - half, mean + half)


METHOD = "motor_bench"
"""``method`` of a model file that :func:`model_of_motor_bench` made."""
UNITS = {"inertia": "kg m^2", "gain": "1", "offset": "N m"}


@dataclass(frozen=True)
class MotorBenchFit:
    """``motor_torque = J * acceleration + gain * load_torque + offset`` over all motor-bench runs.

    Attributes:
        parameters: ``inertia``, ``gain``, ``offset`` with 90 % intervals; ``fixed`` names those that the
            rig gave and that were not fitted, ``absent`` those that the recordings cannot show.
        r2: share of the torque's variance over all runs. rmse: N m. run_r2: by run.
    """

    session: Path
    parameters: Mapping[str, ParameterEstimate]
    fixed: tuple[str, ...]
    absent: tuple[str, ...]
    r2: float
    rmse: float
    run_r2: Mapping[str, float]


@dataclass(frozen=True)
class _RunSums:
    """Normal equations of one run: columns (acceleration, load, 1) against torque."""

    name: str
    gram: Array  # (3, 3)
    right: Array  # (3,)
    square: float
    mean: float
    count: int


def motor_bench_runs(session: Session) -> tuple[Run, ...]:
    """The session's motor-bench runs, in the order taken, long ones in pieces."""
    return in_pieces(run for run in session.runs if run.phase == "motor_bench")


def fit_motor_bench(session: Session, progress: Progress | None = None) -> MotorBenchFit:
    """Fit the motor-bench equation run by run (sums only).

    Interval (90 %): sandwich estimator with runs as blocks, Student's t; NaN for a single run.

    Raises:
        UserError: there is no motor-bench run, or none is long enough.
    """
    runs = motor_bench_runs(session)
    sums = []
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number / len(runs), f"run {run.name}")
        part = _sums(run)
        if part is not None:
            sums.append(part)
    if not sums:
        raise UserError(
            f"{session.path} has no motor-bench run of at least three seconds; the "
            "motor-bench equation needs one, for its start and the edges of the filter are left out."
        )
    return _solve(session, sums)


def _sums(run: Run) -> _RunSums | None:
    signals = prepare(run)
    start, stop = usable(len(signals), signals.sample_rate_hz)
    if stop - start < signals.sample_rate_hz / 2:
        return None
    torque = signals.motor_torque[start:stop]
    load = np.zeros_like(torque) if signals.load_torque is None else signals.load_torque[start:stop]
    columns = np.stack([signals.motor_acceleration[start:stop], load, np.ones_like(torque)])
    return _RunSums(
        run.name,
        columns @ columns.T,
        columns @ torque,
        float(torque @ torque),
        float(torque.mean()),
        len(torque),
    )


def _solve(session: Session, sums: Sequence[_RunSums]) -> MotorBenchFit:
    gram = np.sum([s.gram for s in sums], axis=0)
    right = np.sum([s.right for s in sums], axis=0)
    names = ("inertia", "gain", "offset")
    fixed = {} if session.rig.motor.inertia is None else {0: session.rig.motor.inertia}
    count = gram[2, 2]
    varies = [gram[i, i] - gram[i, 2] ** 2 / count > 1e-12 * gram[i, i] for i in range(2)]
    absent = [i for i in range(2) if not varies[i] and i not in fixed]
    free = [i for i in range(3) if i not in fixed and i not in absent]
    values = np.zeros(3)
    for i, value in fixed.items():
        values[i] = value
    inverse = np.linalg.pinv(gram[np.ix_(free, free)], hermitian=True)
    values[free] = inverse @ (right - gram @ values)[free]
    scores = np.array([(s.right - s.gram @ values)[free] for s in sums])
    blocks = len(sums)
    half = np.full(3, np.nan)
    if blocks > 1:
        covariance = blocks / (blocks - 1) * inverse @ (scores.T @ scores) @ inverse
        half[free] = quantile(blocks - 1) * np.sqrt(np.diag(covariance))
    for i in fixed:
        half[i] = values[i] * session.rig.tolerance_of("inertia") * 1.6449  # 90 % of a normal spread
    residual = {s.name: s.square - 2 * values @ s.right + values @ s.gram @ values for s in sums}
    spread = {s.name: s.square - s.count * s.mean**2 for s in sums}
    total = sum(s.square for s in sums) - right[2] ** 2 / count
    error = sum(residual.values())
    return MotorBenchFit(
        session.path,
        {
            names[i]: ParameterEstimate(
                float(values[i]), UNITS[names[i]], float(values[i] - half[i]), float(values[i] + half[i])
            )
            for i in range(3)
            if i not in absent
        },
        tuple(names[i] for i in fixed),
        tuple(names[i] for i in absent),
        float(1 - error / total) if total > 0 else float("nan"),
        float(np.sqrt(max(error, 0.0) / count)),
        {n: float(1 - residual[n] / spread[n]) if spread[n] > 0 else float("nan") for n in residual},
    )


def model_of_motor_bench(session: Session, fit: MotorBenchFit) -> SavedModel:
    """The model file's content of a motor-bench fit."""
    details = {
        "fixed_by_rig": list(fit.fixed),
        "not_shown_by_data": list(fit.absent),
        "r2": fit.r2,
        "rmse": fit.rmse,
        "run_r2": dict(fit.run_r2),
    }
    return SavedModel(METHOD, fit.parameters, hash_sessions([session]), details=details)

"""The motor alone, or with a known load: J, gain and offset of the motor-bench equation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import ParameterEstimate
from fingerlab.models.file import Model, hash_sessions
from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.signals.periods import usable
from fingerlab.signals.prepare import prepare
from fingerlab.thesis.fitting import in_pieces
from fingerlab.thesis.regression import quantile

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
        part = _sums(run, session.rig)
        if part is not None:
            sums.append(part)
    if not sums:
        raise UserError(
            f"{session.path} has no motor-bench run of at least three seconds; "
            "the motor-bench equation needs one."
        )
    return _solve(session, sums)


def _sums(run: Run, rig: Rig) -> _RunSums | None:
    signals = prepare(run, rig)
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


def model_of_motor_bench(session: Session, fit: MotorBenchFit) -> Model:
    """The model file's content of a motor-bench fit."""
    details = {
        "fixed_by_rig": list(fit.fixed),
        "not_shown_by_data": list(fit.absent),
        "r2": fit.r2,
        "rmse": fit.rmse,
        "run_r2": dict(fit.run_r2),
    }
    return Model(METHOD, fit.parameters, hash_sessions([session]), details=details)

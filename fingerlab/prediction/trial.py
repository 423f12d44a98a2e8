"""By how much a found model lowers the error of a force that was wanted, beside the nominal model.

Runs come in pairs, one of each model. The interval is that of the pairs drawn anew with replacement (paired
bootstrap, Efron and Tibshirani 1993): what drifts over a session is in both runs of a pair.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.text import LEVEL
from fingerlab.diagnosis.settings import WIDE_RATE_HZ
from fingerlab.prediction.feed_forward import FOUND, NOMINAL, smooth, thinned
from fingerlab.prediction.target import WantedForce
from fingerlab.sessions.model import Array, Run, Session

FORCE_TRIAL, FORCE_MODEL, WANTED_FORCE = "force_trial", "force_model", "wanted_force"
"""Attributes: of the session, what was asked for; of a run, which model sent it and what was wanted."""
FOUND_SHARE = "found_share"
"""Attribute of a run: how far from the nominal torque to the found one its torque goes, 0 to 1."""
POSE, PRACTICE = "pose", "practice"
"""Runs that only learn."""
EDGE_S = 0.1
"""Of the wanted force at its beginning and end, left out: the torque's ramp and the low-pass (assumed)."""
DRAWS = 4000


@dataclass(frozen=True)
class ForceError:
    """One run: measured less wanted force, low-passed at 8 Hz without delay.

    Attributes:
        time: s of the wanted force, (n,). wanted, measured: N, (n,).
    """

    time: Array
    wanted: Array
    measured: Array

    @property
    def error(self) -> Array:
        """N, (n,)."""
        return self.measured - self.wanted

    @property
    def rms(self) -> float:
        """N."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def peak(self) -> float:
        """Largest error either way, N."""
        return float(np.abs(self.error).max())


def force_error(run: Run, wanted: WantedForce, lead_s: float | None = None) -> ForceError:
    """The error of a run whose wanted force begins ``lead_s`` after it (its trajectory says when).

    Raises:
        UserError: no load cell was read.
    """
    lead = float(run.trajectory.get("lead_s", 0.0)) if lead_s is None else lead_s
    read = run.load(["time", "endpoint_force"])
    time, force = read["time"] - lead, read["endpoint_force"]
    if not np.isfinite(force).all():
        raise UserError(f"Run {run.name} has no load cell's reading throughout; a force error needs it.")
    grid = np.arange(time[0], time[-1], 1.0 / WIDE_RATE_HZ)
    smoothed = thinned(time, force, grid, run.sample_rate_hz)
    asked = smooth(np.interp(grid, wanted.time, wanted.force))
    kept = (grid >= EDGE_S) & (grid <= wanted.time[-1] - EDGE_S)
    return ForceError(grid[kept], asked[kept], smoothed[kept])


@dataclass(frozen=True)
class TrialRun:
    """One run that counts: name, which model, its error, and the rms that was predicted (N; NaN: none)."""

    run: str
    model: str
    error: ForceError
    predicted_rms: float


@dataclass(frozen=True)
class ModelForce:
    """All runs of one model.

    Attributes:
        rms, peak: N, over the runs; ``peak`` is the mean of the runs' largest errors.
        predicted_rms: N.
        repeatability: rms of the runs about their mean, N: what no feed-forward can take away.
        parts: share of the squared error by cause, together 1.
    """

    model: str
    runs: tuple[TrialRun, ...]
    rms: float
    peak: float
    predicted_rms: float
    repeatability: float
    parts: Mapping[str, float]

    @property
    def courses(self) -> tuple[Array, Array, Array]:
        """Time (s) and wanted force (N), (n,) each, and measured force of every run, N, (runs, n)."""
        length = min(len(run.error.time) for run in self.runs)
        first = self.runs[0].error
        measured = np.stack([run.error.measured[:length] for run in self.runs])
        return first.time[:length], first.wanted[:length], measured


@dataclass(frozen=True)
class Trial:
    """What a trial shows.

    Attributes:
        model_file, effects: of the model. nominal, found: the latter None where one model was sent, either.
        ratio: force error (rms) of the found model over the nominal one's; NaN without both.
        low, high: its 90 % interval; NaN with fewer than two pairs.
        predicted_ratio: as the found model predicted it.
        found_share: how far from the nominal torque to the found one was gone, 0 to 1; NaN without either.
    """

    model_file: str
    effects: tuple[str, ...]
    nominal: ModelForce | None
    found: ModelForce | None
    ratio: float
    low: float
    high: float
    predicted_ratio: float
    found_share: float = math.nan


def analyse_trial(session: Session) -> Trial:
    """Force errors of a session of ``record --feed-forward``.

    Raises:
        UserError: it is no such session, or broke off before a run that counts.
    """
    entry = _object(session.attributes.get(FORCE_TRIAL), f"{session.path}, '{FORCE_TRIAL}'")
    if not entry:
        raise UserError(
            f"{session.path} holds no feed-forward trial; record one with 'fingerlab record --feed-forward "
            "MODEL.json --wanted FORCE.csv --ab 5'."
        )
    runs = [_run(run, session) for run in session.runs if run.attributes.get(FORCE_MODEL) in (NOMINAL, FOUND)]
    if not runs:
        raise UserError(
            f"{session.path} broke off while it practised; 'fingerlab info' shows its notes, which say why."
        )
    by_model = {name: [run for run in runs if run.model == name] for name in (NOMINAL, FOUND)}
    nominal, found = (_together(name, mine) if mine else None for name, mine in by_model.items())
    ratio = predicted = low = high = math.nan
    if nominal is not None and found is not None:
        ratio, predicted = found.rms / nominal.rms, found.predicted_rms / nominal.predicted_rms
        pairs = min(len(nominal.runs), len(found.runs))
        low, high = _interval(
            [run.error.rms for run in nominal.runs[:pairs]], [run.error.rms for run in found.runs[:pairs]]
        )
    effects = tuple(str(one) for one in entry.get("effects", ()))
    shares = [_share(run) for run in session.runs if run.attributes.get(FORCE_MODEL) == FOUND]
    share = shares[0] if shares else math.nan
    return Trial(str(entry.get("model", "")), effects, nominal, found, ratio, low, high, predicted, share)


def _share(run: Run) -> float:
    """Of a run of an earlier version, which went all the way, 1."""
    stated = run.attributes.get(FOUND_SHARE, 1.0)
    return float(stated) if isinstance(stated, int | float) else math.nan


def _run(run: Run, session: Session) -> TrialRun:
    where = f"{session.path}, run {run.name}, '{WANTED_FORCE}'"
    entry = _object(run.attributes.get(WANTED_FORCE), where)
    try:
        force = np.asarray(entry["force_n"], dtype=np.float64)
        time = np.asarray(np.arange(len(force)) * float(entry["step_s"]), dtype=np.float64)
        wanted, lead = WantedForce({}, time, force), float(entry["lead_s"])
        predicted = float(run.attributes.get("foretold_rms_n", math.nan))
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{where} is damaged; record the trial again.") from None
    return TrialRun(run.name, str(run.attributes[FORCE_MODEL]), force_error(run, wanted, lead), predicted)


def _object(text: Any, where: str) -> dict[str, Any]:
    if text is None:
        return {}
    try:
        found = json.loads(text)
    except (TypeError, ValueError):
        raise UserError(f"{where} is no JSON; record the trial again.") from None
    return found if isinstance(found, dict) else {}


def _together(name: str, runs: Sequence[TrialRun]) -> ModelForce:
    length = min(len(run.error.error) for run in runs)
    errors = np.stack([run.error.error[:length] for run in runs])
    rms = float(np.sqrt(np.mean([run.error.rms**2 for run in runs])))
    scatter = errors - errors.mean(axis=0)
    # Of few runs the mean takes a part of their scatter with it.
    of_scatter = float((scatter**2).sum() / length / (len(runs) - 1)) if len(runs) > 1 else 0.0
    parts = _parts(errors.mean(axis=0), runs[0].error.wanted[:length], of_scatter, len(runs))
    peak = float(np.mean([run.error.peak for run in runs]))
    return ModelForce(name, tuple(runs), rms, peak, runs[0].predicted_rms, math.sqrt(of_scatter), parts)


STEEP = 4.0
"""How sharply friction turns round with the rate of the force, over its rms; assumed."""
ALIKE = 1e-6
"""Share of a column below which what is left of it beside others is rounding."""
CAUSES = {
    "offset": "a constant force",
    "gain": "in proportion to the wanted force",
    "delay": "late or early",
    "friction": "against the direction of the force",
    "scatter": "differs from run to run",
    "rest": "the rest, which repeats",
}
"""What of a force error each part is."""


def _parts(mean: Array, wanted: Array, scatter: float, runs: int) -> dict[str, float]:
    """Shares of the squared error: what differs from run to run, and of their mean one cause after the other.

    The cause that explains most comes first, and each takes what those before it have left (forward
    selection, sequential sums of squares), so that together they are 1.
    """
    rate = np.gradient(wanted, 1.0 / WIDE_RATE_HZ)
    level = float(np.sqrt(np.mean(rate**2))) or 1.0
    columns = {
        "offset": np.ones_like(wanted), "gain": wanted - wanted.mean(), "delay": rate / level,
        "friction": np.tanh(STEEP * rate / level),
    }  # fmt: skip
    left, shares = mean.copy(), dict.fromkeys(CAUSES, 0.0)
    basis: list[Array] = []
    while columns:
        explained = {name: _projected(left, column, basis) for name, column in columns.items()}
        best = max(explained, key=lambda name: float(np.mean(explained[name][0] ** 2)))
        part, direction = explained[best]
        shares[best], left = float(np.mean(part**2)), left - part
        basis.append(direction)
        del columns[best]
    rest = float(np.mean(left**2))
    by_chance = min(scatter / runs, rest)  # of the runs' scatter in their mean
    shares["scatter"] = scatter * (1.0 - 1.0 / runs) + by_chance
    shares["rest"] = rest - by_chance
    total = sum(shares.values()) or 1.0
    return {name: shares[name] / total for name in CAUSES}


def _projected(left: Array, column: Array, basis: Sequence[Array]) -> tuple[Array, Array]:
    """What a column explains beyond the basis (orthogonal columns), and its part orthogonal to them."""
    own = column.copy()
    for one in basis:
        own -= (own @ one) / max(float(one @ one), 1e-300) * one
    size = float(own @ own)
    if size <= ALIKE * float(column @ column):
        return np.zeros_like(left), np.zeros_like(left)
    return np.asarray((left @ own) / size * own), own


def _interval(nominal: Sequence[float], found: Sequence[float]) -> tuple[float, float]:
    """90 % interval of the ratio of rms errors, pairs drawn anew; NaN with fewer than two."""
    if len(nominal) < 2:
        return math.nan, math.nan
    squares = np.array([nominal, found]) ** 2
    drawn = np.random.default_rng(0).integers(len(nominal), size=(DRAWS, len(nominal)))
    ratios = np.sqrt(squares[1][drawn].mean(axis=1) / squares[0][drawn].mean(axis=1))
    low, high = np.quantile(ratios, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return float(low), float(high)


def trial_json(trial: Trial) -> dict[str, Any]:
    """The JSON of ``fingerlab trial``: SI units."""

    def of(model: ModelForce | None) -> dict[str, Any] | None:
        if model is None:
            return None
        return {
            "rms": model.rms, "peak": model.peak, "foretold_rms": model.predicted_rms,
            "repeatability": model.repeatability, "parts": dict(model.parts),
            "by_run": [{"run": r.run, "rms": r.error.rms, "peak": r.error.peak} for r in model.runs],
        }  # fmt: skip

    interval = {"level": LEVEL, "low": trial.low, "high": trial.high}
    return {
        "schema": 1, "model": trial.model_file, "effects": list(trial.effects), "unit": "N",
        "nominal": of(trial.nominal), "found": of(trial.found),
        "found_share": trial.found_share,
        "ratio": {"value": trial.ratio, "interval": interval, "foretold": trial.predicted_ratio},
    }  # fmt: skip

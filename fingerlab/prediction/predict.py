"""Endpoint force of contact runs from an extended model, and that model fitted from sessions and effects.

Every run is predicted by values that have not seen it, wherever there are such; and once more with a contact
force that leans further and further (thesis figure 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress, Watch
from fingerlab.diagnosis.answer.candidates import every_parameter
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.bench_constants import settle_constants
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.grid_refinement import fit_refined
from fingerlab.diagnosis.search.moved_zeros import with_zeros_taken_off
from fingerlab.diagnosis.search.reading_errors import with_readings_corrected
from fingerlab.diagnosis.settings import FULL_ITERATIONS, NARROW_RATE_HZ
from fingerlab.diagnosis.signals.conditions import GroupKey, folds_of_runs, group_key
from fingerlab.diagnosis.signals.load_cell_zero import zero_in_the_air
from fingerlab.diagnosis.signals.reading_errors import FORCE, NO_ERROR, ReadingErrors, in_si
from fingerlab.effects import effect
from fingerlab.models.file import hash_sessions
from fingerlab.prediction.error_band import (
    Band,
    ForceNumbers,
    RunError,
    calibrate,
    error_of,
    force_rate,
    judge_stretches,
)
from fingerlab.prediction.extended import EQUATIONS, ChosenEffect, Equation, ExtendedModel, HeldOut, Variant
from fingerlab.prediction.force import contact_stretches, solved_forces
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.thesis.onair import Spread
from fingerlab.thesis.prediction import SWEEP_DEG, AngleStep
from fingerlab.thesis.traces import coefficient_of_determination


@dataclass(frozen=True)
class StretchForces:
    """Forces of one stretch of a contact run, N, (n,): by the two equations, and what the cell read."""

    session_sha256: str
    run: str
    cable: str
    time: Array
    measured: Array
    pip: Array
    mcp: Array
    frequency_hz: float
    held_out: bool
    rate_hz: float = NARROW_RATE_HZ

    def both(self, pip_weight: float) -> Array:
        """The two equations weighed; one alone where the other has no lever."""
        mixed = pip_weight * self.pip + (1.0 - pip_weight) * self.mcp
        return np.where(np.isfinite(mixed), mixed, np.where(np.isfinite(self.pip), self.pip, self.mcp))


def contact_forces(variant: Variant, session: Session, sha256: str, where: str) -> list[StretchForces]:
    """Forces of every contact run, each by values that have not seen it wherever there are such.

    Args:
        where: the model's name, for the errors' sentences.
    """
    scales = variant.scales
    effects = [c.alone(scales) for c in variant.effects]
    second, newton = scales.time, scales.of("N")
    result = []
    errors = _errors(variant, session)
    for run in session.contact_runs():
        without = variant.values_without(sha256, run.name)
        values = variant.reduced(variant.values if without is None else without, session.rig)
        for one in contact_stretches(session, run, scales, errors):
            forces = solved_forces(one, effects, values, where)
            result.append(
                StretchForces(
                    sha256, run.name, run.cable, second * one.time, newton * one.measured,
                    newton * forces["pip"], newton * forces["mcp"], one.frequency_hz / second,
                    without is not None, NARROW_RATE_HZ / second,
                )
            )  # fmt: skip
    return result


def _errors(variant: Variant, session: Session) -> ReadingErrors:
    """Errors of a session's readings, SI: those of the fit, with the load cell's zero of this session."""
    zero = zero_in_the_air(session.runs)
    if zero is None:
        return variant.readings
    return {**variant.readings, FORCE: variant.readings.get(FORCE, NO_ERROR)._replace(zero=zero)}


def by_run(forces: Sequence[StretchForces], errors: Sequence[RunError | None]) -> list[RunError]:
    """Errors of the stretches, those of one run joined."""
    runs: dict[tuple[str, str], list[RunError]] = {}
    for one, error in zip(forces, errors, strict=True):
        if error is not None:
            runs.setdefault((one.session_sha256, one.run), []).append(error)
    return [
        RunError(*(np.concatenate([getattr(e, part) for e in parts]) for part in ("force", "rate", "error")))
        for parts in runs.values()
    ]


def equation_weight(forces: Sequence[StretchForces]) -> float:
    """Share of the PIP equation that makes the mean square of the held-out error least, 0 to 1."""
    pip = np.concatenate([f.pip - f.measured for f in forces] or [np.zeros(0)])
    mcp = np.concatenate([f.mcp - f.measured for f in forces] or [np.zeros(0)])
    good = np.isfinite(pip) & np.isfinite(mcp)
    apart = pip[good] - mcp[good]
    size = float(apart @ apart)
    return float(np.clip(-(apart @ mcp[good]) / size, 0.0, 1.0)) if size > 1e-12 else 0.5


@dataclass(frozen=True)
class Curve:
    """Force over one stretch of a run, N, (n,): measured, modelled, and half the 90 % interval.

    ``half_width`` is NaN where there is no interval.
    """

    time: Array
    measured: Array
    modelled: Array
    half_width: Array
    rate_hz: float = NARROW_RATE_HZ


@dataclass(frozen=True)
class RunPrediction:
    """One contact run by one variant of the model.

    Attributes:
        held_out: whether the values that predicted it had not seen it.
        numbers: by equation. curves: force that follows from both equations, by stretch.
        coverage: share of the load cell's samples inside the interval; NaN without cell or interval.
        half_width: mean half width of the interval, N.
    """

    run: str
    cable: str
    held_out: bool
    numbers: Mapping[Equation, ForceNumbers]
    curves: tuple[Curve, ...]
    coverage: float
    half_width: float


def spread_over(runs: Sequence[RunPrediction], equation: Equation, name: str) -> Spread:
    """One number of one equation over the runs, by its name in the JSON of ``predict``."""
    return Spread(tuple(run.numbers[equation].value(name) for run in runs))


def interval_over(runs: Sequence[RunPrediction]) -> tuple[float, float]:
    """Mean half width of the interval over the runs, N, and mean share of the samples inside."""
    return Spread(tuple(r.half_width for r in runs)).mean, Spread(tuple(r.coverage for r in runs)).mean


@dataclass(frozen=True)
class ExtendedPrediction:
    """Every contact run of a session by every variant: ``extended`` (if it has effects) and ``nominal``."""

    session: Path
    runs: Mapping[str, tuple[RunPrediction, ...]]


def predict_extended(
    session: Session, model: ExtendedModel, where: str, progress: Progress | None = None
) -> ExtendedPrediction:
    """Predict the endpoint force of every contact run from the motor's channels and the joints.

    A run that the model was fitted to is predicted by values fitted without it, and its interval is
    calibrated on the other runs.

    Args:
        where: the model's name, for the errors' sentences.

    Raises:
        UserError: no contact run, a run that cannot be read, or a cable that the model has not seen.
    """
    if not session.contact_runs():
        raise UserError(
            f"{session.path} has no contact run with a cable; the endpoint force is predicted for runs of "
            "phase 'contact'."
        )
    sha256 = content_hash(session)
    result = {}
    for number, (name, variant) in enumerate(model.variants.items()):
        if progress is not None:
            progress(number / len(model.variants), f"{name} model")
        result[name] = predict_variant(variant, session, sha256, where)
    return ExtendedPrediction(session.path, result)


def predict_variant(variant: Variant, session: Session, sha256: str, where: str) -> tuple[RunPrediction, ...]:
    """The same for one variant; ``sha256`` is the hash of the session's file."""
    forces = contact_forces(variant, session, sha256, where)
    names = list(dict.fromkeys(f.run for f in forces))
    result = []
    for name in names:
        ours = [f for f in forces if f.run == name]
        band = _band_without(variant, forces, name) if ours[0].held_out else variant.band
        result.append(_run(variant, ours, band))
    return tuple(result)


def _band_without(variant: Variant, forces: Sequence[StretchForces], run: str) -> Band | None:
    """The band that the other held-out runs of this session give; the file's where they are too few."""
    others = [f for f in forces if f.run != run and f.held_out]
    errors = [error_of(f.both(variant.pip_weight), f.measured, f.rate_hz) for f in others]
    return calibrate(by_run(others, errors)) or variant.band


def _run(variant: Variant, stretches: Sequence[StretchForces], band: Band | None) -> RunPrediction:
    by_equation = {e: [_force(f, e, variant.pip_weight) for f in stretches] for e in EQUATIONS}
    numbers = {
        equation: judge_stretches(
            [f.measured for f in stretches], modelled, stretches[0].rate_hz, stretches[0].frequency_hz
        )
        for equation, modelled in by_equation.items()
    }
    curves = tuple(
        Curve(f.time, f.measured, force, _half_width(band, force, f.rate_hz), f.rate_hz)
        for f, force in zip(stretches, by_equation["both"], strict=True)
    )
    widths = np.concatenate([c.half_width for c in curves])
    missed = np.concatenate([np.abs(c.modelled - c.measured) for c in curves])
    known = np.isfinite(widths) & np.isfinite(missed)
    return RunPrediction(
        stretches[0].run,
        stretches[0].cable,
        stretches[0].held_out,
        numbers,
        curves,
        float(np.mean(missed[known] <= widths[known])) if known.any() else float("nan"),
        float(np.nanmean(widths)) if np.isfinite(widths).any() else float("nan"),
    )


def _force(forces: StretchForces, equation: Equation, pip_weight: float) -> Array:
    if equation == "both":
        return forces.both(pip_weight)
    return forces.pip if equation == "pip" else forces.mcp


def _half_width(band: Band | None, force: Array, rate_hz: float) -> Array:
    if band is None:
        return np.full_like(force, np.nan)
    return band.half_width(force, force_rate(force, rate_hz))


def swept(variant: Variant, session: Session, sha256: str, where: str) -> Mapping[str, tuple[AngleStep, ...]]:
    """Peak and R2 at each angle, for every contact run that repeats, by its name.

    The load cell reads the force along its axis; leaning towards the base by an angle, the fingertip also
    pushes along the cell's face with ``-tan(angle)`` of it, beside what the model found there already.

    As in a prediction, a run that the fit has seen is judged by values that have not seen it.

    Args:
        sha256: hash of the session's file. where: the model's name, for the errors' sentences.
    """
    scales = variant.scales
    effects = [chosen.alone(scales) for chosen in variant.effects]
    second, newton = scales.time, scales.of("N")
    result = {}
    errors = _errors(variant, session)
    for run in session.contact_runs():
        stretch = max(contact_stretches(session, run, scales, errors), key=lambda one: len(one.time))
        if stretch.frequency_hz == 0.0:
            continue
        values = variant.values_without(sha256, run.name) or variant.values
        values = variant.reduced(values, session.rig)
        steps = []
        for angle in SWEEP_DEG:
            lateral = values.get("lateral", 0.0) - math.tan(math.radians(angle))
            forces = solved_forces(stretch, effects, {**values, "lateral": lateral}, where)
            mixed = variant.pip_weight * forces["pip"] + (1.0 - variant.pip_weight) * forces["mcp"]
            force = newton * np.where(np.isfinite(mixed), mixed, forces["pip"])
            found = judge_stretches(
                [newton * stretch.measured], [force], NARROW_RATE_HZ / second, stretch.frequency_hz / second
            ).prediction
            r2 = coefficient_of_determination(found.measured, found.modelled)
            steps.append(AngleStep(angle, found.modelled, found.peak_modelled, r2))
        result[run.name] = tuple(steps)
    return result


def fit_extended(
    sessions: Sequence[Session],
    effects: Sequence[str],
    progress: Progress | None = None,
    held: Mapping[str, float] | None = None,
) -> ExtendedModel:
    """Fit the nominal model and the same with ``effects`` (ids, in order) to all runs of the sessions.

    Every contact run is also left out once: the values without it stand in ``Variant.held_out``, and what its
    force then misses gives the interval. ``held``: unknowns that are held, by key, and their values, SI.

    Raises:
        UserError: an unknown effect, one that does not apply to these runs, or a run that cannot be read.
    """
    count = len(dict.fromkeys(effects))
    return _fit(sessions, effects, [count], progress, held)[0]


def fit_steps(
    sessions: Sequence[Session], effects: Sequence[str], progress: Progress | None = None
) -> tuple[ExtendedModel, ...]:
    """The same with the first effect alone, the first two, and so on to all, each effect of the one shape
    that it has beside all others; the numbers are each model's own.

    Raises:
        UserError: as for :func:`fit_extended`.
    """
    return _fit(sessions, effects, range(1, len(dict.fromkeys(effects)) + 1), progress, None)


def _fit(
    sessions: Sequence[Session],
    effects: Sequence[str],
    counts: Sequence[int],
    progress: Progress | None,
    held: Mapping[str, float] | None,
) -> tuple[ExtendedModel, ...]:
    """Models with the first so many of the effects, beside one nominal model."""
    chosen = [effect(name) for name in dict.fromkeys(effects)]
    tell = progress or (lambda share, what: None)
    with threadpool_limits(limits=1, user_api="blas"):
        reduction = Reduction(sessions)
        reduction.restart(held)
        watch = Watch(lambda share, what: tell(0.5 * share, what))
        settle_constants(reduction, Scorer(reduction.of([], watch)))  # as for a verdict

        def refined(before: FittedModel | None = None) -> tuple[Scorer, FittedModel]:
            return fit_refined(reduction, chosen, watch)

        scorer, whole = refined()
        for corrected in (with_zeros_taken_off, with_readings_corrected):
            models = [scorer.score_held_out(one) for one in (whole, scorer.fit([], whole))]
            scorer, whole = corrected(reduction, models, refined, _outcome) or (scorer, whole)
        tell(0.6, "fitting")
        nominal = scorer.fit([], scorer.fit([], whole), FULL_ITERATIONS)
        models = [_first(scorer, whole, count) for count in counts]
        hashes = hash_sessions(sessions)
        names = [h.sha256 for h in hashes]
        by_session = {s.path: sha256 for s, sha256 in zip(sessions, names, strict=True)}
        folds = _contact_folds(scorer, reduction.pairs, by_session)
        readings = in_si(reduction.reading_errors, reduction.scales)
        done: list[Variant] = []
        for number, fitted in enumerate([nominal, *(t for t in models if t.choices)]):
            tell(0.7 + 0.3 * number / (len(models) + 1), "calibrating the interval")
            variant = replace(_variant(scorer, fitted, folds), readings=readings)
            done.append(_calibrated(variant, sessions, by_session))
        parameters = [every_parameter(t, t.temperature()) for t in map(scorer.score_held_out, models)]
    plain, extended, rig = done[0], iter(done[1:]), sessions[0].rig.to_json()
    return tuple(
        ExtendedModel(next(extended) if t.choices else plain, plain, found, hashes, dict(held or {}), rig)
        for t, found in zip(models, parameters, strict=True)
    )


def _outcome(found: tuple[Scorer, FittedModel]) -> tuple[FittedModel, bool]:
    """The model, held out; a fit does not ask what else is missing."""
    scorer, fitted = found
    return scorer.score_held_out(fitted), False


def _first(scorer: Scorer, whole: FittedModel, count: int) -> FittedModel:
    """The model with the first so many of its effects alone, under its weights."""
    if count == len(whole.choices):
        return whole
    return scorer.fit(whole.choices[:count], whole, FULL_ITERATIONS)


@dataclass(frozen=True)
class _LeftOut:
    """A fold of contact runs: its group and number, and the runs in it as (hash of the session, run)."""

    key: GroupKey
    fold: int
    runs: tuple[tuple[str, str], ...]


def _contact_folds(
    scorer: Scorer, pairs: Sequence[tuple[Session, Run]], hashes: Mapping[Path, str]
) -> list[_LeftOut]:
    """Contact runs as :func:`folds_of_runs` dealt them to folds; none of a group with a single fold."""
    names = {g.key: [f.runs for f in g.folds] for g in scorer.reduced.groups}
    dealt: dict[tuple[GroupKey, int], list[tuple[str, str]]] = {}
    for (session, run), k in zip(pairs, folds_of_runs([run for _, run in pairs])[1], strict=True):
        key = group_key(run)
        if run.phase != "contact" or len(names[key]) < 2:
            continue
        if run.name not in names[key][k]:
            raise AssertionError(f"run {run.name} is not in fold {k} of {key}")
        dealt.setdefault((key, k), []).append((hashes[session.path], run.name))
    return [_LeftOut(key, k, tuple(runs)) for (key, k), runs in dealt.items()]


def _fitted_without(scorer: Scorer, fitted: FittedModel, out: _LeftOut) -> FittedModel:
    """The same model fitted to all runs but those of one fold, under the same weights."""
    groups = [g.without(out.fold) if g.key == out.key else g for g in scorer.reduced.groups]
    return Scorer(replace(scorer.reduced, groups=groups)).fit(fitted.model.choices, fitted, FULL_ITERATIONS)


def _variant(scorer: Scorer, fitted: FittedModel, folds: Sequence[_LeftOut]) -> Variant:
    held_out = []
    for out in folds:
        values = _by_key(_fitted_without(scorer, fitted, out))
        for session in dict.fromkeys(sha for sha, _ in out.runs):
            held_out.append(HeldOut(session, tuple(name for sha, name in out.runs if sha == session), values))
    effects = tuple(ChosenEffect(effect(c.effect.id), _shape(fitted, c)) for c in fitted.model.choices)
    score = scorer.score_held_out(fitted).score
    return Variant(effects, _by_key(fitted), tuple(held_out), score, scales=fitted.model.layout.scales)


def _shape(fitted: FittedModel, choice: Choice) -> dict[str, float]:
    """The shape of one of the model's effects, SI."""
    one, of = choice.effect, fitted.model.layout.scales.of
    if not len(one.shapes):
        return {}
    return {k: float(v) * of(one.shape_units.get(k, "1")) for k, v in one.shapes[choice.shape].items()}


def _by_key(fitted: FittedModel) -> dict[str, float]:
    """Values of the unknowns by key, SI."""
    of = fitted.model.layout.scales.of
    return {u.key: fitted.values[u.key] * of(u.parameter.unit) for u in fitted.model.unknowns}


def _calibrated(variant: Variant, sessions: Sequence[Session], hashes: Mapping[Path, str]) -> Variant:
    """The variant with the weight of the two equations and the band of its held-out contact runs."""
    forces = [
        f for s in sessions for f in contact_forces(variant, s, hashes[s.path], str(s.path)) if f.held_out
    ]
    weight = equation_weight(forces)
    errors = [error_of(f.both(weight), f.measured, f.rate_hz) for f in forces]
    return replace(variant, pip_weight=weight, band=calibrate(by_run(forces, errors)))

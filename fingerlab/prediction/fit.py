"""From sessions and the ids of effects to a fitted model that can be kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from fingerlab.core.progress import Progress, Watch
from fingerlab.diagnosis.answer.wording import every_parameter
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.weights import temperature
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.grid_refinement import fit_refined
from fingerlab.diagnosis.settings import FULL_ITERATIONS
from fingerlab.diagnosis.signals.conditions import GroupKey, deal_runs, group_key, runs_to_analyse
from fingerlab.effects import effect
from fingerlab.models.file import ParameterEstimate, hash_sessions
from fingerlab.prediction.extended import ChosenEffect, ExtendedModel, HeldOut, Variant
from fingerlab.prediction.judging import calibrate, error_of
from fingerlab.prediction.predict import by_run, contact_forces, equation_weight
from fingerlab.sessions.model import Session


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
        reduction.held = dict(held or {})
        scorer, whole = fit_refined(reduction, chosen, Watch(lambda share, what: tell(0.5 * share, what)))
        tell(0.6, "fitting")
        nominal = scorer.fit([], scorer.fit([], whole), FULL_ITERATIONS)
        trials = [_first(scorer, whole, count) for count in counts]
        hashes = hash_sessions(sessions)
        names = [h.sha256 for h in hashes]
        by_session = {s.path: sha256 for s, sha256 in zip(sessions, names, strict=True)}
        folds = _contact_folds(scorer, reduction.sessions, by_session)
        done: list[Variant] = []
        for number, trial in enumerate([nominal, *(t for t in trials if t.choices)]):
            tell(0.7 + 0.3 * number / (len(trials) + 1), "calibrating the interval")
            done.append(_calibrated(_variant(scorer, trial, folds), sessions, by_session))
        parameters = [_estimates(scorer.score_held_out(trial)) for trial in trials]
    plain, extended = done[0], iter(done[1:])
    return tuple(
        ExtendedModel(next(extended) if t.choices else plain, plain, found, hashes, dict(held or {}))
        for t, found in zip(trials, parameters, strict=True)
    )


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


def _contact_folds(scorer: Scorer, sessions: Sequence[Session], hashes: Mapping[Path, str]) -> list[_LeftOut]:
    """Contact runs as :func:`deal_runs` dealt them to folds; none of a group with a single fold."""
    names = {g.key: [f.runs for f in g.folds] for g in scorer.reduced.groups}
    pairs = runs_to_analyse(sessions)[0]
    dealt: dict[tuple[GroupKey, int], list[tuple[str, str]]] = {}
    for (session, run), k in zip(pairs, deal_runs([run for _, run in pairs])[1], strict=True):
        key = group_key(run)
        if run.name not in names[key][k]:
            raise AssertionError(f"run {run.name} is not in fold {k} of {key}")
        if run.phase == "contact" and len(names[key]) > 1:
            dealt.setdefault((key, k), []).append((hashes[session.path], run.name))
    return [_LeftOut(key, k, tuple(runs)) for (key, k), runs in dealt.items()]


def _fitted_without(scorer: Scorer, trial: FittedModel, out: _LeftOut) -> FittedModel:
    """The same model fitted to all runs but those of one fold, under the same weights."""
    groups = [g.without(out.fold) if g.key == out.key else g for g in scorer.reduced.groups]
    return Scorer(replace(scorer.reduced, groups=groups)).fit(trial.model.choices, trial, FULL_ITERATIONS)


def _variant(scorer: Scorer, trial: FittedModel, folds: Sequence[_LeftOut]) -> Variant:
    held_out = []
    for out in folds:
        values = _by_key(_fitted_without(scorer, trial, out))
        for session in dict.fromkeys(sha for sha, _ in out.runs):
            held_out.append(HeldOut(session, tuple(name for sha, name in out.runs if sha == session), values))
    effects = tuple(ChosenEffect(effect(c.effect.id), _shape(trial, c)) for c in trial.model.choices)
    score = scorer.score_held_out(trial).score
    return Variant(effects, _by_key(trial), tuple(held_out), score, scales=trial.model.layout.scales)


def _shape(trial: FittedModel, choice: Choice) -> dict[str, float]:
    """The shape of one of the model's effects, SI."""
    one, of = choice.effect, trial.model.layout.scales.of
    if not len(one.shapes):
        return {}
    return {k: float(v) * of(one.shape_units.get(k, "1")) for k, v in one.shapes[choice.shape].items()}


def _by_key(trial: FittedModel) -> dict[str, float]:
    """Values of the unknowns by key, SI."""
    of = trial.model.layout.scales.of
    return {u.key: trial.values[u.key] * of(u.parameter.unit) for u in trial.model.unknowns}


def _estimates(trial: FittedModel) -> dict[str, ParameterEstimate]:
    """All unknowns with 90 % intervals, as the diagnosis tells them."""
    return every_parameter(trial, temperature(trial.misfit, trial.count))


def _calibrated(variant: Variant, sessions: Sequence[Session], hashes: Mapping[Path, str]) -> Variant:
    """The variant with the weight of the two equations and the band of its held-out contact runs."""
    forces = [
        f for s in sessions for f in contact_forces(variant, s, hashes[s.path], str(s.path)) if f.held_out
    ]
    weight = equation_weight(forces)
    errors = [error_of(f.both(weight), f.measured, f.rate_hz) for f in forces]
    return replace(variant, pip_weight=weight, band=calibrate(by_run(forces, errors)))

"""Several models on the same contact runs: side by side, and held against runs that none has seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress, Watch
from fingerlab.diagnosis.answer.error_parts import EquationError
from fingerlab.diagnosis.answer.errors import equation_errors, equation_floors, with_floors
from fingerlab.diagnosis.equations.model import Choice, Model
from fingerlab.diagnosis.equations.parameters import ARMS, CABLE_OFFSET
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.fit.solver import Fit, Fitter
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.score.bench_constants import settle_constants
from fingerlab.diagnosis.score.fitted_model import FittedModel, reaching
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import NARROW_RATE_HZ
from fingerlab.diagnosis.signals.scales import Scales, find_scales
from fingerlab.effects.base import Effect
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel
from fingerlab.prediction.error_band import ForceNumbers, fine_grid, judge_stretches
from fingerlab.prediction.extended import ChosenEffect, ExtendedModel, Variant, extended_model
from fingerlab.prediction.predict import RunPrediction, predict_extended, predict_variant, swept
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Array, Session
from fingerlab.signals.periods import REGION_TITLES, PeriodGrid, normalise, usable
from fingerlab.thesis.contact import parameter_sets
from fingerlab.thesis.fitting import in_pieces
from fingerlab.thesis.onair import thin
from fingerlab.thesis.prediction import AngleStep, ParameterSet, angle_sweep, judge, predicted_force
from fingerlab.thesis.traces import JOINT_TITLES, Traces, settled, trace

NOMINAL = "nominal model"


@dataclass(frozen=True)
class ComparedModel:
    """One model on the session.

    Attributes:
        name: of its file; ``NOMINAL`` for the nominal part of the first file.
        left_out: True where the session is one that the model was fitted to, so that each run was left out
            of the fit that judges it; False where the whole model comes from other sessions.
        score: error over all equations in floors of the best model compared.
        errors: by family of equations; empty for a model from other sessions.
        forces: contact runs; empty for a session without any.
    """

    name: str
    effects: tuple[str, ...]
    left_out: bool
    score: float
    errors: Mapping[str, EquationError] = field(default_factory=dict)
    forces: tuple[RunPrediction, ...] = ()


@dataclass(frozen=True)
class ModelComparison:
    """All models, in the order given; the nominal model first."""

    session: Path
    models: tuple[ComparedModel, ...]


def compare_models(
    session: Session, models: Mapping[str, ExtendedModel], progress: Progress | None = None
) -> ModelComparison:
    """Judge every model on the runs of ``session``, under the same weights.

    Args:
        models: by name, as shown.

    Raises:
        UserError: no model, an effect that does not apply to these runs, or a run that cannot be read.
    """
    if not models:
        raise UserError("No model was given; name at least one model file written by 'diagnose --save'.")
    tell = progress or (lambda share, what: None)
    sha256 = content_hash(session)
    first = next(iter(models.values()))
    entries = {} if any(not m.effect_ids for m in models.values()) else {NOMINAL: (first, first.nominal)}
    entries |= {name: (m, m.extended) for name, m in models.items()}
    with threadpool_limits(limits=1, user_api="blas"):
        scales = find_scales([session])
        effects = _union([variant for _, variant in entries.values()], scales)
        watch = Watch(lambda share, what: tell(0.6 * share, what))
        reduction = Reduction([session], scales=scales)
        scorer = settle_constants(reduction, Scorer(reduction.of(effects, watch)))  # as for a verdict
        reduced = scorer.reduced
        tell(0.6, "fitting")
        entrants = {
            name: _Entrant(scorer, reduced, variant, any(h.sha256 == sha256 for h in model.sessions), name)
            for name, (model, variant) in entries.items()
        }
        settled = {name: entrant.settled() for name, entrant in entrants.items()}
        # All are told in floors of the model that comes closest to its own.
        closest = min(entrants, key=lambda name: entrants[name].judged(*settled[name]).score)
        floors = settled[closest][1]
        told = equation_floors(reduced, entrants[closest].judged(*settled[closest]))
        rows = []
        for number, (name, entrant) in enumerate(entrants.items()):
            tell(0.7 + 0.3 * number / len(entrants), f"predicting with {name}")
            scored = entrant.judged(settled[name][0], floors)
            rows.append(
                ComparedModel(
                    name,
                    tuple(c.effect.id for c in entrant.variant.effects),
                    entrant.own,
                    scored.score,
                    with_floors(equation_errors(reduced, scored), told) if entrant.own else {},
                    predict_variant(entrant.variant, session, sha256, name) if session.contact_runs() else (),
                )
            )
    return ModelComparison(session.path, tuple(rows))


def _union(variants: Sequence[Variant], scales: Scales) -> list[Effect]:
    """Every effect of the models once, with all shapes (in reduced units) in which they hold it.

    With ranges as wide as their values ask for: a search may have widened what nobody had measured.
    """
    found: dict[str, Effect] = {}
    shapes: dict[str, list[Mapping[str, float]]] = {}
    for variant in variants:
        for chosen in variant.effects:
            name, shape = chosen.effect.id, chosen.shape_in(scales)
            found[name] = reaching(found.get(name, chosen.effect), variant.values, scales)
            of_effect = shapes.setdefault(name, [])
            if shape not in of_effect:
                of_effect.append(shape)
    return [replace(one, shapes=tuple(shapes[name])) for name, one in found.items()]


@dataclass
class _Entrant:
    """One variant in the scorer of the session; ``own`` where it was fitted to this very session."""

    scorer: Scorer
    reduced: Reduced
    variant: Variant
    own: bool
    name: str

    def __post_init__(self) -> None:
        self.choices = [self._choice(c) for c in self.variant.effects]
        model = self.scorer.model(self.choices)
        self.start = FittedModel(
            model, Fit(self._values(model), np.eye(len(model.unknowns)), 0.0), self.scorer.first_weights
        )

    def _choice(self, chosen: ChosenEffect) -> Choice:
        for one in self.reduced.layout.effects:
            if one.id == chosen.effect.id:
                shape = dict(chosen.shape_in(self.reduced.layout.scales))
                return Choice(one, [dict(s) for s in one.shapes].index(shape))
        raise UserError(
            f"{self.name} holds '{chosen.effect.title or chosen.effect.id}', which does not apply to these "
            "runs; compare it on a session with the runs that it was fitted to."
        )

    def _values(self, model: Model) -> Array:
        values = self.scorer.start_values(model)
        for place, unknown in enumerate(model.unknowns):
            if unknown.key in self.variant.values:
                size = self.reduced.layout.scales.of(unknown.parameter.unit)
                values[place] = self.variant.values[unknown.key] / size
            elif unknown.name in ARMS:
                raise UserError(
                    f"{self.name} was not fitted with the {unknown.cable} cable; compare it on "
                    "sessions with the cables that it was fitted with."
                )
        return values

    def settled(self) -> tuple[FittedModel, Weights]:
        """The fit and the weights that belong to it; of a model of another session only the motor zero."""
        if self.own:
            fitted = self.scorer.fit_reweighted(self.choices, self.start)
            return fitted, fitted.weights
        fitted, weights = self.start, self.start.weights
        for _ in range(2):
            fitted = self._zeroed(fitted, weights)
            weights = self.scorer.own_weights(fitted)
        return fitted, weights

    def judged(self, fitted: FittedModel, weights: Weights) -> FittedModel:
        """Scored under these weights on runs that its values have not seen."""
        if self.own:
            again = self.scorer.fit(self.choices, fitted, weights=weights)
            return self.scorer.score_held_out(again, residuals=True)
        return self.scorer.score_in_sample(self._zeroed(fitted, weights))

    def _zeroed(self, fitted: FittedModel, weights: Weights) -> FittedModel:
        """With the cable's offset fitted: the motor's zero is no physics and differs by session."""
        model, values = fitted.model, fitted.fit.values.copy()
        free = np.flatnonzero([u.name == CABLE_OFFSET and not u.effect for u in model.unknowns])
        if len(free):
            gradient, information = Fitter(model, self.scorer.data, weights).normal_equations(values)
            values[free] -= np.linalg.solve(information[np.ix_(free, free)], gradient[free])
        return FittedModel(model, Fit(values, fitted.fit.information, 0.0), weights)


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
class ModelForces:
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


def predict_beside(
    session: Session, models: Mapping[str, SavedModel], progress: Progress | None = None
) -> ModelForces:
    """Predict every contact run with every model.

    Args:
        models: content of model files by name, as shown.

    Raises:
        UserError: no contact run, or a model that cannot predict these runs.
    """
    runs = in_pieces(session.contact_runs())
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
    return ModelForces(session.path, tuple(names), tuple(preferred), forces)


def _preferred(sets: Mapping[str, ParameterSet], cable: str) -> list[str]:
    def rank(name: str) -> tuple[bool, bool, bool]:
        one = sets[name]
        return one.joint != "pip", one.name not in ("extension", "whole"), one.cable != cable

    return sorted(sets, key=rank)[:1]


def _read(models: Mapping[str, SavedModel]) -> _Given:
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

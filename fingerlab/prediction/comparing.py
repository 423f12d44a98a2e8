"""Several saved models on the same runs, none of which the values that judge it have seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress, Watch
from fingerlab.diagnosis.answer.errors import equation_errors
from fingerlab.diagnosis.answer.results import EquationError
from fingerlab.diagnosis.equations.model import Choice, Model
from fingerlab.diagnosis.equations.parameters import ARMS, CABLE_OFFSET
from fingerlab.diagnosis.fit.solver import Fit, Fitter
from fingerlab.diagnosis.fit.weights import Weights
from fingerlab.diagnosis.gram.reduction import reduce_sessions
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.signals.scales import Scales, find_scales
from fingerlab.effects.base import Effect
from fingerlab.prediction.extended import ChosenEffect, ExtendedModel, Variant
from fingerlab.prediction.force import contact_runs
from fingerlab.prediction.predict import RunPrediction, predict_variant
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Array, Session

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
        reduced = reduce_sessions([session], effects, watch, scales)
        scorer = Scorer(reduced)
        tell(0.6, "fitting")
        entrants = {
            name: _Entrant(scorer, reduced, variant, any(h.sha256 == sha256 for h in model.sessions), name)
            for name, (model, variant) in entries.items()
        }
        settled = {name: entrant.settled() for name, entrant in entrants.items()}
        # All are told in floors of the model that comes closest to its own.
        closest = min(entrants, key=lambda name: entrants[name].judged(*settled[name]).score)
        floors = settled[closest][1]
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
                    equation_errors(reduced, scored) if entrant.own else {},
                    predict_variant(entrant.variant, session, sha256, name) if contact_runs(session) else (),
                )
            )
    return ModelComparison(session.path, tuple(rows))


def _union(variants: Sequence[Variant], scales: Scales) -> list[Effect]:
    """Every effect of the models once, with all shapes (in reduced units) in which they hold it."""
    found: dict[str, tuple[Effect, list[Mapping[str, float]]]] = {}
    for variant in variants:
        for chosen in variant.effects:
            _, shapes = found.setdefault(chosen.effect.id, (chosen.effect, []))
            shape = chosen.shape_in(scales)
            if shape not in shapes:
                shapes.append(shape)
    return [replace(one, shapes=tuple(shapes)) for one, shapes in found.values()]


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
            f"{self.name} holds '{chosen.effect.id}', which does not apply to these runs; compare it on a "
            "session with the runs that it was fitted to."
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

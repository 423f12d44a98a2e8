"""A fitted model with parameters that a person sets by hand.

Nothing is read again: errors come from the products of signals that the fit had, curves from the signals that
the first reading kept. A value that is moved leaves the others where they are, or lets them follow as a fit
with it held would. Errors are those on all runs, under the weights of the fit; no run is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.core.progress import SILENT, Watch
from fingerlab.core.text import ParameterEstimate
from fingerlab.diagnosis.answer.curves import Display, comparisons_of
from fingerlab.diagnosis.answer.error_parts import Comparison, EquationError
from fingerlab.diagnosis.answer.errors import equation_errors, with_floors
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.answer.stretches import RunOffsets
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.solver import Fit, Fitter
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import residual_offsets
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import FULL_ITERATIONS, HARDLY_DETERMINED, Z90
from fingerlab.rig.file import sources_of
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class FittedParameter:
    """One unknown of a fitted model. Numbers are SI.

    Attributes:
        key: by which values are told. effect: id of the effect whose it is; empty: of the bench.
        estimate: value with its 90 % interval. low, high: bounds that no fit leaves.
        source: where the bounds, and what was known before, come from.
        spread: standard deviation of what was known before any run; 0: nothing was.
        identified: the runs tell more of it than was known before. held: somebody holds it.
    """

    key: str
    effect: str
    estimate: ParameterEstimate
    low: float
    high: float
    source: str
    spread: float
    identified: bool
    held: bool


@dataclass(frozen=True)
class WhatIf:
    """The model with other values.

    Attributes:
        values: of every unknown, SI. score: error on all runs, in floors of the fit.
        errors: by family of equations, on all runs.
        fitted: as a model. offsets: the constants of the runs' own beside it.
    """

    values: Mapping[str, float]
    score: float
    errors: Mapping[str, EquationError]
    fitted: FittedModel
    offsets: RunOffsets


class ParameterExplorer:
    """The model of one diagnosis, ready to be moved.

    Attributes:
        parameters: every unknown, those of effects last.
        as_fitted: the model as it was fitted, judged as every other is here.
    """

    def __init__(self, reduction: Reduction, diagnosis: Diagnosis, watch: Watch = SILENT) -> None:
        """``reduction``: what the diagnosis was given as ``kept``.

        Raises:
            UserError: a run cannot be read. Cancelled: the user asked for it.
        """
        base = diagnosis.fitted
        assert base is not None  # of a diagnosis that was made, not invented
        self._display = Display()
        with threadpool_limits(limits=1, user_api="blas"):
            diagnosis.resume(reduction)
            self._runs = reduction.runs
            effects = at_found_shapes(base)
            self._scorer = Scorer(reduction.of(effects, watch, self._display.keep))
        layout = self._scorer.reduced.layout
        self.model = self._scorer.model([Choice(effect) for effect in effects], base.model.tip_law)
        self._floors = {name: error.floor for name, error in diagnosis.errors.items()}
        self._drawn_floors = {(c.session, c.run, c.equation): c.floor for c in diagnosis.comparisons}
        self._weights, self._size = base.weights, layout.scales.of
        self._start = np.array([base.values[u.key] for u in self.model.unknowns])
        self.parameters = self._listed(diagnosis, reduction)
        self.as_fitted = self._judged(self._start)

    def _listed(self, diagnosis: Diagnosis, reduction: Reduction) -> tuple[FittedParameter, ...]:
        named = sources_of(reduction.rig)
        free = self._scorer.reduced.fixed and Scorer(replace(self._scorer.reduced, fixed={}))
        ranges = free.model(self.model.choices, self.model.tip_law).unknowns if free else self.model.unknowns
        found = []
        told = (unknown for unknown in ranges if unknown.key in diagnosis.parameters)  # others: of other laws
        for unknown in told:
            one, size = unknown.parameter, self._size(unknown.parameter.unit)
            estimate = diagnosis.parameters[unknown.key]
            spread = 0.0 if unknown.open else size * one.typical
            left = (estimate.high - estimate.low) / (2.0 * Z90)
            source = one.source
            if source == "rig file" and unknown.name in named:
                source = f"rig file: {named[unknown.name]}"
            found.append(
                FittedParameter(
                    unknown.key,
                    unknown.effect,
                    estimate,
                    size * one.low,
                    size * one.high,
                    source,
                    spread,
                    not spread or left < HARDLY_DETERMINED * spread,
                    unknown.key in diagnosis.held,
                )
            )
        return tuple(found)

    def what_if(self, moved: Mapping[str, float], follow: bool = False) -> WhatIf:
        """The model with values moved, by key, SI; within their bounds.

        ``follow``: the others take the values that fit best beside these.
        """
        values, index = self._start.copy(), self.model.index
        for key, value in moved.items():
            values[index[key]] = value / self._size(self.model.unknowns[index[key]].parameter.unit)
        if follow:
            fixed = self.model.fixing({key: float(values[index[key]]) for key in moved})
            with threadpool_limits(limits=1, user_api="blas"):
                fitter = Fitter(fixed, self._scorer.data, self._weights)
                values = fitter.run(values, FULL_ITERATIONS).values
        return self._judged(values)

    def _judged(self, values: Array) -> WhatIf:
        size = len(values)
        fitted = FittedModel(self.model, Fit(values, np.eye(size), 0.0), self._weights)
        with threadpool_limits(limits=1, user_api="blas"):
            scorer = (
                self._scorer.with_floor_weights()
            )  # a fresh one: else every place of a slider would be kept
            scored = scorer.score_in_sample(fitted, residuals=True)
            errors = with_floors(equation_errors(scorer.reduced, scored), self._floors)
            offsets = residual_offsets(scorer.run_offsets(fitted), self._runs)
        units = (self._size(u.parameter.unit) for u in self.model.unknowns)
        values_si = {
            u.key: float(v) * unit for u, v, unit in zip(self.model.unknowns, values, units, strict=True)
        }
        return WhatIf(values_si, scored.score, errors, scored, offsets)

    def comparisons(self, found: WhatIf, session: str, run: str) -> tuple[Comparison, ...]:
        """Measured and modelled of one run: every equation of every stretch, without what is left aside."""
        reduced = self._scorer.reduced
        drawn = comparisons_of(reduced, found.fitted, self._display, session, run, found.offsets)
        return tuple(replace(c, floor=self._drawn_floors[session, run, c.equation]) for c in drawn)

"""The sums, noises and weights behind a diagnosis: the one module that knows the inside of the program.

Where modules move or classes are renamed, this is mended and nothing else. What it returns must stay the
same, which is why signals are put in the order of their features' descriptions and not of their numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.fit.noise import floor_covariance, noise_covariance
from fingerlab.diagnosis.gram.sums import Group, Sums
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.grid_refinement import fit_effects
from fingerlab.effects import whole_catalogue
from fingerlab.sessions import open_session
from tests.reduced import reduce_sessions

Array = np.ndarray[Any, Any]
NOMINAL = "nominal"


def diagnosis_without(paths: Sequence[Path], left_out: Sequence[str]) -> dict[str, Any]:
    """The JSON of a diagnosis with a catalogue that lacks some effects."""
    said = diagnose(
        [open_session(path) for path in paths], with_curves=False, options=DiagnosisOptions(left_out=left_out)
    )
    return said.to_json()


def sums_and_noises(paths: Sequence[Path]) -> dict[str, Any]:
    """Sums over every fold, noise before and after it is limited, weights and floors under the nominal model.

    Arrays are told by a hash of their bytes and by the sum of their diagonal for each effect; the 5 by 5
    ones, the fitted values and the misfits as they are. A session that cannot be read gives its sentence.
    """
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            reduced = reduce_sessions([open_session(p) for p in paths], list(whole_catalogue().values()))
            told = _Told(reduced.layout)
            read = {g.key: (told.array(g.noise), g.noise_samples) for g in reduced.groups}
            scorer = Scorer(reduced)
            fitted = scorer.score_held_out(fit_effects(scorer, ()), residuals=True)
            groups = {"/".join(g.key): _group(told, g, fitted, *read[g.key]) for g in reduced.groups}
    except UserError as error:
        return {"errors": str(error).replace(str(paths[0].parent), "<folder>")}
    return {"features": len(told.labels), "groups": groups, "fit": _fit(fitted)}


class _Told:
    """Matrices over all signals, in an order that their numbers have no part in."""

    def __init__(self, layout: Layout) -> None:
        labels: dict[int, tuple[str, str]] = {}
        for signal, f in zip(layout.signals, layout.features, strict=True):
            owner = f.owner or NOMINAL
            what = (f.parameter, f.constant, f.scale, f.shift, f.per_cable, f.shares_nuisance, f.factor)
            label = (f"{owner} {f.shape:04d} {int(f.row)} {what}", owner)
            labels[int(signal)] = min(label, labels.get(int(signal), label))
        ordered = sorted(labels, key=lambda signal: (labels[signal], signal))
        self.order = np.array(ordered)
        self.labels = [labels[signal] for signal in ordered]

    def array(self, matrix: Array | None) -> dict[str, Any] | None:
        """Of a matrix (signals, signals)."""
        if matrix is None:
            return None
        ordered = matrix[np.ix_(self.order, self.order)]
        diagonal: dict[str, float] = {}
        for (_, owner), value in zip(self.labels, np.diag(ordered), strict=True):
            diagonal[owner] = diagonal.get(owner, 0.0) + float(value)
        return {"bytes": _bytes(ordered), "norm": _norm(ordered), "diagonal": dict(sorted(diagonal.items()))}

    def sums(self, sums: Sums) -> dict[str, Any]:
        return {
            "runs": list(sums.runs),
            "samples": [sums.taut_samples, sums.slack_samples, sums.rest_samples],
            "products": self.array(sums.products),
            "loose": self.array(sums.slack),
            "rest": self.array(sums.rest),
        }


def _group(
    told: _Told, group: Group, fitted: FittedModel, noise_read: Any, noise_samples: float
) -> dict[str, Any]:
    model, values, weights = fitted.model, fitted.fit.values, fitted.weights[group.key]
    return {
        "folds": [told.sums(fold) for fold in group.folds],
        "conditions and turns": [[fold.condition, fold.split] for fold in group.dealt],
        "noise as read": noise_read,
        "noise": told.array(group.noise),
        "noise samples": [float(noise_samples), float(group.noise_samples)],
        "encoder variance": float(group.encoder_variance),
        "weights": weights.tolist(),
        "noise covariance": noise_covariance(model, values, group).tolist(),
        "floor covariance": floor_covariance(model, values, group, weights, means=True).tolist(),
        "residuals": fitted.residuals[group.key].tolist(),
    }


def _fit(fitted: FittedModel) -> dict[str, Any]:
    keys = [unknown.key for unknown in fitted.model.unknowns]
    order = np.argsort(keys)
    return {
        "law of the tip": fitted.model.tip_law,
        "values": dict(sorted(zip(keys, map(float, fitted.fit.values), strict=True))),
        "information": _bytes(fitted.fit.information[np.ix_(order, order)]),
        "cost": float(fitted.fit.cost),
        "misfits": fitted.misfits.tolist(),
        "widening": float(fitted.widening),
        "surprise": float(fitted.prior_penalty),
        "score": float(fitted.score),
    }


def _bytes(values: Array) -> str:
    return hashlib.sha256(np.ascontiguousarray(values, dtype="<f8").tobytes()).hexdigest()[:20]


def _norm(values: Array) -> float:
    """Without linear algebra's libraries, whose sums depend on the machine."""
    return float(np.sqrt(np.sum(np.square(values))))

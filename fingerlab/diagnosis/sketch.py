"""Which grid point of an effect to try: one step of its gains beside a fitted model, all grid points at once.

At the best fit of the model the gradient along its own unknowns is zero, so one Newton step with an effect
more needs only the effect's own products and how much of them the model's unknowns could take over (the
Schur complement). That costs a hundredth of a fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.diagnosis.features import Feature
from fingerlab.diagnosis.fitting import WEAK_PRIOR, Fitter
from fingerlab.diagnosis.numerics import bounded_step
from fingerlab.diagnosis.study import Study
from fingerlab.diagnosis.trial import Trial
from fingerlab.diagnosis.weighing import feature_weights
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Promise:
    """A grid point and by how much the cost falls there in one step; infinite: not known."""

    shape: int
    fall: float


class Sketch:
    """Products of a fitted model with every feature of the catalogue, under the study's weights."""

    def __init__(self, study: Study, base: Trial) -> None:
        model, values = base.model, base.fit.values
        self.layout = model.layout
        fitter = Fitter(model, study.data, study.weights)
        fitter.hold(values)
        gradient, information = fitter.normal_equations(values)
        # Unknowns that stand at a bound and are pushed out of it stay where they are.
        held = ((values <= model.low) & (gradient > 0)) | ((values >= model.high) & (gradient < 0))
        self.free = np.flatnonzero(~held)
        self.inverse = np.linalg.pinv(information[np.ix_(self.free, self.free)], hermitian=True)
        self.gradient = gradient[self.free]
        self.groups = []
        for i, group in enumerate(study.data.groups):
            raw, clean = study.data.raw(i, None), study.data.noiseless[i]
            weights = EFFECTIVE_SHARE * study.weights[group.key]
            h, jacobian = model.coefficients(values, group)
            still = EFFECTIVE_SHARE * fitter.standing(i)
            every = self.layout.every
            self.groups.append(
                (
                    raw,
                    weights,
                    clean.across(h[None], model.pick, weights, every, still)[0],
                    raw.across(jacobian[:, self.free].T, model.pick, weights, every, still),
                    model.unit_coefficients(values, group),
                )
            )

    def promise(self, effect: Effect) -> Promise:
        """The effect's grid point whose first step lowers the cost most, and by how much."""
        if effect.special or effect.relaxes or effect.turns or not effect.gains:
            return Promise(0, np.inf)  # more than new columns: one step of the gains does not tell
        falls = [self.fall(effect, shape) for shape in range(len(effect.shapes))]
        best = int(np.argmax(falls))
        return Promise(best, falls[best])

    def fall(self, effect: Effect, shape: int) -> float:
        """By how much the cost (minus twice the log posterior) falls in one step of the effect's gains."""
        places = self.layout.indices(effect.id, shape)
        names = [name for name in effect.gains if name not in effect.offsets]
        pick = _picks([self.layout.features[i] for i in places], names)
        gains = [effect.gains[name] for name in names]
        curvature = np.diag([WEAK_PRIOR / g.typical**2 for g in gains])
        slope = np.zeros(len(gains))
        shared = np.zeros((len(self.free), len(gains)))
        theirs = self.layout.every[places]
        for raw, weights, pull, cross, unit in self.groups:
            columns = pick * unit[places][:, None]
            curvature += columns.T @ (raw.of(theirs) * feature_weights(weights, theirs.rows)) @ columns
            slope += pull[places] @ columns
            shared += cross[:, places] @ columns
        taken = self.inverse @ shared
        curvature -= shared.T @ taken
        slope -= taken.T @ self.gradient
        zero = np.zeros(len(gains))
        low, high = np.array([g.low for g in gains]), np.array([g.high for g in gains])
        step = bounded_step(zero, slope, curvature, low, high)
        return float(-2 * slope @ step - step @ curvature @ step)


def _picks(features: list[Feature], names: list[str]) -> Array:
    """1 where a feature is multiplied by a gain, shape (features, gains)."""
    return np.array([[float(f.parameter == name) for name in names] for f in features])

"""What one more run would tell, before it is taken: two models' predictions of it, and what sets them apart.

Predicted separation: if one effect were true, what would the other leave unexplained in the new run, wherever
its unknowns go, given what the old runs say of them? What the two predictions differ by, less what the other
can take up at a price that the old runs set, is whitened (Hunter and Reiner, "Designs for discriminating
between two rival models", 1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.diagnosis.columns import layout_of
from fingerlab.diagnosis.features import TORQUE_ZERO, Layout
from fingerlab.diagnosis.groups import Group, Reduced, kind_of
from fingerlab.diagnosis.missing_noise import torque_noise
from fingerlab.diagnosis.model import CABLE_NAMES, Choice, Model, build
from fingerlab.diagnosis.narrowing import narrow_columns
from fingerlab.diagnosis.numerics import scaled_inverse
from fingerlab.diagnosis.repeatability import LEAST_TORQUE_SPREAD
from fingerlab.diagnosis.run_to_run import own_to_a_run
from fingerlab.diagnosis.study import Study
from fingerlab.diagnosis.sums import Sums
from fingerlab.diagnosis.trial import Trial
from fingerlab.diagnosis.weighing import feature_weights
from fingerlab.effects.base import Effect, Row
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array, Session

WEAKEST_PRIOR = 1e-4
"""Weight of the prior, in the new run alone, of what nothing is known of: arms, offsets, gains of effects."""


@dataclass(frozen=True)
class Imagined:
    """A run that was not taken: its motion, and the sums over the signals that it would give."""

    motion: Motion
    layout: Layout
    sums: Sums
    group: Group

    def lasting(self, times: float) -> Imagined:
        """The same motion so many times as long, again and again: it tells so many times as much."""
        longer = Sums(self.sums.products * times, taut_samples=round(self.sums.taut_samples * times))
        return replace(self, sums=longer)


def imagine(
    session: Session, motion: Motion, effects: Sequence[Effect], beside_finger: bool = False
) -> Imagined:
    """A run with this motion; ``beside_finger``: if it is of the motor alone, beside a finger's runs."""
    layout = layout_of(motion, session, effects, beside_finger)
    low = narrow_columns(motion, effects, layout.signals)
    # A trace of friction may hold a standing finger anywhere: what is seen at rest decides little.
    columns = low.columns[~low.rest]
    return Imagined(motion, layout, Sums(columns.T @ columns, taut_samples=len(columns)), _group(motion))


@dataclass(frozen=True)
class Apart:
    """How far apart two models are in a run, as the second would come to explain it; in twice log density.

    ``left`` is what it would leave unexplained of the first's prediction or would have to pay for with the
    unknowns of the old runs; ``zero`` what it would pay for another zero of the current.
    """

    left: float
    zero: float


def separation(study: Study, run: Imagined, truth: Trial, rival: Trial, heat: float) -> float:
    """Expected gain in log evidence of ``truth`` over ``rival`` from one more run, at a temperature."""
    found = apart(study, run, truth, rival, heat)
    return 0.5 * (found.left + found.zero)


def apart(study: Study, run: Imagined, truth: Trial, rival: Trial, heat: float) -> Apart:
    """What ``rival`` would leave of one more run if ``truth`` were true, over the temperature."""
    right = build(run.layout, [run.group], _choices(truth, run), truth.model.tip_law)
    wrong = build(run.layout, [run.group], _choices(rival, run), rival.model.tip_law)
    values = values_in(wrong, rival)
    told, slopes = wrong.coefficients(values, run.group)
    wander = own_to_a_run(wrong, values, told, run.group)
    slopes = np.concatenate((slopes, wander), axis=1)
    every = np.union1d(right.active, wrong.active)
    gap, reach = np.zeros(len(every)), np.zeros((len(every), slopes.shape[1]))
    gap[np.searchsorted(every, right.active)] = right.features(values_in(right, truth), run.group)
    gap[np.searchsorted(every, wrong.active)] -= told
    reach[np.searchsorted(every, wrong.active)] = slopes
    pick = run.layout.every[every]
    share = EFFECTIVE_SHARE / heat
    products = run.sums.of(pick) * feature_weights(_weights(study, run), pick.rows) * share
    pull = gap @ products @ reach
    system = reach.T @ products @ reach
    old = len(wrong.unknowns)
    system[:old, :old] += known_of(wrong, rival, heat)
    system[old:, old:] += np.eye(wander.shape[1])
    scale = 1.0 / np.sqrt(np.maximum(np.diag(system), 1e-300))
    moved = scale * np.linalg.solve(system * np.outer(scale, scale) + 1e-9 * np.eye(len(scale)), pull * scale)
    zero = 0.0
    if TORQUE_ZERO in wrong.index and TORQUE_ZERO not in rival.model.index:
        place = wrong.index[TORQUE_ZERO]
        zero = float(moved[place] / wrong.spread[place]) ** 2
    return Apart(max(float(gap @ products @ gap - pull @ moved) - zero, 0.0), zero)


def held_by(trials: Sequence[Trial], motion: Motion) -> list[Effect]:
    """Effects of all the models, each once, that act in such a run."""
    every = {c.effect.id: c.effect for t in trials for c in t.model.choices}
    return [e for e in every.values() if e.bench or e.bench_beside_finger or motion.finger is not None]


def _choices(trial: Trial, run: Imagined) -> list[Choice]:
    return [c for c in trial.model.choices if c.effect in run.layout.effects]


def _group(motion: Motion) -> Group:
    return Group(
        (CABLE_NAMES[motion.cable_sign], kind_of(motion.phase)), motion.cable_sign, [], np.zeros((0, 0))
    )


def _weights(study: Study, run: Imagined) -> Array:
    """Weights of the group that the run would belong to, or of the most similar one there is."""
    key = run.group.key
    if run.group.on_bench and key not in study.weights:
        return _bench_weights(study.reduced)
    same_kind = [w for k, w in study.weights.items() if k[1] == key[1]]
    return study.weights.get(key, (same_kind or list(study.weights.values()))[0])


def _bench_weights(reduced: Reduced) -> Array:
    """Weights of a motor alone, of which a finger's runs tell how noisy its torque is, (5, 5)."""
    weights = np.zeros((5, 5))
    weights[Row.BENCH, Row.BENCH] = 1.0 / max(torque_noise(reduced), LEAST_TORQUE_SPREAD**2)
    return weights


def values_in(model: Model, trial: Trial) -> Array:
    """The trial's values for a model of another run; what it does not know starts at nothing."""
    known = dict(zip((u.key for u in trial.model.unknowns), trial.fit.values, strict=True))
    return np.array([known.get(u.key, start) for u, start in zip(model.unknowns, model.start(), strict=True)])


def known_of(model: Model, trial: Trial, heat: float) -> Array:
    """What the old runs say of the rival's unknowns, (p, p); of those that they do not have, their range."""
    old = {u.key: i for i, u in enumerate(trial.model.unknowns)}
    size = len(model.unknowns)
    result = np.zeros((size, size))
    places = [(i, old[u.key]) for i, u in enumerate(model.unknowns) if u.key in old]
    mine, theirs = [p[0] for p in places], [p[1] for p in places]
    # Unknowns of the old runs that the new one lacks are integrated out, not held.
    if mine:
        covariance = trial.fit.covariance[np.ix_(theirs, theirs)] * heat
        result[np.ix_(mine, mine)] = scaled_inverse(covariance)
    for i, unknown in enumerate(model.unknowns):
        if unknown.key not in old:
            result[i, i] = (WEAKEST_PRIOR if unknown.open else 1.0) / unknown.gain.typical**2
    return result

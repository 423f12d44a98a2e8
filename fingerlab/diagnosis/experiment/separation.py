"""How far apart models are in a run that was not taken, and what past proposals brought.

Predicted separation: if one effect were true, what would the other leave unexplained in the new run, wherever
its unknowns go, given what the old runs say of them? What the two predictions differ by, less what the other
can take up at a price that the old runs set, is whitened (Hunter and Reiner, "Designs for discriminating
between two rival models", 1965). What a run's phase and cable decide is found once for all runs of the kind.

A predicted gain rests on models none of which is quite the bench's, and on a motion that nobody has seen.
What past proposals brought is therefore set against what was predicted of them: a line between the two, and
how far they scatter about it, for effects among each other and for an effect against nothing. The table is
``resources/gain_calibration.json``, which ``python -m tests.hidden.sweep.gains`` makes. What a gain does to
the probabilities and the set, the calibration itself says: it is asked with the odds that a run would leave.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib.resources import files

import numpy as np

from fingerlab.core.plain_data import structured
from fingerlab.diagnosis.equations.columns import layout_of
from fingerlab.diagnosis.equations.features import FeatureSet, Layout
from fingerlab.diagnosis.equations.model import Model, build
from fingerlab.diagnosis.equations.parameters import TORQUE_ZERO
from fingerlab.diagnosis.fit.bounded_step import scaled_inverse
from fingerlab.diagnosis.fit.data import Weights, random_effect_columns
from fingerlab.diagnosis.fit.noise import torque_noise
from fingerlab.diagnosis.gram.decimation import Decimated, decimated_columns
from fingerlab.diagnosis.gram.run_sums import difference_alone, in_common
from fingerlab.diagnosis.gram.sums import Group, Reduced, Sums, feature_weights
from fingerlab.diagnosis.score.calibration import (
    CalibrationTable,
    Odds,
    Verdict,
    answer_distances,
    calibration,
)
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import (
    LEAST_PROBABILITY,
    LEAST_TORQUE_SPREAD,
    MOST_UNDETECTED,
    SEEN_LOG_ODDS,
    WEAKEST_PRIOR,
)
from fingerlab.diagnosis.signals.conditions import kind_of
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Effect, Row
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import CABLE_NAMES, Array, Session


@dataclass(frozen=True)
class RunKind:
    """What the predicted runs of one phase on one cable share: all that their sums do not tell."""

    layout: Layout
    group: Group
    _models: dict[tuple[object, ...], Model] = field(default_factory=dict, repr=False)
    _contrasts: dict[tuple[object, ...], Contrast] = field(default_factory=dict, repr=False)

    def model(self, fitted: FittedModel) -> Model:
        """The model for such a run alone, with those of its effects that act in it."""
        choices = [c for c in fitted.choices if c.effect in self.layout.effects]
        key = (fitted.model.tip_law, *((c.effect.id, c.shape) for c in choices))
        if key not in self._models:
            self._models[key] = build(self.layout, [self.group], choices, fitted.model.tip_law)
        return self._models[key].fixing(fitted.model.fixed)

    def contrast(self, truth: FittedModel, rival: FittedModel, temperature: float) -> Contrast:
        """What two models predict of such a run; each pair is asked for every run and length."""
        key = (*_fit_key(truth), *_fit_key(rival), temperature)
        if key not in self._contrasts:
            self._contrasts[key] = _contrast(self, truth, rival, temperature)
        return self._contrasts[key]


def _fit_key(fitted: FittedModel) -> tuple[object, ...]:
    """What tells fits to the same sessions apart."""
    choices = tuple((c.effect.id, c.shape) for c in fitted.choices)
    return fitted.model.tip_law, choices, fitted.fit.values.tobytes(), fitted.fit.information.tobytes()


def run_kind(
    session: Session,
    motion: Motion,
    effects: Sequence[Effect],
    beside_finger: bool = False,
    nuisances: Mapping[str, Parameter] | None = None,
) -> RunKind:
    """The kind of a run with this motion.

    ``beside_finger``: of the motor alone, beside a finger's runs. ``nuisances``: as what was recorded has
    them, which may tell how fast the machine turns or that no tip slides; None: by the rig alone.
    """
    layout = layout_of(motion.head(), session, effects, beside_finger)
    if nuisances is not None:
        layout = replace(layout, nuisances=dict(nuisances))
    return RunKind(layout, _group(motion))


@dataclass(frozen=True)
class PredictedRun:
    """A run that was not taken: the sums over the signals that it would give."""

    kind: RunKind
    sums: Sums
    paired: PredictedRun | None = None
    """For a run with a known change of the machine, its difference from the same motion before."""

    def lasting(self, times: float) -> PredictedRun:
        """The same motion so many times as long, again and again: it tells so many times as much."""
        longer = Sums(self.sums.products * times, taut_samples=round(self.sums.taut_samples * times))
        paired = None if self.paired is None else self.paired.lasting(times)
        return replace(self, sums=longer, paired=paired)


def columns_of_run(motion: Motion, kind: RunKind) -> Decimated:
    """The columns of a run with this motion, which is of the ``kind``."""
    return decimated_columns(motion, kind.layout.effects, kind.layout.signals)


def predict_run(motion: Motion, kind: RunKind, before: Decimated | None = None) -> PredictedRun:
    """A run with this motion, which is of the ``kind``; ``before``: columns without its known change."""
    low = columns_of_run(motion, kind)
    # A trace of friction may hold a standing finger anywhere: what is seen at rest decides little.
    columns = low.columns[~low.rest]
    paired = None
    if before is not None:
        common = in_common(before, low)
        paired = None if common is None else PredictedRun(kind, difference_alone(*common))
    return PredictedRun(kind, Sums(columns.T @ columns, taut_samples=len(columns)), paired)


@dataclass(frozen=True)
class Contrast:
    """What two models predict of a run, as far as its kind tells, over k features.

    Attributes:
        pick: the features of either model.
        gap: by how much their coefficients differ, (k,).
        reach: how the rival's change with its p unknowns and with what is the run's own, (k, p + parts).
        known: what the old runs say of those, as inverse covariance, (p + parts, p + parts).
        zero: place and spread (N m) of a zero of the current that the old runs lack; None: no such.
    """

    pick: FeatureSet
    gap: Array
    reach: Array
    known: Array
    zero: tuple[int, float] | None


def _contrast(kind: RunKind, truth: FittedModel, rival: FittedModel, temperature: float) -> Contrast:
    right, wrong = kind.model(truth), kind.model(rival)
    values = values_in(wrong, rival)
    coefficients, slopes = wrong.coefficients(values, kind.group)
    wander = random_effect_columns(wrong, values, coefficients, kind.group)
    slopes = np.concatenate((slopes, wander), axis=1)
    every = np.union1d(right.active, wrong.active)
    gap, reach = np.zeros(len(every)), np.zeros((len(every), slopes.shape[1]))
    gap[np.searchsorted(every, right.active)] = right.features(values_in(right, truth), kind.group)
    gap[np.searchsorted(every, wrong.active)] -= coefficients
    reach[np.searchsorted(every, wrong.active)] = slopes
    old, size = len(wrong.unknowns), slopes.shape[1]
    known = np.zeros((size, size))
    known[:old, :old] = known_of(wrong, rival, temperature)
    known[old:, old:] = np.eye(size - old)
    zero = None
    if TORQUE_ZERO in wrong.index and TORQUE_ZERO not in rival.model.index:
        place = wrong.index[TORQUE_ZERO]
        zero = place, float(wrong.spread[place])
    return Contrast(kind.layout.every[every], gap, reach, known, zero)


@dataclass(frozen=True)
class Apart:
    """How far apart two models are in a run, as the second would come to explain it; in twice log density.

    ``left`` is what it would leave unexplained of the first's prediction or would have to pay for with the
    unknowns of the old runs; ``zero`` what it would pay for another zero of the current.
    """

    left: float
    zero: float


def separation(
    reduced: Reduced, run: PredictedRun, truth: FittedModel, rival: FittedModel, temperature: float
) -> float:
    """Expected gain in log evidence of ``truth`` over ``rival`` from one more run, at a temperature."""
    found = apart(reduced, run, truth, rival, temperature)
    return 0.5 * (found.left + found.zero)


def apart(
    reduced: Reduced, run: PredictedRun, truth: FittedModel, rival: FittedModel, temperature: float
) -> Apart:
    """What ``rival`` would leave of one more run if ``truth`` were true, over the temperature.

    Both are seen under the weights of ``truth``.
    """
    two = run.kind.contrast(truth, rival, temperature)
    gap, reach = two.gap, two.reach
    share = EFFECTIVE_SHARE / temperature
    products = (
        run.sums.of(two.pick)
        * feature_weights(_weights(reduced, truth.weights, run.kind.group), two.pick.rows)
        * share
    )
    pull = gap @ products @ reach
    system = reach.T @ products @ reach + two.known
    scale = 1.0 / np.sqrt(np.maximum(np.diag(system), 1e-300))
    moved = scale * np.linalg.solve(system * np.outer(scale, scale) + 1e-9 * np.eye(len(scale)), pull * scale)
    zero = 0.0
    if two.zero is not None:
        place, spread = two.zero
        zero = float(moved[place] / spread) ** 2
    return Apart(max(float(gap @ products @ gap - pull @ moved) - zero, 0.0), zero)


def effects_in(candidates: Sequence[FittedModel], motion: Motion) -> list[Effect]:
    """Effects of all the models, each once, that act in such a run."""
    every = {c.effect.id: c.effect for t in candidates for c in t.choices}
    return [e for e in every.values() if e.bench or motion.finger is not None]


def _group(motion: Motion) -> Group:
    return Group(
        (CABLE_NAMES[motion.cable_sign], kind_of(motion.phase)), motion.cable_sign, [], np.zeros((0, 0))
    )


def _weights(reduced: Reduced, weights: Weights, group: Group) -> Array:
    """Weights of the ``group`` that a run would belong to, or of the most similar one there is."""
    key = group.key
    if group.on_bench and key not in weights:
        return _bench_weights(reduced)
    same_kind = [w for k, w in weights.items() if k[1] == key[1]]
    return weights.get(key, (same_kind or list(weights.values()))[0])


def _bench_weights(reduced: Reduced) -> Array:
    """Weights of a motor alone, of which a finger's runs tell how noisy its torque is, (5, 5)."""
    weights = np.zeros((5, 5))
    weights[Row.BENCH, Row.BENCH] = 1.0 / max(torque_noise(reduced), LEAST_TORQUE_SPREAD**2)
    return weights


def values_in(model: Model, fitted: FittedModel) -> Array:
    """The model's values for a model of another run; what it does not know starts at nothing."""
    known = fitted.values
    return np.array([known.get(u.key, start) for u, start in zip(model.unknowns, model.start(), strict=True)])


def known_of(model: Model, fitted: FittedModel, temperature: float) -> Array:
    """What the old runs say of the rival's unknowns, (p, p); of those that they do not have, their range."""
    old = {u.key: i for i, u in enumerate(fitted.model.unknowns)}
    size = len(model.unknowns)
    result = np.zeros((size, size))
    places = [(i, old[u.key]) for i, u in enumerate(model.unknowns) if u.key in old]
    mine, theirs = [p[0] for p in places], [p[1] for p in places]
    # Unknowns of the old runs that the new one lacks are integrated out, not held.
    if mine:
        covariance = fitted.fit.covariance[np.ix_(theirs, theirs)] * temperature
        result[np.ix_(mine, mine)] = scaled_inverse(covariance)
    for i, unknown in enumerate(model.unknowns):
        if unknown.key not in old:
            result[i, i] = (WEAKEST_PRIOR if unknown.open else 1.0) / unknown.parameter.typical**2
    return result


SessionFeatures = tuple[Mapping[str, float], str]
"""What ``score.calibration.session_features`` says of sessions."""


@dataclass(frozen=True)
class GainLine:
    """What came of predicted gains, over ``trials`` of them: asinh(gain) = offset + slope asinh(predicted).

    In nats; nearly the gain itself where it is small, and its logarithm where it is large. ``spread`` is the
    scatter about the line, one standard deviation. Where the line ``fades``, offset and scatter go to zero
    with the predicted gain: a run that tells two effects nothing apart brings nothing, by chance neither.
    """

    offset: float
    slope: float
    spread: float
    trials: int
    fades: bool = False

    def gain(self, predicted: Array | float, away: Array | float = 0.0) -> Array:
        """The gain that comes of a predicted one, so many standard deviations ``away`` from the line."""
        off = self.offset + self.spread * np.asarray(away)
        return np.asarray(np.sinh(self.share(predicted) * off + self.slope * np.arcsinh(predicted)))

    def share(self, predicted: Array | float) -> Array:
        """Of offset and scatter that such a predicted gain has."""
        size = np.abs(predicted)
        return np.asarray(size / np.hypot(1.0, size) if self.fades else np.ones_like(size, dtype=float))


@dataclass(frozen=True)
class GainCalibration:
    """What was learned from past proposals.

    Attributes:
        version: of the table. fitted: proposals that it was fitted to. population: what they are, in words.
        among: gain in the log odds of a true effect against another. bench: the same of a run of the motor
            alone, where what constants may be counts, too. shows: what a run says of an effect that could not
            be seen, where ``DECIDING_LOG_ODDS`` changes the verdict.
    """

    version: str
    fitted: int
    population: str
    among: GainLine
    bench: GainLine
    shows: GainLine

    def line(self, on_bench: bool) -> GainLine:
        """What comes of gains among effects in a run of the motor alone, or of a finger."""
        return self.bench if on_bench else self.among


@cache
def gain_calibration() -> GainCalibration:
    """The table that comes with the program."""
    text = files("fingerlab.resources").joinpath("gain_calibration.json").read_text(encoding="utf-8")
    return structured(GainCalibration, json.loads(text))


@dataclass(frozen=True)
class Outlook:
    """The answer that a diagnosis would give if its odds were others.

    Attributes:
        odds: as they are. left: error that the path leaves, in floors. widening: see ``score.calibration``.
    """

    odds: Odds
    left: float
    widening: float
    table: CalibrationTable

    @cached_property
    def _limits(self) -> Array:
        """Log odds down to which each answer is in the set of a missing effect, (answers,)."""
        return np.array([self.table.threshold(Verdict.MISSING_EFFECT, name) for name in self.odds.answers])

    def probabilities(self, odds: Odds | None = None) -> Array:
        """Of every answer, (answers,); ``odds``: None for those as they are."""
        return self.table.map.probabilities(odds or self.odds, self.left, self.widening)

    def found_set(self, probabilities: Array) -> list[int]:
        """Indices of the effects in the set where one is found, by the ``probabilities`` (answers,)."""
        count = len(self.odds.effects)
        kept = np.flatnonzero(answer_distances(probabilities) <= self._limits)
        effects = [int(i) for i in kept if i < count]
        return effects or [int(np.argmax(probabilities[:count]))]

    def with_gains(self, true: int, gains: Array) -> Odds:
        """The odds of a found effect when the true one has gained so much on each other, (effects,)."""
        found = self.odds.found
        logs = np.log(np.maximum(found, LEAST_PROBABILITY**3)) - gains
        logs[true] += gains[true]
        weights = np.exp(logs - logs.max())
        shares = float(found.sum()) * weights / weights.sum()
        return Odds(self.odds.effects, shares, self.odds.hidden, self.odds.nothing, self.odds.unknown)

    def when_found(self, true: int, gains: Array) -> Odds:
        """The odds when an effect that could not be seen was.

        ``gains`` are its log odds against each other effect, (effects,).
        """
        logs = -np.asarray(gains, dtype=float)
        logs[true] = 0.0
        weights = np.exp(logs)
        shares = (1.0 - self.odds.unknown) * weights / weights.sum()
        nothing, hidden = float(np.exp(-SEEN_LOG_ODDS)), np.zeros(len(weights))
        hidden[true] = nothing * MOST_UNDETECTED / (1.0 - MOST_UNDETECTED)  # none speaks more for itself
        return Odds(self.odds.effects, shares, hidden, nothing, self.odds.unknown)


def outlook(evidence: Evidence, usual: SessionFeatures) -> Outlook:
    """As it stands; a run tells effects apart whether one is missing or stands in place of a given one."""
    table = calibration()
    odds = replace(evidence.odds, found=evidence.probabilities, instead=None)
    return Outlook(odds, usual[0].get("left", 1.0), table.widening(*usual)[0], table)

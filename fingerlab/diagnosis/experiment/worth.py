"""What a run would bring: gains in the log odds of an effect that may be true, and the set they would leave.

They are counted in the log odds that the diagnosis itself would give after the run: for the effects of a set
among each other, or for an effect that could not be seen against nothing. Past proposals say what comes of
that, and the calibration which set it would make.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.diagnosis.experiment.separation import (
    GainLine,
    Outlook,
    PredictedRun,
    apart,
    gain_calibration,
    separation,
)
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel, condition_weights, values_if_there
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import (
    log_odds_of_misfits,
    misfit_of_log_odds,
    penalty_of_small_excess,
)
from fingerlab.diagnosis.settings import (
    COST_OF_CHANGE,
    DECIDING_LOG_ODDS,
    DECISIVE,
    FIRST_WORTH,
    GAIN_DRAWS,
    LEAST_EXCESS,
    LEAST_FALL,
    LEAST_PROBABILITY,
    LEAST_SEPARATION,
    LOOKING_ITERATIONS,
    MOST_PAIRED,
    TRUE_EFFECTS,
    WORTH_STEPS,
)
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Judged:
    """What a run would bring.

    Attributes:
        worth: by which runs are compared. least: nats for the effect that it tells least of.
        separates: ids of the answers for which it is said, with the gain ``expected`` in log odds.
        alone: chance that the true effect stays alone in the set.
        gains: as of :class:`Predicted`. each: the gain expected if an effect is true, by its id.
    """

    worth: tuple[float, ...]
    least: float
    separates: tuple[str, ...] = ()
    expected: float = 0.0
    alone: float = 0.0
    gains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    each: Mapping[str, float] = field(default_factory=dict)


def _chances(scatter: int) -> Array:
    """Standard deviations by which gains come out otherwise than predicted, (draws, scatter), for all."""
    return np.asarray(np.random.default_rng(1).standard_normal((GAIN_DRAWS, scatter)))


def _worth(run: PredictedRun, alone: float, first: float, gains: Iterable[float]) -> tuple[float, ...]:
    """What a run is worth; of two that are as good to a twentieth, the one that separates more."""
    cost = 0.0 if run.paired is None else COST_OF_CHANGE
    worth = alone + FIRST_WORTH * first - cost
    return round(WORTH_STEPS * worth) / WORTH_STEPS, sum(min(gain, DECISIVE) for gain in gains)


class Among:
    """Effects of which one is missing, and what runs would say of which it is."""

    verdict = Verdict.MISSING_EFFECT

    def __init__(self, scorer: Scorer, evidence: Evidence, chosen: list[int], now: Outlook) -> None:
        self.scorer, self.evidence, self.chosen, self.outlook = scorer, evidence, chosen, now
        probabilities = now.probabilities()
        likely = probabilities[chosen[:TRUE_EFFECTS]]
        likely /= max(float(likely.sum()), LEAST_PROBABILITY)
        self.truths = dict(zip(chosen[:TRUE_EFFECTS], likely.tolist(), strict=True))
        self._log_probabilities = np.log(np.maximum(probabilities, LEAST_PROBABILITY))
        standing = now.found_set(probabilities)
        self.standing = [i for i in chosen[1:] if i in standing]
        self.alone_now = sum(share for i, share in self.truths.items() if standing == [i])

    def predicted(self, run: PredictedRun) -> dict[int, Array]:
        """Gain of each effect that may be true on each other, before any correction, (effects,)."""
        found = {}
        for true in self.truths:
            gains = np.zeros(len(self.evidence.candidates))
            for other in self.chosen:
                if other != true:
                    gains[other] = _gain(self.scorer, run, self.evidence, true, other)
            found[true] = gains
        return found

    def glanced(self, run: PredictedRun) -> tuple[float, ...]:
        """What the run brings if its gains come out as predicted."""
        line, alone, first = gain_calibration().line(run.kind.group.on_bench), 0.0, 0.0
        predicted = self.predicted(run)
        for true, gains in predicted.items():
            probabilities = self.outlook.probabilities(
                self.outlook.with_gains(true, self._corrected(line, gains))
            )
            alone += self.truths[true] * (self.outlook.found_set(probabilities) == [true])
            first += self.truths[true] * (int(np.argmax(probabilities)) == true)
        least = predicted[self.chosen[0]]
        return _worth(run, alone, first, [float(least[i]) for i in self.chosen[1:]])

    def judged(self, run: PredictedRun) -> Judged:
        """The same with what gains scatter by."""
        now, predicted = self.outlook, self.predicted(run)
        line = gain_calibration().line(run.kind.group.on_bench)
        head, *rivals = self.chosen
        away = _chances(len(self.evidence.candidates))
        alone = first = 0.0
        moved = {}
        for true, gains in predicted.items():
            probabilities = [
                now.probabilities(now.with_gains(true, self._corrected(line, gains, e))) for e in away
            ]
            alone += self.truths[true] * float(np.mean([now.found_set(p) == [true] for p in probabilities]))
            first += self.truths[true] * float(np.mean([int(np.argmax(p)) == true for p in probabilities]))
            moved[true] = np.log(np.maximum(probabilities, LEAST_PROBABILITY)) - self._log_probabilities
        worst = min(self.standing or rivals[:1], key=lambda i: self._mean_gain(predicted, head, i))
        each = {}
        for true in moved:
            rival = worst if true == head else head
            each[true] = float(np.median(moved[true][:, true] - moved[true][:, rival]))
        pair = [i for i in (head, worst) if i in each]
        shares = np.array([self.truths[i] for i in pair])
        least = min(float(line.gain(self._mean_gain(predicted, head, i))) for i in rivals)
        return Judged(
            _worth(run, alone, first, [self._mean_gain(predicted, head, i) for i in rivals]), least,
            (self._id(head), self._id(worst)), float(shares @ [each[i] for i in pair] / shares.sum()), alone,
            {self._id(t): self._predicted_gains(t, gains) for t, gains in predicted.items()},
            {self._id(i): gain for i, gain in each.items()},
        )  # fmt: skip

    def _predicted_gains(self, true: int, gains: Array) -> dict[str, float]:
        """Predicted gains on the other effects, by id."""
        return {self._id(i): float(gains[i]) for i in self.chosen if i != true}

    def _corrected(self, line: GainLine, gains: Array, away: Array | float = 0.0) -> Array:
        """Gains as past ones came out; an effect that was not looked at gains nothing and loses nothing."""
        return np.where(gains != 0.0, line.gain(gains, away), 0.0)

    def _mean_gain(self, predicted: Mapping[int, Array], first: int, second: int) -> float:
        """Gain in the log odds of the one of two effects that is true, as likely as they are now."""
        ways = [(i, j) for i, j in ((first, second), (second, first)) if i in predicted]
        shares = np.array([self.truths[i] for i, _ in ways])
        gains = np.array([predicted[i][j] for i, j in ways])
        return float(shares @ gains / max(float(shares.sum()), LEAST_PROBABILITY))

    def _id(self, i: int) -> str:
        return self.evidence.candidates[i].last_effect.id


class Hidden:
    """Effects that could be there unseen, and what runs would say of them."""

    verdict = Verdict.NOTHING_MISSING

    def __init__(
        self, scorer: Scorer, evidence: Evidence, able: list[int], hidden: list[int], now: Outlook
    ) -> None:
        """``able``: those of the ``hidden`` effects that any run could show."""
        self.scorer, self.evidence, self.able, self.hidden, self.outlook = scorer, evidence, able, hidden, now
        self.pairs = [_present_and_absent(scorer, evidence.base, evidence.candidates[i]) for i in able]
        probabilities = now.probabilities()
        self._log_probabilities = np.log(np.maximum(probabilities, LEAST_PROBABILITY))
        likely = probabilities[able]
        self.shares = likely / max(float(likely.sum()), LEAST_PROBABILITY)

    def _detections(self, run: PredictedRun) -> list[float]:
        return [_detection(self.scorer, run, self.evidence, *pair) for pair in self.pairs]

    def glanced(self, run: PredictedRun) -> tuple[float, ...]:
        """How many of the effects would show."""
        return self._shown(self._detections(run))

    def _shown(self, detections: Sequence[float]) -> tuple[float, ...]:
        """How many effects show with these detections."""
        return (sum(s * min(g, DECISIVE) for s, g in zip(self.shares, detections, strict=True)),)

    def judged(self, run: PredictedRun) -> Judged:
        """Whether an effect that is there would be shown, and alone."""
        found, table, now = self._detections(run), gain_calibration(), self.outlook
        away, count = _chances(len(self.evidence.candidates) + 1), len(self.evidence.candidates)
        shown = np.array([[table.shows.gain(g, e[-1]) >= DECIDING_LOG_ODDS for g in found] for e in away])
        alone = first = 0.0
        gains, expected = dict[str, dict[str, float]](), dict[str, float]()
        for k, true in enumerate(self.able):
            predicted = self._gains(run, k)
            moved = []
            for e, seen in zip(away, shown, strict=True):
                if not seen[k]:
                    blind = {i for i, other in zip(self.able, seen, strict=True) if not other}
                    alone += (
                        self.shares[k] / len(away) * (blind | set(self.hidden) - set(self.able) == {true})
                    )
                    moved.append(0.0)
                    continue
                among = np.where(
                    predicted != 0.0, table.line(run.kind.group.on_bench).gain(predicted, e[:-1]), DECISIVE
                )
                probabilities = now.probabilities(now.when_found(true, among))
                change = np.log(np.maximum(probabilities, LEAST_PROBABILITY)) - self._log_probabilities
                moved.append(float(change[true] - change[count]))
                alone += self.shares[k] / len(away) * (now.found_set(probabilities) == [true])
                first += self.shares[k] / len(away) * (int(np.argmax(probabilities)) == true)
            name = self._id(true)
            gains[name] = {self._id(i): float(predicted[i]) for i in self.able if i != true}
            gains[name][Verdict.NOTHING_MISSING] = found[k]
            expected[name] = float(np.median(moved))
        likeliest = next((name for name, gain in expected.items() if gain > LEAST_SEPARATION), None)
        worth = _worth(run, float(alone), float(first), self._shown(found))
        separates = (likeliest, Verdict.NOTHING_MISSING) if likeliest else ()
        least = min(g for g in found)
        return Judged(
            worth, least, separates, expected.get(likeliest or "", 0.0), float(alone), gains, expected
        )

    def _gains(self, run: PredictedRun, k: int) -> Array:
        """Gain of the k-th effect on each other that could be taken for it, (effects,)."""
        base, gains = self.evidence.base, np.zeros(len(self.evidence.candidates))
        values, usual = _values(run), base.misfit / base.count
        right = _after(base, run, usual, usual * values)
        for i in self.able:
            if i == self.able[k]:
                continue
            left = apart(self.scorer.reduced, run, self.pairs[k][0], self.evidence.candidates[i], 1.0).left
            wrong = _after(base, run, usual, usual * values + left)
            odds = log_odds_of_misfits(np.array([right, wrong]))
            paired = _paired_gain(self.scorer, run, self.pairs[k][0], self.evidence.candidates[i])
            gains[i] = max(float(odds[0] - odds[1]) + paired, LEAST_PROBABILITY)  # 0: not looked at
        return gains

    def _id(self, i: int) -> str:
        return self.evidence.candidates[i].last_effect.id


def _present_and_absent(
    scorer: Scorer, base: FittedModel, fitted: FittedModel
) -> tuple[FittedModel, FittedModel]:
    """The model if its last effect were there and the old runs could not show it; and the one without it."""
    without = scorer.fit_same_law(base.choices, fitted, LOOKING_ITERATIONS)
    present = replace(fitted, fit=replace(fitted.fit, values=values_if_there(fitted)))
    return present, replace(without, misfits=base.misfits)


def _detection(
    scorer: Scorer, run: PredictedRun, evidence: Evidence, truth: FittedModel, without: FittedModel
) -> float:
    """What the run would say of an effect if it were there, where ``DECIDING_LOG_ODDS`` changes the verdict.

    LEAST_FALL in the run's own condition decides.
    """
    gain = separation(scorer.reduced, run, truth, without, 1.0)
    counts = np.append(evidence.base.misfits[:, 1], _values(run))
    needed = LEAST_FALL * float(counts.sum()) / float(condition_weights(counts)[-1])
    return gain * 2.0 * DECIDING_LOG_ODDS / max(needed, 2.0 * DECIDING_LOG_ODDS)


def _values(run: PredictedRun) -> float:
    """Independent values that a run would have."""
    return EFFECTIVE_SHARE * run.kind.group.equations * run.sums.samples


def _after(like: FittedModel, run: PredictedRun, left: float, misfit: float) -> float:
    """What a model leaves of each value with one more run, of which it leaves ``misfit``.

    Now it leaves ``left`` of each, in conditions as ``like`` has them.
    """
    counts = np.append(like.misfits[:, 1], _values(run))
    misfits = np.append(left * like.misfits[:, 1], misfit)
    return float(misfits @ condition_weights(counts) / counts.sum())


def _gain(scorer: Scorer, run: PredictedRun, evidence: Evidence, true: int, other: int) -> float:
    """Gain in the log odds of the true effect: by what its rival leaves, and by the constants it needs."""
    truth, rival = evidence.candidates[true], evidence.candidates[other]
    alone = run.kind.group.on_bench and not any(g.on_bench for g in scorer.reduced.groups)
    found = apart(scorer.reduced, run, _with_offsets(truth) if alone else truth, rival, evidence.temperature)
    odds = evidence.log_odds[[true, other]]
    left = [misfit_of_log_odds(float(one), evidence.least_left) for one in odds - odds.max()]
    usual = _values(run) * left[0]
    after = [
        _after(truth, run, left[0], usual),
        _after(truth, run, left[1], usual + found.left * evidence.temperature),
    ]
    gain = log_odds_of_misfits(np.array(after)) - log_odds_of_misfits(np.array(left))
    total_gain = float(gain[0] - gain[1]) + _paired_gain(scorer, run, truth, rival)
    return total_gain + (0.5 * found.zero + _constants(scorer, truth, rival) if alone else 0.0)


def _paired_gain(scorer: Scorer, run: PredictedRun, truth: FittedModel, rival: FittedModel) -> float:
    """Log odds that the difference of a run with a known change from the one before it brings."""
    if run.paired is None:
        return 0.0
    return min(0.5 * apart(scorer.reduced, run.paired, truth, rival, 1.0).left, MOST_PAIRED)


def _constants(scorer: Scorer, truth: FittedModel, rival: FittedModel) -> float:
    """Log odds that a first run of the motor alone brings by what the constants are known to be then."""
    gain = 0.5 * (scorer.penalty_of_bench_run(rival) - scorer.penalty_of_bench_run(truth))
    if rival.last_effect.offsets and not truth.last_effect.offsets:
        gain += penalty_of_small_excess(rival, scorer.zero_spread) - penalty_of_small_excess(rival)
    return gain + (penalty_of_small_excess(truth) if truth.last_effect.offsets else 0.0)


def _with_offsets(fitted: FittedModel) -> FittedModel:
    """The model with the constants of its last effect, which no run tells, as large as they may well be.

    If the effect is there, they are at least what one would speak of.
    """
    effect, index = fitted.last_effect, fitted.model.index
    values = fitted.fit.values.copy()
    for name in effect.offsets:
        place, under = index[f"{effect.id}.{name}"], index[f"{effect.id}.{effect.excess[name]}"]
        size = np.hypot(values[place], fitted.fit.deviations[place])
        size = np.clip(size, LEAST_EXCESS * values[under], values[under])
        values[place] = np.copysign(size, values[place])
    return replace(fitted, fit=replace(fitted.fit, values=values))

"""The run, of those that the rig can do, that would best separate the effects that these data leave closest.

What a run is expected to bring is counted in the log odds that the diagnosis itself would give after it: for
the effects of a set among each other, or for an effect that could not be seen against nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.diagnosis.experiment.predicted_runs import Proposal, menu
from fingerlab.diagnosis.experiment.separation import (
    PredictedRun,
    RunKind,
    apart,
    held_by,
    predict_run,
    run_kind,
    separation,
)
from fingerlab.diagnosis.score.evidence import Evidence, against_nothing
from fingerlab.diagnosis.score.fitted_model import FittedModel, condition_weights, values_at_typical_strength
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import by_what_is_left, left_for, small_excess
from fingerlab.diagnosis.settings import (
    DECIDING_LOG_ODDS,
    DECISIVE,
    DURATION_S,
    LEAST_EXCESS,
    LEAST_FALL,
    LEAST_PROBABILITY,
    LEAST_SEPARATION,
    LENGTHS_S,
    LOOKING_ITERATIONS,
    RIVALS,
    SETTLING_S,
)
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.sessions.model import Session


def propose(
    sessions: Sequence[Session], scorer: Scorer, evidence: Evidence, chosen: Sequence[int]
) -> dict[str, Any] | None:
    """The proposed run as in ``cli.md``; None where nothing needs to be separated or nothing would.

    The run that takes most of the set away from its first member is proposed; it is said for the rival that
    comes off worst.
    """
    if len(chosen) < 2:
        return None
    first, *rivals = [evidence.candidates[i] for i in chosen[: 1 + RIVALS]]

    def judged(run: PredictedRun) -> Judged:
        gains = [_expected(scorer, run, evidence, chosen[0], i) for i in chosen[1 : 1 + RIVALS]]
        worst = int(np.argmin(gains))
        worth = (sum(min(g, DECISIVE) for g in gains), gains[worst])
        return Judged(worth, gains[worst], rivals[worst].last_effect.id, gains[worst])

    best = best_run(list(_runs(sessions, scorer, first, [first, *rivals])), judged)
    if best is None or best[1].expected < LEAST_SEPARATION:
        return None
    proposal, found = best
    separates = [first.last_effect.id, found.other]
    return proposal.to_json(separates, found.expected, scorer.reduced.layout.scales)


def reveal(
    sessions: Sequence[Session], scorer: Scorer, evidence: Evidence, hidden: Sequence[int]
) -> dict[str, Any] | None:
    """The run that would show most of the effects that these data could not; None where none would.

    What is expected is said for the likeliest effect that the run would show at its typical strength.
    """
    base = evidence.base
    hidden = [i for i in hidden if evidence.candidates[i].sensitivity.strengths][:RIVALS]
    if not hidden:
        return None
    shares = [evidence.undetected[i] for i in hidden]
    pairs = [_present_and_absent(scorer, base, evidence.candidates[i]) for i in hidden]

    def judged(run: PredictedRun) -> Judged:
        gains = [_detection(scorer, run, evidence, i, *pair) for i, pair in zip(hidden, pairs, strict=True)]
        worth = sum(s * min(g.decides, DECISIVE) for s, g in zip(shares, gains, strict=True))
        least = min(g.decides for g in gains)
        shown = next((k for k, gain in enumerate(gains) if gain.decides >= DECIDING_LOG_ODDS), None)
        if shown is None:
            return Judged((worth,), least, "", 0.0)
        return Judged((worth,), least, pairs[shown][0].last_effect.id, gains[shown].expected)

    best = best_run(list(_runs(sessions, scorer, base, [p for p, _ in pairs])), judged)
    if best is None or not best[1].other:
        return None
    proposal, found = best
    separates = [found.other, "nothing_missing"]
    return proposal.to_json(separates, found.expected, scorer.reduced.layout.scales)


@dataclass(frozen=True)
class Judged:
    """What a run would bring.

    Attributes:
        worth: by which runs are compared. least: nats for the effect that it tells least of.
        other: id of the effect for which it is said, with the gain ``expected`` in log odds.
    """

    worth: tuple[float, ...]
    least: float
    other: str
    expected: float


def best_run(
    runs: Sequence[tuple[Proposal, PredictedRun]], judge: Callable[[PredictedRun], Judged]
) -> tuple[Proposal, Judged] | None:
    """The run of the most worth; a longer one only where no shorter one decides everything."""
    best: tuple[Proposal, Judged] | None = None
    for seconds in LENGTHS_S:
        for proposal, run in _lasting(runs, seconds):
            found = judge(run)
            if best is None or found.worth > best[1].worth:
                best = proposal, found
        if best is not None and best[1].least >= DECISIVE:
            break
    return best


def _present_and_absent(
    scorer: Scorer, base: FittedModel, fitted: FittedModel
) -> tuple[FittedModel, FittedModel]:
    """The model if its last effect were there at its typical strength and the rest hid it; and without it."""
    without = scorer.fit_same_law(base.choices, fitted, LOOKING_ITERATIONS)
    known = without.values
    start = np.array([known.get(u.key, 0.0) for u in fitted.model.unknowns])
    absent = replace(without, misfits=base.misfits)
    return replace(fitted, fit=replace(fitted.fit, values=values_at_typical_strength(fitted, start))), absent


@dataclass(frozen=True)
class Detection:
    """What a run would say of an effect that could not be seen, if it were there.

    Attributes:
        decides: on the scale on which ``DECIDING_LOG_ODDS`` is where the verdict changes.
        expected: gain in the log odds against nothing.
    """

    decides: float
    expected: float


def _detection(
    scorer: Scorer, run: PredictedRun, evidence: Evidence, i: int, truth: FittedModel, without: FittedModel
) -> Detection:
    """What the run would bring for candidate ``i``; LEAST_FALL in the run's own condition decides."""
    base = evidence.base
    gain = separation(scorer.reduced, run, truth, without, 1.0)
    values = _values(run)
    counts = np.append(base.misfits[:, 1], values)
    needed = LEAST_FALL * float(counts.sum()) / float(condition_weights(counts)[-1])
    decides = gain * 2.0 * DECIDING_LOG_ODDS / max(needed, 2.0 * DECIDING_LOG_ODDS)
    usual, count = base.misfit / base.count, float(counts.sum())
    left = count * _after(base, run, usual, usual * values)
    misfit = count * _after(base, run, usual, usual * values + 2.0 * gain)
    after = against_nothing(base, misfit, left, count) - np.log(len(evidence.candidates))
    before = np.log(
        max(float(evidence.undetected[i]), LEAST_PROBABILITY) / max(evidence.nothing, LEAST_PROBABILITY)
    )
    return Detection(decides, float(after - before))


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


def _expected(scorer: Scorer, run: PredictedRun, evidence: Evidence, first: int, second: int) -> float:
    """Expected gain in the log odds of the one of two effects that is true, as likely as they are now."""
    shares = evidence.probabilities[[first, second]]
    gains = [_gain(scorer, run, evidence, *ways) for ways in ((first, second), (second, first))]
    return float(shares @ gains / max(float(shares.sum()), LEAST_PROBABILITY))


def _gain(scorer: Scorer, run: PredictedRun, evidence: Evidence, true: int, other: int) -> float:
    """Gain in the log odds of the true effect: by what its rival leaves, and by the constants it needs."""
    truth, rival = evidence.candidates[true], evidence.candidates[other]
    alone = run.kind.group.on_bench and not any(g.on_bench for g in scorer.reduced.groups)
    found = apart(scorer.reduced, run, _with_offsets(truth) if alone else truth, rival, evidence.temperature)
    odds = evidence.log_odds[[true, other]]
    left = [left_for(float(one), evidence.least_left) for one in odds - odds.max()]
    usual = _values(run) * left[0]
    after = [
        _after(truth, run, left[0], usual),
        _after(truth, run, left[1], usual + found.left * evidence.temperature),
    ]
    gain = by_what_is_left(np.array(after)) - by_what_is_left(np.array(left))
    return float(gain[0] - gain[1]) + (0.5 * found.zero + _constants(scorer, truth, rival) if alone else 0.0)


def _constants(scorer: Scorer, truth: FittedModel, rival: FittedModel) -> float:
    """Log odds that a first run of the motor alone brings by what the constants are known to be then."""
    gain = 0.5 * (scorer.penalty_of_bench_run(rival) - scorer.penalty_of_bench_run(truth))
    if rival.last_effect.offsets and not truth.last_effect.offsets:
        gain += small_excess(rival, scorer.zero_spread) - small_excess(rival)
    return gain + (small_excess(truth) if truth.last_effect.offsets else 0.0)


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


def _runs(
    sessions: Sequence[Session], scorer: Scorer, like: FittedModel, candidates: Sequence[FittedModel]
) -> Iterator[tuple[Proposal, PredictedRun]]:
    """Every run of the menu, as the model ``like`` would move, with the columns of all ``candidates``."""
    beside, kinds = not scorer.reduced.on_bench, dict[tuple[str, int], RunKind]()
    for proposal in menu(sessions, scorer.reduced, like.values):
        motion = proposal.motion
        name = motion.phase, motion.cable_sign
        if name not in kinds:
            kinds[name] = run_kind(sessions[0], motion, held_by(candidates, motion), beside)
        yield proposal, predict_run(motion, kinds[name])


def _lasting(
    runs: Sequence[tuple[Proposal, PredictedRun]], seconds: float
) -> Iterator[tuple[Proposal, PredictedRun]]:
    times = (seconds - SETTLING_S) / (DURATION_S - SETTLING_S)
    for proposal, run in runs:
        yield replace(proposal, seconds=seconds), run.lasting(times)

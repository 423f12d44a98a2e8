"""From odds to probabilities that are right as often as they say, learned on a population of benches.

The odds of ``evidence`` rest on models none of which is quite the bench's. Their numbers are therefore set
against trials in which it is known what was missing: a map with few values turns them into probabilities, and
a set holds every answer whose log odds against the best are such as the truth had in 95 % of the trials with
that verdict and an effect of that kind (split conformal sets, Mondrian by verdict and effect or family). The
values stand in ``resources/calibration.json``, which ``python -m tests.hidden.sweep.calibrate`` makes. A
session that is unlike those of the trials is told as such, and its odds are drawn together.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import cache
from importlib.resources import files
from typing import Any, Protocol

import numpy as np

from fingerlab.core.plain_data import structured
from fingerlab.diagnosis.settings import LEAST_ODDS, MOST_LEFT, NEVER_RULED_OUT, UNUSUAL, WIDENING
from fingerlab.effects import find_effect
from fingerlab.sessions.model import Array, Run


class HeldOutError(Protocol):
    """What the model as given leaves of one equation, in the equation's unit."""

    @property
    def rmse(self) -> float: ...
    @property
    def r2(self) -> float: ...
    @property
    def floor(self) -> float: ...


class Verdict(StrEnum):
    """The three answers; the two that are no effect stand in a set beside the ids of effects."""

    NOTHING_MISSING = "nothing_missing"
    MISSING_EFFECT = "missing_effect"
    NOT_IN_CATALOGUE = "not_in_catalogue"


AN_EFFECT = "any effect"
"""The group of all effects, where one of them or its family has too few trials of its own."""


@dataclass(frozen=True)
class Odds:
    """What the evidence says before it is set against trials; all together 1.

    Attributes:
        effects: ids. found: probability of each that it is missing and seen, (effects,).
        hidden: that it is there and could not show, (effects,). nothing, unknown: of the other answers.
        instead: that it stands in place of one of the model as given, (effects,); None: of none.
        ruled_out: effects that leave far more than a law does that is nearly right, beside one that is.
    """

    effects: tuple[str, ...]
    found: Array
    hidden: Array
    nothing: float
    unknown: float
    instead: Array | None = None
    ruled_out: tuple[str, ...] = ()

    @property
    def answers(self) -> tuple[str, ...]:
        """Everything that can be the truth: the effects, and the two answers that are none."""
        return (*self.effects, Verdict.NOTHING_MISSING, Verdict.NOT_IN_CATALOGUE)


@dataclass(frozen=True)
class Predicted:
    """What was predicted of a proposed run before any correction; kept so that it can be learned from.

    ``gains`` in nats: by the id of an effect that may be true, those of its log odds against the others, by
    id; by ``nothing_missing``, what the run says of an effect that could not be seen. ``bench``: it is of the
    motor alone.
    """

    verdict: str
    gains: Mapping[str, Mapping[str, float]]
    bench: bool = False


@dataclass(frozen=True)
class ProbabilityMap:
    """Values of the map from odds to probabilities; log odds are multiplied by a sharpness.

    Attributes:
        verdict: sharpness among "an effect is seen", "none is seen" and "something unknown".
        nothing_offset, unknown_offset: log odds added for "none is seen" and "something unknown".
        uninformative_verdict: log odds that this verdict says nothing, where the floor is reached in the end
            or something unknown is seen; else by ``uninformative_verdict_slope`` more for each unit of the
            logarithm of what is left. ``base_rates`` of the three hold then.
        effect: sharpness among the effects. sharpness_uninformative: the same where the law of the truth is
            far from the bench's; ``uninformative_effect`` and ``uninformative_effect_slope`` are the log odds
            of that, as before.
        hidden: log odds added for an effect that could not show, against nothing.
    """

    verdict: float = 1.0
    nothing_offset: float = 0.0
    unknown_offset: float = 0.0
    uninformative_verdict: float = -5.0
    uninformative_verdict_slope: float = 0.0
    base_rates: tuple[float, ...] = (0.7, 0.2, 0.1)
    effect: float = 1.0
    sharpness_uninformative: float = 0.1
    uninformative_effect: float = -5.0
    uninformative_effect_slope: float = 0.0
    hidden: float = 0.0

    def probabilities(self, odds: Odds, left: float = 1.0, widening: float = 1.0) -> Array:
        """Probability of each of ``odds.answers``.

        What the trials say is of an effect beside a model. Whether one stands in place of a given effect is
        told by the odds of whole models, but for the share of trials in which the law was not the bench's.

        Args:
            left: error that the path leaves, in floors. widening: divides the log odds of verdict and effect.
        """
        more = min(max(math.log(max(left, 1.0)), 0.0), MOST_LEFT)
        # That much is left is no doubt of an answer which says just that.
        strange = odds.unknown > max(odds.nothing, float(odds.found.sum()))
        uninformative_verdict = _share(
            self.uninformative_verdict + self.uninformative_verdict_slope * (0.0 if strange else more)
        )
        uninformative_effect = _share(self.uninformative_effect + self.uninformative_effect_slope * more)
        found, hidden = _logs(odds.found), _logs(odds.hidden)
        nothing = float(_logs(np.array([odds.nothing]))[0])
        seen = float(np.logaddexp.reduce(found, initial=LEAST_ODDS))
        quiet = float(np.logaddexp.reduce(hidden, initial=nothing))
        unknown = float(_logs(np.array([odds.unknown]))[0])
        groups = self.verdict / widening * np.array([seen, quiet, unknown])
        groups += np.array([0.0, self.nothing_offset, self.unknown_offset])
        shares = (1.0 - uninformative_verdict) * _softmax(groups)
        shares += uninformative_verdict * np.array(self.base_rates) / sum(self.base_rates)
        if not len(found):
            total = float(shares[1] + shares[2])
            return np.array([shares[1] / total, shares[2] / total])
        among = (1.0 - uninformative_effect) * _softmax(self.effect / widening * found)
        among += uninformative_effect * _softmax(self.sharpness_uninformative / widening * found)
        unseen = _softmax(np.array([*(hidden + self.hidden), nothing]))
        effects = shares[0] * among + shares[1] * unseen[:-1]
        beside = np.array([*effects, shares[1] * unseen[-1], shares[2]])
        if odds.instead is None:
            return beside
        instead = (1.0 - uninformative_effect) * odds.instead
        beside *= 1.0 - instead.sum()
        beside[: len(instead)] += instead
        return beside


def _logs(values: Array) -> Array:
    return np.log(np.maximum(values, math.exp(LEAST_ODDS)))


def _share(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-log_odds))


def _softmax(logs: Array) -> Array:
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


@dataclass(frozen=True)
class SessionFeature:
    """How a property of sessions lies in the trials: ``middle`` and ``spread`` are of its logarithm.

    The spread is half the width that nine trials in ten have; ``low`` and ``high`` are its ends in ``unit``.
    """

    title: str
    unit: str
    middle: float
    spread: float
    low: float
    high: float


@dataclass(frozen=True)
class CalibrationTable:
    """What was learned from trials.

    Attributes:
        version: of the table. fitted: trials that it was fitted to. judged: others, that judged it.
        population: what the trials are, in words.
        map: from odds to probabilities.
        thresholds: log odds against the best down to which an answer is in the set, by the names of
            :func:`groups_of`.
        features: of a session, by name.
        typicality_quantiles: the largest distance of a feature from its middle, in spreads, which shares of
            the trials lie beyond: so many values, evenly from all to none.
        phase_shares: share of the trials by the phases of their runs.
        error: expected calibration error. coverage: of the sets; both on the trials that judged it.
    """

    version: str
    fitted: int
    judged: int
    population: str
    map: ProbabilityMap
    thresholds: Mapping[str, float]
    features: Mapping[str, SessionFeature]
    typicality_quantiles: tuple[float, ...]
    phase_shares: Mapping[str, float]
    error: float
    coverage: float

    def threshold(self, verdict: str, answer: str) -> float:
        """Log odds against the best (not below 0) down to which an answer is in the set."""
        found = [self.thresholds[name] for name in groups_of(verdict, answer) if name in self.thresholds]
        return max(found[0], 0.0)

    def conformal_set(
        self, verdict: str, answers: Sequence[str], probabilities: Array, ruled_out: Sequence[str] = ()
    ) -> tuple[str, ...]:
        """The answers that cannot be ruled out, likeliest first; the likeliest is always among them.

        Nothing that is told with ``NEVER_RULED_OUT`` is, however seldom the truth lay behind in the trials.

        Args:
            ruled_out: by what they leave, however far behind the truth may lie. An effect that is hard to see
                lay far behind in trials that it hardly showed in, and in no others.
        """
        behind = answer_distances(probabilities)
        order = np.argsort(behind, kind="stable")
        kept = [
            (behind[i] <= self.threshold(verdict, answers[i]) and answers[i] not in ruled_out)
            or probabilities[i] >= NEVER_RULED_OUT
            for i in order
        ]
        return tuple(answers[i] for i, held in zip(order, kept, strict=True) if held)

    def typicality(self, features: Mapping[str, float], kind: str) -> tuple[float, tuple[str, ...]]:
        """Share of the trials that are no more usual than a session, and what is unusual about it, in words.

        Args:
            features: as of :func:`session_features`. kind: the phases of its runs, in order, with blanks.
        """
        far = {
            name: abs(math.log(max(value, 1e-12)) - self.features[name].middle) / self.features[name].spread
            for name, value in features.items()
            if name in self.features
        }
        beyond = np.linspace(1.0, 0.0, len(self.typicality_quantiles))
        share = float(np.interp(max(far.values(), default=0.0), self.typicality_quantiles, beyond))
        limit = float(np.interp(1.0 - UNUSUAL, 1.0 - beyond, self.typicality_quantiles))
        words = [_unusual(self.features[name], features[name]) for name, by in far.items() if by > limit]
        same = self.phase_shares.get(kind, 0.0)
        if self.phase_shares and same < UNUSUAL:
            share = min(share, same)
            phases = " and ".join(PHASES_SAID.get(phase, phase) for phase in kind.split())
            words.insert(0, f"runs {phases} and no others" if phases else "no runs")
        return share, tuple(words)

    def widening(self, features: Mapping[str, float], kind: str) -> tuple[float, float, tuple[str, ...]]:
        """By how much the log odds of a session are drawn together, and what :meth:`typicality` says."""
        share, unusual = self.typicality(features, kind)
        return 1.0 + (WIDENING - 1.0) * min(max(1.0 - share / UNUSUAL, 0.0), 1.0), share, unusual


PHASES_SAID = {
    "motor_bench": "of the motor alone",
    "on_air": "on air",
    "contact": "in contact",
    "free": "of free motion",
}


def _unusual(feature: SessionFeature, value: float) -> str:
    at, low, high = (f"{float(f'{v:.2g}'):g}" for v in (value, feature.low, feature.high))
    unit = f" {feature.unit}" if feature.unit else ""
    return f"{feature.title} {at}{unit} (mostly {low} to {high}{unit})"


def groups_of(verdict: str, answer: str) -> tuple[str, ...]:
    """Names of the groups whose trials say how far an answer may lie behind, the narrowest first."""
    effect = find_effect(answer)
    wider = () if effect is None else (f"{verdict}/{effect.family}", f"{verdict}/{AN_EFFECT}")
    return (f"{verdict}/{answer}", *wider, verdict, "any")


def answer_distances(probabilities: Array) -> Array:
    """Log odds of each answer against the best, turned to be positive, (answers,)."""
    logs = np.log(np.maximum(probabilities, 1e-300))
    return np.asarray(logs.max() - logs)


@dataclass(frozen=True)
class CalibratedAnswer:
    """What a diagnosis says of its own probabilities.

    Attributes:
        version, fitted, judged, population, error, coverage: as in :class:`CalibrationTable`.
        typicality: share of the trials that are no more usual than this session, 0 to 1.
        unusual: what is unusual about it, in words. widening: by how much its log odds were drawn together.
        cannot_be_ruled_out: the conformal set over effects and "nothing_missing", "not_in_catalogue".
    """

    version: str
    fitted: int
    judged: int
    population: str
    error: float
    coverage: float
    typicality: float
    unusual: tuple[str, ...]
    widening: float
    cannot_be_ruled_out: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The object "calibration" of ``diagnose --json``."""
        return {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self).items()}


def session_features(
    runs: Sequence[Run], errors: Iterable[HeldOutError], score: float, left: float
) -> tuple[dict[str, float], str]:
    """What tells of a session whether it is usual, by name as in the table, and the phases of its runs.

    Args:
        errors: of the model as given, by equation. score: its error in floors. left: what the path leaves.
    """
    floors = [e.floor * math.sqrt(max(1.0 - e.r2, 0.0)) / e.rmse for e in errors if e.rmse > 0.0]
    features = {
        "runs": float(len(runs)),
        "seconds": float(np.median([run.seconds for run in runs])),
        "rate": float(np.median([run.sample_rate_hz for run in runs])),
        "floor": max((f for f in floors if math.isfinite(f)), default=math.nan),
        "score": score,
        "left": left,
    }
    phases = sorted({run.phase for run in runs})
    return {name: v for name, v in features.items() if math.isfinite(v) and v > 0.0}, " ".join(phases)


def calibrated(
    odds: Odds, verdict: str, features: Mapping[str, float], kind: str, table: CalibrationTable | None = None
) -> tuple[Array, CalibratedAnswer]:
    """Probability of each of ``odds.answers``, and what is to be said of them.

    Args:
        verdict: of the odds, as they stand. features, kind: see :meth:`CalibrationTable.typicality`.
        table: None for the one that comes with the program.
    """
    table = table or calibration()
    widening, share, unusual = table.widening(features, kind)
    probabilities = table.map.probabilities(odds, features.get("left", 1.0), widening)
    kept = table.conformal_set(verdict, odds.answers, probabilities, odds.ruled_out)
    return probabilities, CalibratedAnswer(
        table.version, table.fitted, table.judged, table.population, table.error, table.coverage,
        share, unusual, widening, kept,
    )  # fmt: skip


@cache
def calibration() -> CalibrationTable:
    """The table that comes with the program."""
    text = files("fingerlab.resources").joinpath("calibration.json").read_text(encoding="utf-8")
    return read_calibration(text)


def read_calibration(text: str) -> CalibrationTable:
    """A table from its JSON text."""
    return structured(CalibrationTable, json.loads(text))

"""What a proposed run will have brought, as past proposals have it: gains corrected, and the set after it.

A predicted gain rests on models none of which is quite the bench's, and on a motion that nobody has seen.
What past proposals brought is therefore set against what was predicted of them: a line between the two, and
how far they scatter about it, for effects among each other and for an effect against nothing. The table is
``resources/foretelling.json``, which ``python -m tests.hidden.sweep.foretell`` makes. What a gain does to the
probabilities and the set, the calibration itself says: it is asked with the odds that a run would leave.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import Final

import numpy as np

from fingerlab.core.plain_data import structured
from fingerlab.diagnosis.score.calibration import (
    CalibrationTable,
    Odds,
    answer_distances,
    calibration,
)
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.settings import LEAST_PROBABILITY, MOST_UNDETECTED, SEEN_LOG_ODDS
from fingerlab.sessions.model import Array

FOUND: Final = "missing_effect"
HIDDEN: Final = "nothing_missing"
SessionFeatures = tuple[Mapping[str, float], str]
"""What ``score.calibration.session_features`` says of sessions."""


@dataclass(frozen=True)
class Line:
    """What came of predicted gains, over ``trials`` of them: asinh(gain) = offset + slope asinh(predicted).

    In nats; nearly the gain itself where it is small, and its logarithm where it is large. ``spread`` is the
    scatter about the line, one standard deviation.
    """

    offset: float
    slope: float
    spread: float
    trials: int

    def gain(self, predicted: Array | float, away: Array | float = 0.0) -> Array:
        """The gain that comes of a predicted one, so many standard deviations ``away`` from the line."""
        return np.asarray(
            np.sinh(self.offset + self.slope * np.arcsinh(predicted) + self.spread * np.asarray(away))
        )


@dataclass(frozen=True)
class ForetellingTable:
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
    among: Line
    bench: Line
    shows: Line

    def line(self, on_bench: bool) -> Line:
        """What comes of gains among effects in a run of the motor alone, or of a finger."""
        return self.bench if on_bench else self.among


@cache
def foretelling() -> ForetellingTable:
    """The table that comes with the program."""
    text = files("fingerlab.resources").joinpath("foretelling.json").read_text(encoding="utf-8")
    return structured(ForetellingTable, json.loads(text))


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
        return np.array([self.table.threshold(FOUND, name) for name in self.odds.answers])

    def probabilities(self, odds: Odds | None = None) -> Array:
        """Of every answer, (answers,); ``odds``: None for those as they are."""
        return self.table.map.probabilities(odds or self.odds, self.left, self.widening)

    def found_set(self, told: Array) -> list[int]:
        """Indices of the effects in the set where one is found, by the ``told`` probabilities (answers,)."""
        count = len(self.odds.effects)
        kept = np.flatnonzero(answer_distances(told) <= self._limits)
        effects = [int(i) for i in kept if i < count]
        return effects or [int(np.argmax(told[:count]))]

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
    """As it stands."""
    table = calibration()
    return Outlook(evidence.odds, usual[0].get("left", 1.0), table.widening(*usual)[0], table)

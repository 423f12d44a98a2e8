"""How a model came about: every addition with the error before and after it, and what spoke for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from fingerlab.core.progress import Progress, Watch
from fingerlab.core.text import decimals_for, fixed, percent, printed, score_text, screen_unit
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis
from fingerlab.report.diagnosis_words import FAMILY_TITLES, effect_title, in_sentence, judged_on, listed
from fingerlab.report.parameter_words import held_words
from fingerlab.sessions.model import Session

OTHERS_SHARE = 0.6
"""Of the time: what the models before the last one take, of which no curves are drawn (assumed)."""


def diagnose_each(
    sessions: Sequence[Session],
    added: Sequence[str],
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> list[Diagnosis]:
    """The diagnoses of every model from the nominal one to that with all ``added``; the last has curves.

    Raises:
        UserError: as :func:`fingerlab.diagnosis.diagnose`.
        Cancelled: ``cancelled`` answered True.
    """
    # Here, so that a window which only tells the story opens without waiting for them.
    from fingerlab.diagnosis import diagnose
    from fingerlab.diagnosis.gram.reduction import Reduction

    watch, kept, found = Watch(progress, cancelled), Reduction(sessions), list[Diagnosis]()
    for number in range(len(added) + 1):
        last = number == len(added)
        low = OTHERS_SHARE * number / max(len(added), 1)
        high = 1.0 if last else OTHERS_SHARE * (number + 1) / len(added)

        def part(share: float, what: str, low: float = low, high: float = high) -> None:
            watch.tell(low + (high - low) * share, what)

        found.append(diagnose(sessions, added[:number], part, cancelled, with_curves=last, kept=kept))
    return found


@dataclass(frozen=True)
class StoryStep:
    """One step from model to model. Scores are errors on runs left out of the fit, in floors.

    Attributes:
        came, went: ids of the effects that were added, and of those that were given up.
        before, after: score. chance: probability that was given to what came, 0 to 1; None: not ranked.
        evidence: what spoke for it, in words of the diagnosis before the step.
        held: what was held from this step on, in words, where that changed.
    """

    came: tuple[str, ...]
    went: tuple[str, ...]
    before: float
    after: float
    chance: float | None
    evidence: str
    held: str = ""

    @property
    def title(self) -> str:
        """``Coulomb joint friction``, ``Stribeck friction in place of Coulomb friction``."""
        if self.held and not (self.came or self.went):
            return self.held[:1].upper() + self.held[1:]
        came, went = (
            listed([effect_title(effects[0]), *(in_sentence(effect_title(e)) for e in effects[1:])])
            if effects
            else ""
            for effects in (self.came, self.went)
        )
        if came and went:
            return f"{came} in place of {in_sentence(went)}"
        return came or f"{went} taken out"

    @property
    def row(self) -> tuple[str, str, str, str]:
        """Title, error before, error after, probability: for a table."""
        chance = "–" if self.chance is None else percent(self.chance)
        return self.title, score_text(self.before), score_text(self.after), chance

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "added": list(self.came), "removed": list(self.went), "score_before": self.before,
            "score": self.after, "probability": self.chance, "evidence": self.evidence,
            **({"held": self.held} if self.held else {}),
        }  # fmt: skip


def story(models: Sequence[Diagnosis]) -> tuple[StoryStep, ...]:
    """The steps between diagnoses of models in the order in which they were made."""
    return tuple(_step(before, now) for before, now in pairwise(models))


def evidence_for(effects: Sequence[str], before: Diagnosis) -> str:
    """What a diagnosis says for effects, each once; empty where it has not judged them."""
    return " ".join(printed(one.explanation) for one in _judged(effects, before))


def _judged(effects: Sequence[str], diagnosis: Diagnosis) -> list[Candidate]:
    by_id = {candidate.effect: candidate for candidate in diagnosis.candidates}
    return [by_id[effect] for effect in effects if effect in by_id]


def _step(before: Diagnosis, now: Diagnosis) -> StoryStep:
    came = tuple(effect for effect in now.model if effect not in before.model)
    went = tuple(effect for effect in before.model if effect not in now.model)
    judged = _judged(came[:1], before)
    return StoryStep(
        came,
        went,
        before.score,
        now.score,
        judged[0].probability if judged else None,
        evidence_for(came, before),
        "" if now.held == before.held else held_words(now.held) or "nothing held any more",
    )


def error_rows_of_story(models: Sequence[Diagnosis]) -> list[tuple[str, ...]]:
    """Family, its error with each model in turn, its floor with the last, and the unit: for a table."""
    rows = []
    for family, last in models[-1].errors.items():
        errors = [model.errors.get(family) for model in models]
        unit = screen_unit(last.unit, max(*(one.rmse for one in errors if one is not None), last.floor))
        floor = last.floor * unit.factor
        decimals = decimals_for(floor / 3.0) if floor > 0 else 3
        shown = ["–" if one is None else fixed(one.rmse * unit.factor, decimals) for one in errors]
        rows.append((FAMILY_TITLES.get(family, family), *shown, fixed(floor, decimals), unit.symbol))
    return rows


def story_sentence(models: Sequence[Diagnosis]) -> str:
    """``The error ... went from 30.9 with the nominal model to 7.5 ... and 1.2 with``; empty: one model."""
    steps = story(models)
    if not steps:
        return ""
    told = [f"to {score_text(s.after)} with {in_sentence(s.title)}" for s in steps]
    return (
        f"The error on {judged_on(models[-1])} went from {score_text(models[0].score)} times the floor "
        f"with {'the nominal model' if not models[0].model else 'the first model'} {', then '.join(told)}."
    )

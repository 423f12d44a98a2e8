"""What a diagnosis says of sessions, and the effects that it may find, as a notebook shows them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import printed, score_text
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, OtherModel, SmallerModel
from fingerlab.effects.base import Effect
from fingerlab.notebook.model import (
    Displayable,
    Displayed,
    Figures,
    ModelView,
    SessionSource,
    ShownTable,
    effect_ids,
    fit,
    opened_each,
)
from fingerlab.report import diagnosis_words as words
from fingerlab.report.page_tables import error_rows, short_ranking
from fingerlab.report.recording_words import next_experiment_sentence, paired_sentence
from fingerlab.report.score_words import path_sentence
from fingerlab.sessions.model import Session


class EffectView(Displayed):
    """One effect. ``effect`` is the object behind it (``fingerlab.effects.Effect``)."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect

    @property
    def id(self) -> str:
        """What ``added`` and ``--add`` call it."""
        return self.effect.id

    @property
    def title(self) -> str:
        """What the screen calls it."""
        return self.effect.title

    @property
    def changes(self) -> str:
        """The families of equations that it changes, in words."""
        return words.listed([words.FAMILY_TITLES.get(e, e).lower() for e in self.effect.acts_on])

    def _parts(self) -> Sequence[Displayable]:
        one = self.effect
        rows = [
            (name, gain.title or name, gain.unit, f"{gain.low:g} to {gain.high:g}", gain.source)
            for name, gain in one.unknowns.items()
        ]
        parts: list[Displayable] = [f"{one.title} ({one.id}), changes {self.changes}", one.explanation]
        if rows:
            parts.append(ShownTable(("unknown", "what", "unit", "plausible range", "source"), rows))
        mends = (f"What mends it: {one.mend}",) if one.mend else ()
        return (*parts, f"What reveals it: {one.reveal}.", *mends)


class Catalogue(Mapping[str, EffectView], Displayed):
    """Effects by id, one's own included."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = {name: EffectView(one) for name, one in effects.items()}

    def __getitem__(self, effect: str) -> EffectView:
        return self._effects[effect]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def _parts(self) -> Sequence[Displayable]:
        rows = [(one.id, one.title, one.changes) for one in self.values()]
        return (f"{len(self)} effects", ShownTable(("id", "effect", "acts on"), rows))


class DiagnosisView(Displayed):
    """The answer to: which effect is missing? ``result`` holds all of it (``diagnosis.answer.results``)."""

    def __init__(self, result: Diagnosis, sessions: Sequence[Session]) -> None:
        self.result = result
        self._sessions = tuple(sessions)

    @property
    def verdict(self) -> str:
        """``missing_effect``, ``nothing_missing`` or ``not_in_catalogue``."""
        return str(self.result.verdict)

    @property
    def missing(self) -> tuple[str, ...]:
        """Ids of the effects that these data cannot tell apart, best first; empty where none is missing."""
        return words.suspects(self.result)

    @property
    def left_open(self) -> tuple[str, ...]:
        """Where none is missing: ids of the effects that these data could not have shown, likeliest first."""
        return words.not_shown(self.result)

    @property
    def score(self) -> float:
        """Error of the model as given on runs left out of the fit; 1 is the bench's own repeatability."""
        return self.result.score

    @property
    def path(self) -> tuple[tuple[str | None, float], ...]:
        """Effect added and the score with it, step by step; the first is the model as given."""
        return tuple((step.added, step.score) for step in self.result.path)

    @property
    def better(self) -> OtherModel | None:
        """A model with given effects exchanged that is clearly better; None: there is none."""
        return self.result.better

    @property
    def smaller(self) -> SmallerModel | None:
        """The model without an effect that it does not need; None: it needs each, or something is missing."""
        return self.result.smaller

    def candidate(self, effect: str) -> Candidate:
        """How one effect of the catalogue was judged: score, probability, parameters, explanation.

        Raises:
            UserError: the effect was not tried on these sessions.
        """
        for one in self.result.candidates:
            if one.effect == effect:
                return one
        tried = ", ".join(c.effect for c in self.result.candidates)
        raise UserError(f"'{effect}' was not tried on these sessions; those that were: {tried}.")

    def figures(self) -> Figures:
        """Error path, where the model fails worst, measured against modelled, fingerprints.

        Raises:
            UserError: the diagnosis was asked for without curves.
        """
        if not self.result.comparisons:
            raise UserError("This diagnosis holds no curves; ask for it with curves=True to draw figures.")
        from fingerlab.report.diagnosis_figures import diagnosis_figures

        return Figures(diagnosis_figures(self.result, self._sessions))

    def fit(self, effects: Sequence[str] | None = None) -> ModelView:
        """Fit the model to the same sessions, where none are named with the effects that it adds."""
        chosen = self.result.final_model if effects is None else effects
        return fit(*self._sessions, effects=chosen)

    def to_json(self) -> Mapping[str, Any]:
        """What ``fingerlab diagnose --json`` writes."""
        return self.result.to_json()

    def _parts(self) -> Sequence[Displayable]:
        result = self.result
        parts: list[Displayable] = [words.verdict_sentence(result), _errors(result), _ranking(result)]
        best = words.suspected(result)
        parts += [f"{candidate.title}: {printed(candidate.explanation)}" for candidate in best]
        if len(result.set) > 1 or words.not_shown(result):
            parts.append(words.set_sentence(result))
        if words.as_good_sentence(result):
            parts.append(words.as_good_sentence(result))
        if result.paired:
            parts.append(paired_sentence(result))
        if words.worth_adding(result):
            parts.append(path_sentence(result))
        parts += [f"The bench: {finding.text}" for finding in result.bench]
        proposal = next_experiment_sentence(result, self._sessions[0].rig.line_radius)
        if proposal is not None:
            parts.append(proposal)
        unseen = words.hidden_sentence(result)
        if unseen:
            parts.append(unseen)
        calibration = words.calibration_sentence(result)
        if calibration:
            parts.append(calibration)
        return parts


def _errors(result: Diagnosis) -> ShownTable:
    rows = [(r.title, r.error, r.floor, r.unit, r.times, r.r2) for r in error_rows(result.errors)]
    columns = ("equations", "error (rms)", "floor", "unit", "error / floor", "R2")
    title = f"Error on {words.judged_on(result).rstrip(',')}: {score_text(result.score)} times the floor"
    return ShownTable(columns, rows, frozenset({1, 2, 4, 5}), title)


def _ranking(result: Diagnosis) -> ShownTable:
    rows = [(r.chance, r.score, "*" if r.in_set else "", r.title, r.effect) for r in short_ranking(result)]
    columns = ("probability", "error", "", "effect or outcome", "id")
    note = "; * cannot be ruled out" if result.set else ""
    return ShownTable(columns, rows, frozenset({0, 1}), f"error: with that effect in the model{note}")


def catalogue() -> Catalogue:
    """The catalogue of effects by id, with those of one's own that have been confirmed."""
    from fingerlab.effects import whole_catalogue

    return Catalogue(whole_catalogue())


def diagnose(
    *sessions: SessionSource, added: Sequence[str] = (), curves: bool = True, progress: Progress | None = None
) -> DiagnosisView:
    """Where the model fails on these sessions together, and which effect is missing.

    Args:
        sessions: opened, or files. added: ids of effects that the model holds already.
        curves: whether figures are wanted of it.
        progress: called with the share done (0 to 1) and what is being done.

    Raises:
        UserError: no session, one that comes twice, an unknown effect, or a run that cannot be read.
    """
    from fingerlab.diagnosis import diagnose as run

    read = opened_each(sessions)
    return DiagnosisView(run(read, effect_ids(added), progress=progress, with_curves=curves), read)

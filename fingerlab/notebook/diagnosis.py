"""A diagnosis, as a notebook shows it: the answer first, then what it rests on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.core.text import printed, score_text
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis
from fingerlab.notebook.figures import Figures
from fingerlab.notebook.layout import Part, Shown, Table
from fingerlab.notebook.model import ModelView
from fingerlab.report import diagnosis_words as words
from fingerlab.report.page_tables import error_rows, short_ranking
from fingerlab.sessions.model import Session


class DiagnosisView(Shown):
    """The answer to: which effect is missing? ``result`` holds all of it (``diagnosis.results``)."""

    def __init__(self, result: Diagnosis, sessions: Sequence[Session]) -> None:
        self.result = result
        self._sessions = tuple(sessions)

    @property
    def verdict(self) -> str:
        """``missing_effect``, ``nothing_missing`` or ``not_in_catalogue``."""
        return self.result.verdict

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

        return Figures(diagnosis_figures(self.result))

    def fit(self, effects: Sequence[str] | None = None) -> ModelView:
        """Fit the model to the same sessions, where none are named with the effects that it adds."""
        from fingerlab.notebook.calls import fit

        chosen = self.result.final_model if effects is None else effects
        return fit(*self._sessions, effects=chosen)

    def to_json(self) -> Mapping[str, Any]:
        """What ``fingerlab diagnose --json`` writes."""
        return self.result.to_json()

    def _parts(self) -> Sequence[Part]:
        result = self.result
        parts: list[Part] = [words.verdict_sentence(result), _errors(result), _ranking(result)]
        best = words.suspected(result)
        parts += [f"{candidate.title}: {printed(candidate.explanation)}" for candidate in best]
        if len(result.set) > 1 or words.not_shown(result):
            parts.append(words.set_sentence(result))
        if words.worth_adding(result):
            parts.append(words.path_sentence(result))
        proposal = words.next_experiment_sentence(result)
        if proposal is not None:
            parts.append(proposal)
        unseen = words.hidden_sentence(result)
        if unseen:
            parts.append(unseen)
        return parts


def _errors(result: Diagnosis) -> Table:
    rows = [(r.title, r.error, r.floor, r.unit, r.times, r.r2) for r in error_rows(result.errors)]
    columns = ("equations", "error (rms)", "floor", "unit", "error / floor", "R2")
    title = f"Error on runs left out of the fit: {score_text(result.score)} times the floor"
    return Table(columns, rows, frozenset({1, 2, 4, 5}), title)


def _ranking(result: Diagnosis) -> Table:
    rows = [(r.chance, r.score, "*" if r.in_set else "", r.title, r.effect) for r in short_ranking(result)]
    columns = ("probability", "error", "", "effect or outcome", "id")
    note = "; * cannot be ruled out" if result.set else ""
    return Table(columns, rows, frozenset({0, 1}), f"error: with that effect in the model{note}")

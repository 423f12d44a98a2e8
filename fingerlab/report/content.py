"""What the report tells, worked out before any of it is written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import ParameterEstimate
from fingerlab.report import diagnosis_words as words
from fingerlab.report.analysis_section import Analysis, analyse
from fingerlab.report.equation import FinalEquation, final_equation
from fingerlab.report.prediction_section import Prediction, fitted_model, predict_force
from fingerlab.sessions.model import Session

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Content:
    """All that the report tells, worked out: sessions, diagnosis, and what was fitted and predicted."""

    sessions: Sequence[Session]
    diagnosis: Diagnosis
    analysis: Analysis | None
    prediction: Prediction | None
    equation: FinalEquation | None
    bench: Mapping[str, ParameterEstimate]
    """What the fit gives for the bench itself, with the model that the diagnosis begins with."""

    def model_words(self) -> str:
        """The model that the diagnosis ends at."""
        return words.model_words(self.diagnosis.final_model)

    def equation_or_refuse(self) -> FinalEquation:
        """The equation.

        Raises:
            UserError: the model could not be fitted to these runs as a whole.
        """
        if self.equation is None:
            raise UserError(
                f"{self.sessions[0].path} has too few runs to fit {self.model_words()} as a whole; "
                "leave out '--equation'."
            )
        return self.equation


def gather(sessions: Sequence[Session], diagnosis: Diagnosis, progress: Progress) -> Content:
    """Work out what the report tells beside the diagnosis."""
    analysis = analyse(sessions, lambda share, what: progress(0.5 * share, what))
    # A diagnosis without a fit of its own (as tests make it) has no model to write down.
    model = None
    if diagnosis.final_parameters:
        model = fitted_model(
            sessions, diagnosis.final_model, lambda share, what: progress(0.5 + 0.4 * share, what)
        )
    shown = {c.effect: c.parameters for c in diagnosis.candidates}
    same = model is not None and diagnosis.final_model == diagnosis.model
    progress(0.9, "predicting the endpoint force")
    return Content(
        sessions,
        diagnosis,
        analysis,
        predict_force(sessions, model) if diagnosis.final_parameters else None,
        None if model is None else final_equation(model, sessions[0].rig, shown),
        model.parameters if model is not None and same else diagnosis.parameters,
    )

"""What a comparison leads to: a report page, the proposed recording, the force in Predict, a model file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QFileDialog, QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import put_in_place
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import ModelKey
from fingerlab.sessions.model import Session

from ..app.context import ApplicationContext
from ..app.worker import IsCancelled, Progress, Work
from .controller import LabController

if TYPE_CHECKING:
    from fingerlab.models.file import Model


def write_page(
    sessions: Sequence[Session],
    path: Path,
    models: Sequence[Diagnosis],
    progress: Progress,
    cancelled: IsCancelled,
) -> Path:
    """Write the report of what the window shows; returns the path.

    ``models``: diagnoses of the models that were made, the first one's first, and at last of the one shown.
    A page that is there already is replaced: the save dialog has asked. It is replaced only when the new
    one is whole.

    Raises:
        UserError: the place cannot be written to.
        Cancelled: the user stopped it; what was there stays.
    """
    progress(0.0, "preparing")
    from fingerlab.report.page import write_report

    *before, now = models
    if not path.exists():
        return write_report(sessions, path, now.model, now, progress, cancelled, before=before)
    fresh = path.with_name(f"{path.stem}.new{path.suffix}")
    fresh.unlink(missing_ok=True)
    write_report(sessions, fresh, now.model, now, progress, cancelled, before=before)
    put_in_place(fresh, path, "close it elsewhere or choose another name.", "replaced")
    return path


NAME = "Model lab"
"""What stands in Predict where a file's name would."""

MODELS = "Model files (*.json)"
CONTACT_FORCE_N = 0.8
"""Mean force of a proposed contact run that names no offset, as in a protocol (assumed)."""


def model_of(path: Path) -> ModelKey:
    """Ids of the effects, and what is held, of a model file of the Model lab, or of ``diagnose --save``.

    Raises:
        UserError: it is no such file.
    """
    from fingerlab.models.file import DIAGNOSIS_METHOD, load_model
    from fingerlab.prediction import extended_model

    model = load_model(path)
    if model.method != DIAGNOSIS_METHOD:
        raise UserError(
            f"{path.name} is a fit by {model.method}, which has no effects; open it in Predict, "
            "or give a model that the Model lab has saved."
        )
    held = extended_model(model, path.name).held if model.details.get("held") else {}
    return model.effects, tuple(sorted(held.items()))


class ResultActions(QObject):
    """Acts on the controller's present diagnosis."""

    def __init__(self, context: ApplicationContext, controller: LabController, widget: QWidget) -> None:
        super().__init__(widget)
        self._context, self._controller, self._widget = context, controller, widget

    def hand_experiment(self) -> None:
        """The proposed recording to Acquire, as a protocol of one run."""
        proposal = self._proposal()
        if proposal is None:
            return
        from fingerlab.acquisition.protocols.steps import plan_steps
        from fingerlab.twin.protocols import single_run

        try:
            change = proposal.get("intervention")
            run = single_run(proposal["trajectory"], proposal["phase"], proposal.get("cable"), change)
            steps = plan_steps([run], CONTACT_FORCE_N)
        except UserError as error:
            self._context.tell(str(error))
            return
        self._context.hand_protocol(steps, "Proposed by the Model lab")

    def predict(self) -> None:
        """Fit the present model with its interval, and show its force in Predict."""
        self._context.hush()
        self._context.tasks.start(
            "Fitting the model to predict with",
            self._fit(),
            lambda model: self._context.hand_model(model, NAME),
        )

    def ask_and_save(self) -> None:
        """Fit the present model with its interval, and save it for Predict and the command line."""
        sessions = self._controller.sessions
        if not sessions:
            return
        start = Path(self._context.settings.folder()) / f"{sessions[0].path.stem}-model.json"
        name, _ = QFileDialog.getSaveFileName(self._widget, "Save model", str(start), MODELS)
        if not name:
            return
        path, fit = Path(name), self._fit()

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            from fingerlab.models.file import save_model

            model = fit(progress, cancelled)
            path.unlink(missing_ok=True)  # the dialog has asked
            save_model(model, path)
            return path

        self._context.tasks.start(
            "Saving the model", work, lambda done: self._context.announce(f"Model saved: {done}", done)
        )

    def _fit(self) -> Work:
        sessions, (added, held) = self._controller.sessions, self._model()

        def work(progress: Progress, cancelled: IsCancelled) -> Model:
            from fingerlab.prediction import fit_extended, model_of_extended

            return model_of_extended(fit_extended(sessions, added, progress, dict(held)))

        return work

    def _model(self) -> ModelKey:
        history = self._controller.history
        return history.now.key if history is not None else ((), ())

    def _proposal(self) -> dict[str, Any] | None:
        diagnosis = self._controller.diagnosis
        return (
            dict(diagnosis.next_experiment) if diagnosis is not None and diagnosis.next_experiment else None
        )

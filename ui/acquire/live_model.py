"""The model beside the measurement: which one, its curves, and the error that is left."""

from __future__ import annotations

import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QFileDialog

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import FINGER_PHASES

from ..app.context import ApplicationContext
from .acquire_bars import FILE, FROM_FILE, NO_MODEL, NOMINAL, PlotToolbar
from .bench_controller import BenchController
from .live_channels import PLOTS, QUANTITIES
from .live_plots import LivePlots

if TYPE_CHECKING:
    from fingerlab.models.live import Balance

MODEL_FILTER = "Model files (*.json);;All files (*)"


class LiveModelComparison(QObject):
    """Follows the choice in the toolbar and the set-up of the bench."""

    def __init__(
        self, context: ApplicationContext, controller: BenchController, toolbar: PlotToolbar, plots: LivePlots
    ) -> None:
        super().__init__(controller)
        self._context, self._controller, self._toolbar, self._plots = context, controller, toolbar, plots
        self._balance: Balance | None = None
        self._path: Path | None = None
        self._key = NO_MODEL
        toolbar.model_chosen.connect(self._on_chosen)

    def show(self) -> None:
        """Compare anew: another bench, another phase or cable."""
        self._toolbar.refuse_models(self._refusal())
        key = self._key
        if key == FILE and self._path is not None:
            self._load(self._path)
        try:
            self._controller.compare(self._balance if key == FILE else None, key in (NOMINAL, FILE))
        except UserError as error:
            self._context.tell(str(error))
            self._key = key = NO_MODEL
        self._toolbar.show_model(key, self._path if key == FILE else None)
        modelled = self._controller.model is not None
        self._plots.show_model(modelled, modelled and self._controller.set_up.phase == "contact")
        self._plots.refresh()

    def _refusal(self) -> str:
        """Why no model can stand beside what is measured now; empty where one can."""
        opened = self._controller.opened
        if opened is None:
            return ""
        if opened.rig.finger is None or opened.rig.motor.pulley_radius is None:
            return "The rig names no finger or no pulley radius; there is nothing to model."
        if self._controller.set_up.phase not in FINGER_PHASES:
            return "A model is of the finger; choose the phase On air or Contact."
        return ""

    def show_errors(self) -> None:
        """What the model leaves over now."""
        model = self._controller.model
        if model is None:
            return
        for spec in PLOTS:
            if spec.key in ("torque", "force"):
                error = model.error(spec.key)
                words = QUANTITIES[spec.readings[0]].text(error) if error == error else "–"
                label = self._plots.panes[spec.key].error
                label.setText(f"error {words}")
                label.setToolTip(
                    f"Root mean square of measured less modelled over the last seconds. The model is "
                    f"{1e3 * model.delay_s:.0f} ms behind the measurement."
                )

    def _on_chosen(self, key: str) -> None:
        if key == FROM_FILE:
            name, _ = QFileDialog.getOpenFileName(
                self._toolbar, "Model", self._context.settings.folder(), MODEL_FILTER
            )
            if not name or not self._load(Path(name)):
                self._toolbar.show_model(self._key)
                return
            key = FILE
        self._key = key
        self.show()

    def _load(self, path: Path) -> bool:
        from fingerlab.models.file import load_model
        from fingerlab.models.live import balance_of

        try:
            self._balance = balance_of(load_model(path), self._controller.set_up.cable, path.name)
        except UserError as error:
            self._context.tell(str(error), traceback.format_exc())
            return False
        self._path = path
        return True

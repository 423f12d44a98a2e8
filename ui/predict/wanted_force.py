"""The view "Wanted force": which force in which pose; the torque drawn with its limits, saved, handed on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QFormLayout,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.core.text import MILLI_NEWTON_METRE, NEWTON, decimals_for, fixed
from fingerlab.models.file import SavedModel
from fingerlab.prediction.inverse import TorquePlan

from ..app.context import ApplicationContext
from ..app.worker import IsCancelled, Progress
from ..widgets.layout import Panes, as_written, described
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.tables import WordsLabel, heading, remark
from ..widgets.theme import colours_of, tint
from ..widgets.wanted_fields import WantedFields

if TYPE_CHECKING:
    from fingerlab.prediction.inverse import Predictor
    from fingerlab.sessions.model import Session


class WantedPanel(QWidget):
    """Signals ``changed``: another force, model or pose; ``save_asked``; ``hand_asked``."""

    changed = Signal()
    save_asked = Signal()
    hand_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.model = _choice("wantedModel", "Model that gives the torque")
        # A long name must not widen the panel.
        self.model.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.model_name = remark()  # what the list has no room for
        self.model_name.setObjectName("wantedModelName")
        self.pose = _choice("wantedPose", "Contact run that says how the finger stands")
        self.wanted = WantedFields(self)
        self.result, self.limits = WordsLabel(), WordsLabel()
        self.result.setObjectName("wantedResult")
        self.limits.setObjectName("wantedLimits")
        for label in (self.result, self.limits):
            label.setWordWrap(True)
            label.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Minimum)
        self.save = described(QPushButton("&Save trajectory…"), "saveTorque")
        self.hand = described(QPushButton("Hand &to Acquire"), "handTorque", primary="true")
        self._lay_out()
        for box in (self.model, self.pose):
            box.currentIndexChanged.connect(self._on_choice)
        self.wanted.changed.connect(self.changed)
        self.save.clicked.connect(self.save_asked)
        self.hand.clicked.connect(self.hand_asked)
        self.wanted.set_shown(True)
        self.show_outcome("", "", False)

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.setContentsMargins(0, 0, 0, 0)
        form.setSpacing(4)
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        form.addRow("Mo&del", self.model)
        form.addRow(self.model_name)
        form.addRow("P&ose of run", self.pose)
        self.wanted.add_to(form)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        layout.addLayout(form)
        layout.addWidget(heading("Torque"))
        layout.addWidget(self.result)
        layout.addWidget(self.limits)
        layout.addStretch(1)
        layout.addWidget(self.save)
        layout.addWidget(self.hand)

    # what is chosen

    def show_choices(self, models: Sequence[str], runs: Sequence[str]) -> None:
        """Fill in predictors and contact runs; what was chosen stays where it is still there."""
        for box, names in ((self.model, models), (self.pose, runs)):
            before = box.currentText()
            with QSignalBlocker(box):
                box.clear()
                box.addItems(list(names))
                for row, name in enumerate(names):
                    box.setItemData(
                        row, as_written(name), Qt.ItemDataRole.ToolTipRole
                    )  # the list may be too narrow
                box.setCurrentIndex(max(box.findText(before), 0))
        self.model_name.setText(self.model.currentText())

    def show_outcome(self, result: str, limits: str, usable: bool) -> None:
        """What the torque is, in words; what the limits say to it; whether it can be used."""
        self.result.setText(result)
        self.limits.setText(limits)
        self.limits.setVisible(bool(limits))
        why = "" if usable else limits or "No torque yet."
        for button, words in (
            (self.save, "As a file for 'fingerlab record --trajectory' and 'simulate'."),
            (self.hand, "A contact run with this torque, as a protocol in the Acquire tab."),
        ):
            button.setEnabled(usable)
            button.setToolTip(words if usable else why)

    def _on_choice(self) -> None:
        self.model_name.setText(self.model.currentText())
        self.changed.emit()


def _choice(name: str, accessible: str) -> QComboBox:
    return described(QComboBox(), name, accessible=accessible, tip=accessible)


NEAR_LIMIT = 0.7
"""The limit is drawn, and the axis reaches to it, where the torque comes to this share of it."""


class PlanPlot(QuietPlot):
    """A plot of the torque that a wanted force needs, or of that force."""

    def __init__(self, name: str, accessible: str, parent: QWidget | None = None) -> None:
        super().__init__(name, accessible, parent)
        self.plan: TorquePlan | None = None

    def show_plan(self, plan: TorquePlan | None) -> None:
        """Another force and its torque, or none."""
        self.plan = plan
        self.redraw()


class WantedForcePlot(PlanPlot):
    """The wanted force over its time."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("wantedForcePlot", "Wanted endpoint force over its time", parent)
        self.name_axes("Wanted force", NEWTON, "Time in the profile (s)")
        self.setToolTip("F, N: force of the fingertip that the load cell is to read, compression positive.")

    def redraw(self) -> None:
        plot, plan = self.getPlotItem(), self.plan
        plot.clear()
        if plan is None:
            return
        plot.addItem(plain_curve(plan.time, plan.force, self.pen("measured"), "wanted"))
        low, high = span_of(plan.force)
        plot.setRange(xRange=(plan.time[0], plan.time[-1]), yRange=(min(low, 0.0), high), padding=0)


class TorquePlot(PlanPlot):
    """Motor torque with its 90 % interval, and the rig's limit where it is near."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("torquePlot", "Motor torque that the wanted force needs", parent)
        self.name_axes("Motor torque", MILLI_NEWTON_METRE, "Time in the profile (s)")
        self.setToolTip(
            "τ, N m at the gearbox output: what the model needs for F.\n"
            "By the PIP equation τ = r·(F·lever + LHS2 − L2) / (s·b), thesis (3.18) for the tension; a "
            "model with effects is solved by the secant method.\n"
            "Shaded: 90 % interval of the force, divided by what a newton metre adds to the force, and "
            "what a spring at the tip does that may be set down elsewhere."
        )

    def redraw(self) -> None:
        plot, plan = self.getPlotItem(), self.plan
        plot.clear()
        if plan is None:
            return
        torque, half = 1e3 * plan.torque, 1e3 * plan.half_width
        shown = [torque]
        self.draw_band(plan.time, torque, half, tint(colours_of(self).modelled, 0.2))
        shown += [torque + half, torque - half]
        width = 1.5 * self.devicePixelRatioF()
        plot.addItem(plain_curve(plan.time, torque, self.pen("modelled", width), "needed"))
        low, high = span_of(np.concatenate(shown))
        limit = 1e3 * plan.torque_limit
        if high > NEAR_LIMIT * limit:
            line = pg.InfiniteLine(pos=limit, angle=0, movable=False, pen=self.pen("fault", dashed=True))
            plot.addItem(line, ignoreBounds=True)
            high = max(high, 1.12 * limit)
            self.write(f"limit of the rig, {limit:.4g} mN m", float(plan.time[0]), limit, (0.0, 1.0))
        plot.setRange(xRange=(plan.time[0], plan.time[-1]), yRange=(min(low, 0.0), high), padding=0)


OWNER = "wanted force"
SETTLE_MS = 250
"""After an edit, before the torque is asked for anew."""

TRAJECTORIES = "Trajectories (*.json)"


class WantedView(QObject):
    """``widget`` is the work area, ``panel`` the side panel."""

    def __init__(self, context: ApplicationContext, parent: QObject) -> None:
        super().__init__(parent)
        self._context = context
        self._session: Session | None = None
        self._predictors: dict[str, tuple[str, Predictor]] = {}
        self._shown = False
        self.plan: TorquePlan | None = None
        self.panel = WantedPanel()
        self.force, self.torque = WantedForcePlot(), TorquePlot()
        self.widget = Panes("predict_wanted", ((self.force, 2), (self.torque, 3)))
        self._timer = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._timer.timeout.connect(self._ask)
        self.panel.changed.connect(self._timer.start)
        self.panel.save_asked.connect(self.ask_and_save)
        self.panel.hand_asked.connect(self.hand)

    def take(self, session: Session | None, models: Mapping[str, SavedModel]) -> None:
        """Another session, or other models."""
        from fingerlab.prediction.extended import Variant
        from fingerlab.prediction.inverse import predictors

        self._session = session
        self._predictors = {}
        for file, model in models.items():
            for words, one in predictors(model, file).items():
                self._predictors[f"{file}: {words}"] = (file, one)
        runs = [run.name for run in session.contact_runs()] if session is not None else []
        self.panel.show_choices(tuple(self._predictors), runs)
        bands = [one.band for _, one in self._predictors.values() if isinstance(one, Variant) and one.band]
        if bands:  # one standard deviation about the mean lies inside what was recorded
            self.panel.wanted.start_at(bands[0].centre, bands[0].spread)
        self._show(None)
        if self._shown:
            self._timer.start()

    def set_shown(self, shown: bool) -> None:
        """The view has come to the front, or has gone."""
        self._shown = shown
        if shown and self.plan is None:
            self._timer.start()

    def _ask(self) -> None:
        session = self._session
        chosen = self._predictors.get(self.panel.model.currentText())
        name = self.panel.pose.currentText()
        if session is None or chosen is None or not name or not self._shown:
            return
        if self.panel.wanted.waits_for_file:
            self._show(None)
            self.panel.show_outcome("Choose a text table of time (s) and force (N).", "", False)
            return
        file, predictor = chosen
        settings: dict[str, Any] = self.panel.wanted.settings()
        run = next(run for run in session.runs if run.name == name)

        def work(progress: Progress, cancelled: IsCancelled) -> TorquePlan | str:
            from fingerlab.diagnosis.signals.scales import find_scales
            from fingerlab.prediction.inverse import needed_torque
            from fingerlab.prediction.target import pose_of_run, wanted_force

            try:
                pose = pose_of_run(run, find_scales([session]))
                return needed_torque(wanted_force(settings), predictor, pose, session.rig, file)
            except UserError as error:
                return str(error)  # stands beside the fields that it is about

        def done(found: TorquePlan | str) -> None:
            if self._session is session and not self._timer.isActive():
                if isinstance(found, str):
                    self._show(None)
                    self.panel.show_outcome("", found, False)
                else:
                    self._show(found)

        self._context.tasks.start("Asking for the motor torque", work, done, OWNER)

    def _show(self, plan: TorquePlan | None) -> None:
        self.plan = plan
        self.force.show_plan(plan)
        self.torque.show_plan(plan)
        if plan is None:
            self.panel.show_outcome("", "", False)
        else:
            self.panel.show_outcome(
                outcome_words(plan), "\n".join((*plan.beyond, *plan.warnings)), not plan.beyond
            )

    # what is done with it

    def ask_and_save(self) -> None:
        """Write the torque as a trajectory file."""
        plan = self.plan
        if plan is None or plan.beyond:
            return
        start = Path(self._context.settings.folder()) / "wanted-force.json"
        name, _ = QFileDialog.getSaveFileName(self.widget, "Save trajectory", str(start), TRAJECTORIES)
        if not name:
            return
        path = Path(name)
        try:
            with whole_file(path, "choose another folder.") as part:
                part.write_text(json.dumps(plan.experiment(), indent=1) + "\n", encoding="utf-8")
        except UserError as error:
            self._context.tell(str(error))
            return
        self._context.announce(f"Trajectory saved: {path}", path)

    def hand(self) -> None:
        """One contact run with this torque, as a protocol in Acquire."""
        plan = self.plan
        if plan is None or plan.beyond:
            return
        from fingerlab.acquisition.protocols.steps import plan_steps
        from fingerlab.twin.protocols import RunPlan

        run = RunPlan("contact", plan.pose.cable, plan.trajectory())
        words = f"Wanted force, {plan.force.min():.2g} to {plan.force.max():.2g} N"
        self._context.hand_protocol(plan_steps([run], contact_force=float(plan.force.mean())), words)


def outcome_words(plan: TorquePlan) -> str:
    """Torque with interval, and current."""
    ends = [int(np.argmin(plan.torque)), int(np.argmax(plan.torque))]
    halves = [1e3 * float(plan.half_width[place]) for place in ends]
    known = all(half == half for half in halves)
    digits = min(decimals_for(min(halves)), 3) if known else 0
    said = [
        fixed(1e3 * float(plan.torque[place]), digits) + (f" ± {fixed(half, digits)}" if known else "")
        for place, half in zip(ends, halves, strict=True)
    ]
    return f"{' to '.join(said)} mN m, {plan.current.min():.2g} to {plan.current.max():.2g} A"

"""A force trial in Acquire: which model, which force, how many pairs; the torque before any is sent."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QFormLayout, QPushButton, QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.text import MILLI_NEWTON_METRE, NEWTON
from fingerlab.rig.file import Rig

from ..widgets.fields import WholeField
from ..widgets.layout import Panes, described, vbox
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.tables import remark
from ..widgets.wanted_fields import WantedFields

if TYPE_CHECKING:
    from fingerlab.acquisition.protocols.force_trial import ForceTrial
    from fingerlab.prediction.inverse import TorquePlan

MODEL_FILTER = "Models (*.json);;All files (*)"
MODEL_HELP = "Model of a diagnosis, saved with its effects: it is sent against the nominal one."
LONGEST_S = 20.0
"""Of a wanted force that is learned from run to run, as ``force_trial`` takes it."""
NO_TABLE = "Choose a text table of time (s) and force (N)."
NO_MODEL = "Choose a saved model: the Model lab saves one once an effect was added."
NO_RIG = "The torque and its limits are those of a rig; connect one."


class ForceTrialFields(QObject):
    """Rows of the protocol's form. Signal ``changed``."""

    changed = Signal()

    def __init__(self, owner: QWidget) -> None:
        super().__init__(owner)
        self._owner = owner
        self._form: QFormLayout | None = None
        self._rig: Rig | None = None
        self.path: Path | None = None
        self.model = described(QPushButton("Choose…"), "trialModel", tip=MODEL_HELP)
        specs = {
            "mean_n": (0.9, 0.0, 20.0, 2, 0.1),
            "amplitude_n": (0.5, 0.0, 10.0, 2, 0.1),
            "duration_s": (8.0, 1.0, LONGEST_S, 1, 1.0),
        }
        self.wanted = WantedFields(owner, "trialWanted", specs)
        self.pairs = described(WholeField(), "trialPairs", accessible="Pairs of runs")
        self.pairs.setRange(1, 50)
        self.pairs.setValue(3)
        self.pairs.setToolTip(
            "Pairs: so many runs of each model, by turns in random order. Two or more give an interval."
        )
        self.model.clicked.connect(self._choose)
        self.wanted.changed.connect(self.changed)
        self.pairs.valueChanged.connect(lambda _value: self.changed.emit())

    def add_to(self, form: QFormLayout) -> None:
        """Stand in a form, below what is there."""
        self._form = form
        form.addRow("Model (&JSON)", self.model)
        self.wanted.add_to(form, "Wa&nted")
        form.addRow("Pair&s", self.pairs)

    def set_shown(self, on: bool) -> None:
        """All rows, or none."""
        assert self._form is not None
        self._form.setRowVisible(self.model, on)
        self._form.setRowVisible(self.pairs, on)
        self.wanted.set_shown(on)

    def show_rig(self, rig: Rig | None) -> None:
        """The rig whose limits hold."""
        self._rig = rig

    @property
    def fields(self) -> tuple[QWidget, ...]:
        """All that can be typed into or chosen."""
        return *self.wanted.fields, self.pairs

    def state(self) -> dict[str, Any]:
        """Every field."""
        return {"model": self.path, "pairs": self.pairs.value(), "wanted": self.wanted.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self._name(state["model"])
        self.pairs.setValue(state["pairs"])
        self.wanted.restore(state["wanted"])

    def show_model(self, path: Path) -> None:
        """Take this model."""
        self._name(path)
        self.changed.emit()

    @property
    def missing(self) -> str:
        """What has to be chosen first, a sentence; empty where nothing has."""
        if self.path is None:
            return NO_MODEL
        return NO_TABLE if self.wanted.waits_for_file else ""

    def trial(self, force: float, rest_s: float) -> ForceTrial:
        """The trial that is set; the operator is asked before its first torque.

        Args:
            force: N, at which the contact is found. rest_s: between runs.

        Raises:
            UserError: a model, a file or a rig is missing, or what is set cannot be.
        """
        from fingerlab.acquisition.protocols.force_trial import ForceTrial, TrialSettings

        if self.missing or self.path is None:
            raise UserError(self.missing)
        if self._rig is None:
            raise UserError(NO_RIG)
        settings = TrialSettings(
            self.path, json.dumps(self.wanted.settings()), self.pairs.value(), force=force, rest_s=rest_s,
            asks=True,
        )  # fmt: skip
        return ForceTrial(settings, self._rig)

    def _choose(self) -> None:
        folder = str(self.path.parent if self.path is not None else Path.home())
        name, _ = QFileDialog.getOpenFileName(self._owner, "Model to send", folder, MODEL_FILTER)
        if name:
            self.show_model(Path(name))

    def _name(self, path: Path | None) -> None:
        self.path = path
        self.model.setText(path.name.replace("&", "&&") if path is not None else "Choose…")
        self.model.setToolTip(MODEL_HELP if path is None else str(path))


class TorquesPlot(QuietPlot):
    """The torque of each model over the wanted force's time, and the rig's limit."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("trialTorques", "Torque of both models and the rig's limit", parent)
        self.plans: Mapping[str, TorquePlan] = {}
        self.name_axes("Motor torque", MILLI_NEWTON_METRE, "Time in the profile (s)")
        self.setToolTip("τ, N m at the gearbox output: what each model needs for the wanted force.")

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if not self.plans:
            return
        drawn = {name: 1e3 * plan.torque for name, plan in self.plans.items()}
        first = next(iter(self.plans.values()))
        for name, torque in drawn.items():
            pen = self.pen("candidate" if name == "found" else "modelled", dashed=name != "found")
            plot.addItem(plain_curve(first.time, torque, pen, f"{name} model"))
        limit = 1e3 * first.torque_limit
        line = pg.InfiniteLine(pos=limit, angle=0, movable=False, pen=self.pen("fault", dashed=True))
        plot.addItem(line, ignoreBounds=True)
        low, high = span_of(np.concatenate(list(drawn.values())))
        high = max(high, 1.12 * limit)
        plot.setRange(xRange=(first.time[0], first.time[-1]), yRange=(min(low, 0.0), high), padding=0)
        self.write(f"limit of the rig, {limit:.4g} mN m", float(first.time[0]), limit, (0.0, 1.0))


class TrialTorques(QWidget):
    """In the place of the live plots while the operator looks at the torque: force, torques, limit."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.force = QuietPlot("trialForce", "Wanted endpoint force over its time")
        self.force.name_axes("Wanted force", NEWTON, "Time in the profile (s)")
        self.force.setToolTip("F, N: what the load cell is to read, compression positive.")
        self.torque = TorquesPlot()
        self.words = remark("Solid: found model; dashed: nominal model. Nothing is sent before you say so.")
        self.words.setObjectName("trialTorqueWords")
        panes = Panes("trial_torques", ((self.force, 2), (self.torque, 3)))
        vbox(self, self.words, (panes, 1), margins=(8, 4, 8, 0), spacing=4)

    def show_plans(self, plans: Mapping[str, TorquePlan]) -> None:
        """The torques of another trial, by model."""
        self.torque.plans = plans
        self.torque.redraw()
        plot, plan = self.force.getPlotItem(), next(iter(plans.values()))
        plot.clear()
        plot.addItem(plain_curve(plan.time, plan.force, self.force.pen("measured"), "wanted"))
        low, high = span_of(plan.force)
        plot.setRange(xRange=(plan.time[0], plan.time[-1]), yRange=(min(low, 0.0), high), padding=0)

"""Above the plots: how much time, held or live, trigger, cursors, and the model beside the measurement."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QMenu,
    QPushButton,
    QToolButton,
    QWidget,
    QWidgetAction,
)

from fingerlab.core.text import ScreenUnit

from ..widgets.fields import choice
from ..widgets.labels import ElidedLabel
from .channels import QUANTITIES, SHOWN
from .plots import WINDOWS_S, LivePlots, Trigger, level_of

NO_MODEL, NOMINAL, FROM_FILE, FILE = "none", "nominal", "choose", "file"
MODELS = {NO_MODEL: "No model", NOMINAL: "Nominal model", FROM_FILE: "Model from a file…"}


class Toolbar(QWidget):
    """Signal ``model_chosen(key)``."""

    model_chosen = Signal(str)

    def __init__(self, plots: LivePlots, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plots = plots
        self.window_s = choice(
            "timeWindow", {str(s): f"{s:g} s" for s in WINDOWS_S}, "Time shown: how much of it."
        )
        self.window_s.setMinimumContentsLength(5)
        self.window_s.setCurrentIndex(2)
        self.hold = _switch("hold", "&Hold", "Keep the picture still; the bench goes on (Ctrl+P).")
        self.cursors = _switch("cursors", "C&ursors", "Two cursors to drag, with differences (Ctrl+K).")
        self.trigger = TriggerButton(plots)
        self.model = choice(
            "model", MODELS, "Model: its torque and force over the measured ones, with what is left."
        )
        self.model.setMinimumContentsLength(14)
        self.times = ElidedLabel()
        self.times.setObjectName("cursorTimes")
        self.times.setAccessibleName("Times of the cursors")
        self.differences = ElidedLabel()
        self.differences.setObjectName("cursorText")
        self.differences.setAccessibleName("At the cursors")
        row = QHBoxLayout()
        row.setSpacing(8)
        for widget in (self.window_s, self.hold, self.cursors, self.trigger):
            row.addWidget(widget)
        row.addWidget(self.times, 1)
        row.addWidget(self.model)
        layout = QGridLayout(self)
        layout.setContentsMargins(8, 4, 8, 0)
        layout.setSpacing(4)
        layout.addLayout(row, 0, 0)
        layout.addWidget(self.differences, 1, 0)
        self.differences.hide()
        self.window_s.activated.connect(self._on_window)
        self.hold.toggled.connect(self._on_hold)
        self.cursors.toggled.connect(plots.show_cursors)
        plots.held_changed.connect(self._on_held)
        plots.cursors_told.connect(self._tell)
        self.model.activated.connect(lambda: self.model_chosen.emit(str(self.model.currentData())))

    def show_model(self, key: str, path: Path | None = None) -> None:
        """Which model is shown."""
        row = self.model.findData(FILE)
        if path is not None:
            if row < 0:
                row = self.model.count() - 1
                self.model.insertItem(row, "", FILE)
            self.model.setItemText(row, path.stem)
        self.model.setCurrentIndex(self.model.findData(key))

    def _on_window(self) -> None:
        self._plots.set_window(float(self.window_s.currentData()))

    def _on_hold(self, on: bool) -> None:
        self._plots.hold(on)
        self._plots.refresh()

    def _on_held(self, on: bool) -> None:
        self.hold.setChecked(on)
        self.hold.setText("Go &live" if on else "&Hold")

    def _tell(self, times: str, differences: str, values: str) -> None:
        for label, text in ((self.times, times), (self.differences, differences)):
            label.setText(text)
            label.setToolTip(values)
        self.differences.setVisible(bool(differences))


class TriggerButton(QToolButton):
    """Opens a small form: on or off, which quantity, which level, upwards or downwards."""

    def __init__(self, plots: LivePlots, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plots = plots
        self.setObjectName("trigger")
        self.setAccessibleName("Trigger")
        self.setToolTip("Start the picture where a quantity crosses a level (Ctrl+G).")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        form = QWidget()
        self.on = QCheckBox("&Trigger")
        self.on.setObjectName("triggerOn")
        self.quantity: QComboBox = choice(
            "triggerQuantity", {name: QUANTITIES[name].title for name in SHOWN}, "Quantity that triggers."
        )
        self.quantity.setCurrentIndex(1)
        self.edge = choice(
            "triggerEdge", {"rising": "Rising", "falling": "Falling"}, "Direction of crossing."
        )
        self.level = QDoubleSpinBox()
        self.level.setObjectName("triggerLevel")
        self.level.setAccessibleName("Level")
        self.level.setRange(-1e5, 1e5)
        self.level.setDecimals(2)
        layout = QGridLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.addWidget(self.on, 0, 0, 1, 2)
        self._unit = QLabel(f"&Level ({self._shown_unit().symbol})")
        self._unit.setBuddy(self.level)
        for row, (label, field) in enumerate(
            ((QLabel("Quantity"), self.quantity), (QLabel("Edge"), self.edge), (self._unit, self.level)), 1
        ):
            layout.addWidget(label, row, 0)
            layout.addWidget(field, row, 1)
        menu = QMenu(self)
        action = QWidgetAction(menu)
        action.setDefaultWidget(form)
        menu.addAction(action)
        self.setMenu(menu)
        self.on.toggled.connect(self._on_toggled)
        self.quantity.activated.connect(self._on_quantity)
        self.edge.activated.connect(self._apply)
        self.level.valueChanged.connect(self._apply)
        self._apply()

    def _on_toggled(self, on: bool) -> None:
        if on:
            self._on_quantity()
        self._apply()

    def _shown_unit(self) -> ScreenUnit:
        return QUANTITIES[str(self.quantity.currentData())].unit

    def _on_quantity(self) -> None:
        column, unit = str(self.quantity.currentData()), self._shown_unit()
        self._unit.setText(f"&Level ({unit.symbol})")
        self.level.setValue(level_of(self._plots.history, column) * unit.factor)
        self._apply()

    def _apply(self) -> None:
        column = str(self.quantity.currentData())
        level = self.level.value() / QUANTITIES[column].unit.factor
        self._plots.trigger = Trigger(self.on.isChecked(), column, level, self.edge.currentData() == "rising")
        self._plots.triggered_at = None
        self.setText(
            f"Trigger: {QUANTITIES[column].title.lower()}" if self.on.isChecked() else "Trigger: off"
        )


def _switch(name: str, text: str, help_text: str) -> QPushButton:
    button = QPushButton(text)
    button.setObjectName(name)
    button.setCheckable(True)
    button.setToolTip(help_text)
    return button

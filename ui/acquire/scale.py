"""The vertical scale of one live plot: automatic, or between two values that the user sets."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QGridLayout,
    QLabel,
    QMenu,
    QToolButton,
    QWidget,
    QWidgetAction,
)

from ..widgets.labels import heading
from .channels import PlotSpec

LARGEST = 1e6


class Scale:
    """Automatic while ``fixed`` is None, else (low, high) in the screen's unit."""

    def __init__(self, least: float) -> None:
        self.least = least
        self.fixed: tuple[float, float] | None = None


class ScaleButton(QToolButton):
    """Opens a small form: automatic, or from where to where."""

    def __init__(self, spec: PlotSpec, scale: Scale, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scale = scale
        self._shown = (-spec.least / 2, spec.least / 2)
        self.setObjectName(f"scale_{spec.key}")
        self.setAccessibleName(f"Scale of {spec.title}")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setToolTip("Scale of this plot: automatic, or as you set it.")
        form = QWidget()
        self.automatic = QCheckBox("&Automatic")
        self.automatic.setChecked(True)
        self.low, self.high = (self._field(name, spec) for name in ("From", "To"))
        layout = QGridLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.addWidget(heading(f"{spec.title} ({spec.unit.symbol})"), 0, 0, 1, 2)
        layout.addWidget(self.automatic, 1, 0, 1, 2)
        for row, (words, field) in enumerate((("&From", self.low), ("&To", self.high)), start=2):
            label = QLabel(words)
            label.setBuddy(field)
            layout.addWidget(label, row, 0)
            layout.addWidget(field, row, 1)
        menu = QMenu(self)
        action = QWidgetAction(menu)
        action.setDefaultWidget(form)
        menu.addAction(action)
        menu.aboutToShow.connect(self._fill)
        self.setMenu(menu)
        self.automatic.toggled.connect(self._changed)
        self.low.valueChanged.connect(self._changed)
        self.high.valueChanged.connect(self._changed)
        self._say()

    def _field(self, name: str, spec: PlotSpec) -> QDoubleSpinBox:
        field = QDoubleSpinBox()
        field.setRange(-LARGEST, LARGEST)
        field.setDecimals(2 if spec.least < 1 else 1)
        field.setAccessibleName(f"{name}, {spec.title}")
        field.setAlignment(Qt.AlignmentFlag.AlignRight)
        field.setEnabled(False)
        return field

    def show_range(self, shown: tuple[float, float]) -> None:
        """What the plot shows now: what the form starts from."""
        self._shown = shown

    def _fill(self) -> None:
        if self._scale.fixed is None:
            for field, value in ((self.low, self._shown[0]), (self.high, self._shown[1])):
                field.blockSignals(True)
                field.setValue(value)
                field.blockSignals(False)

    def _changed(self) -> None:
        hand = not self.automatic.isChecked()
        self.low.setEnabled(hand)
        self.high.setEnabled(hand)
        if hand and self.low.value() < self.high.value():
            self._scale.fixed = self.low.value(), self.high.value()
        elif not hand:
            self._scale.fixed = None
        self._say()

    def _say(self) -> None:
        self.setText("Scale: auto" if self._scale.fixed is None else "Scale: set")

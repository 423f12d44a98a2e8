"""To which values encoder and angle sensors are initialised: from the rig file, or as set here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QGridLayout,
    QLabel,
    QMenu,
    QSizePolicy,
    QToolButton,
    QWidget,
    QWidgetAction,
)

from fingerlab.acquisition.commands import Initialise
from fingerlab.acquisition.initial import LARGEST_DEG

from ..widgets.fields import number
from ..widgets.labels import heading

JOINTS = {"mcp": "MCP", "pip": "PIP"}


class InitialButton(QToolButton):
    """Says the values and opens a small form to change them. Signal ``edited``."""

    edited = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("initialValues")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Values after initialising")
        self.setToolTip(
            "What encoder and angle sensors read once they are initialised: as the rig file says, or as set "
            "here for the posture in which the finger is held."
        )
        self.angles: dict[str, QDoubleSpinBox] = {}
        self.sets: dict[str, QCheckBox] = {}
        self.position = self._angle("initialPosition", "Pulley: its angle after initialising.")
        form = QWidget()
        layout = QGridLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.addWidget(heading("After initialising (°)"), 0, 0, 1, 2)
        label = QLabel("&Pulley")
        label.setBuddy(self.position)
        layout.addWidget(label, 1, 0)
        layout.addWidget(self.position, 1, 1)
        for row, (name, title) in enumerate(JOINTS.items(), start=2):
            box = QCheckBox(f"&{title} set to")
            box.setObjectName(f"initialSet_{name}")
            box.setToolTip("Without it the sensor keeps its calibrated zero.")
            field = self._angle(f"initial_{name}", f"{title}: joint angle after initialising.")
            field.setEnabled(False)
            box.toggled.connect(field.setEnabled)
            box.toggled.connect(self._on_edited)
            self.sets[name], self.angles[name] = box, field
            layout.addWidget(box, row, 0)
            layout.addWidget(field, row, 1)
        menu = QMenu(self)
        action = QWidgetAction(menu)
        action.setDefaultWidget(form)
        menu.addAction(action)
        self.setMenu(menu)
        self._say()

    @property
    def fields(self) -> tuple[QWidget, ...]:
        """All that can be typed into."""
        return self.position, *self.angles.values()

    def command(self) -> Initialise:
        """What is asked of the loop."""
        joints = {
            name: math.radians(self.angles[name].value()) if box.isChecked() else None
            for name, box in self.sets.items()
        }
        return Initialise(math.radians(self.position.value()), **joints)

    def show_command(self, values: Initialise) -> None:
        """Fill the form, such as from the rig file."""
        state: dict[str, Any] = {"position": math.degrees(values.position)}
        for name in JOINTS:
            angle = getattr(values, name)
            state[name] = math.degrees(angle) if angle is not None else self.angles[name].value()
            state[f"set_{name}"] = angle is not None
        self.restore(state)

    def state(self) -> dict[str, Any]:
        """Every field."""
        joints = {name: field.value() for name, field in self.angles.items()}
        sets = {f"set_{name}": box.isChecked() for name, box in self.sets.items()}
        return {"position": self.position.value(), **joints, **sets}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self.position.setValue(state["position"])
        for name, box in self.sets.items():
            self.angles[name].setValue(state[name])
            box.setChecked(state[f"set_{name}"])

    def _angle(self, name: str, help_text: str) -> QDoubleSpinBox:
        field = number(name, 0.0, -LARGEST_DEG, LARGEST_DEG, 1, 1.0, help_text)
        field.valueChanged.connect(self._on_edited)
        return field

    def _on_edited(self) -> None:
        self._say()
        self.edited.emit()

    def _say(self) -> None:
        parts = [f"{self.position.value():g}°"]
        set_here = [name for name, box in self.sets.items() if box.isChecked()]
        parts += [f"{JOINTS[name]} {self.angles[name].value():g}°" for name in set_here]
        if not set_here:
            parts.append("joints as calibrated")
        self.setText(f"To {', '.join(parts)}".replace("-", "−"))

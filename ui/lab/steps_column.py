"""The five steps of the work, at the left: the current one bold, the done ones with their result."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QButtonGroup, QPushButton, QVBoxLayout, QWidget

from ..theme import large_font
from ..widgets.labels import remark

STEPS = {
    "compare": ("Compare", "Measured and modelled, side by side: the whole of the run (F2)."),
    "where": ("Where?", "Where the model fails: over time, phase, speed, angle, tension, run (F3)."),
    "missing": ("Missing?", "Which effect is missing: the candidates, best first (F4)."),
    "add": ("Add", "Add an effect to the model and refit (F5)."),
    "true": ("True?", "Does it hold on runs that the fit has not seen, and what to record next (F6)."),
}


class StepsColumn(QWidget):
    """Five steps. Signal ``chosen(step)`` when the user goes to one."""

    chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("steps")
        self.setAccessibleName("Steps of the Model lab")
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        self._results = {}
        for step, (title, help_text) in STEPS.items():
            button = QPushButton(title)
            button.setProperty("step", "true")
            button.setCheckable(True)
            button.setFont(large_font())
            button.setToolTip(help_text)
            button.setAccessibleName(title)
            button.clicked.connect(lambda _checked=False, s=step: self.chosen.emit(s))
            self._group.addButton(button)
            self._buttons[step] = button
            result = remark()
            result.setContentsMargins(16, 0, 0, 16)
            self._results[step] = result
            layout.addWidget(button)
            layout.addWidget(result)

    def set_results(self, results: dict[str, str]) -> None:
        """Show what each done step found; the others stay empty."""
        for step, label in self._results.items():
            text = results.get(step, "")
            label.setText(_shorten(text))
            label.setToolTip(text)
            self._buttons[step].setAccessibleDescription(text)

    def set_current(self, step: str) -> None:
        """Make a step the current one (without going there)."""
        self._buttons[step].setChecked(True)

    def current(self) -> str:
        """The step that is bold."""
        return next((step for step, button in self._buttons.items() if button.isChecked()), "compare")

    def button(self, step: str) -> QPushButton:
        return self._buttons[step]

    def result(self, step: str) -> str:
        """The words below a step."""
        return self._results[step].toolTip()


def _shorten(text: str, limit: int = 64) -> str:
    """A few words; the whole text is in the tooltip."""
    if len(text) <= limit:
        return text
    return text[: limit - 1].rsplit(" ", 1)[0].rstrip(",;:.") + " …"

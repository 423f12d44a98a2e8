"""Which equation and which run are shown, and the error of that equation before and now."""

from __future__ import annotations

import re
from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QButtonGroup, QComboBox, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QWidget

from fingerlab.diagnosis.answer.results import EQUATION_TITLES, Comparison, EquationError
from fingerlab.sessions.model import Session

from .equations import FLOOR_HELP, equation_text
from .stretches import joined
from .wording import error_texts, run_text


class ComparisonBar(QWidget):
    """Signal ``changed`` when the user takes another equation or run."""

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._comparisons: dict[tuple[str, str], Comparison] = {}
        self._sessions: dict[str, Session] = {}
        self._error = ("", "")
        self._layout = QHBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(4)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for equation in EQUATION_TITLES:
            self._add_button(equation)
        self.runs = QComboBox()
        self.runs.setObjectName("runs")
        self.runs.setAccessibleName("Run shown")
        self.runs.setToolTip("Run shown (Alt+Up, Alt+Down for the next).")
        self.runs.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.runs.setMinimumContentsLength(4)
        self.runs.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.runs.currentIndexChanged.connect(self._on_run)
        self.error = QLabel()
        self.error.setObjectName("equationError")
        self.error.setToolTip(f"Error on held-out runs: nominal model → present model. {FLOOR_HELP}")
        bold = self.error.font()
        bold.setBold(True)
        self._letters = QFontMetrics(bold)
        self._layout.addSpacing(4)
        self._layout.addWidget(self.runs, 1)
        self._layout.addSpacing(8)
        self._layout.addWidget(self.error)

    def _add_button(self, equation: str) -> None:
        text = equation_text(equation)
        button = QPushButton(text.button)
        button.setObjectName(f"equation_{equation}")
        button.setCheckable(True)
        button.setToolTip(text.help)
        button.setAccessibleName(EQUATION_TITLES[equation])
        button.clicked.connect(self._on_equation)
        button.hide()
        self._group.addButton(button)
        self._buttons[equation] = button
        self._layout.addWidget(button)

    # what there is

    def show_comparisons(
        self, comparisons: Sequence[Comparison], sessions: Sequence[Session], wanted: tuple[str, str] | None
    ) -> None:
        """Offer the equations and runs of a diagnosis.

        ``wanted`` is the equation and run to start at; None keeps the present choice where it exists.
        """
        keep_equation, keep_run = self.equation(), self.runs.currentData()
        self._comparisons = joined(comparisons)
        self._sessions = {c.session: _session_of(c, sessions) for c in comparisons} if sessions else {}
        present = [e for e in EQUATION_TITLES if any(key[0] == e for key in self._comparisons)]
        for equation, button in self._buttons.items():
            button.setVisible(equation in present)
        if not present:
            self.runs.clear()
            return
        first = wanted[0] if wanted is not None else keep_equation
        chosen = first if first in present else present[0]
        self._buttons[chosen].setChecked(True)
        self._fill_runs(chosen, keep_run if wanted is None else self._key_of(chosen, wanted[1]))
        self.changed.emit()

    def go_to(self, equation: str, run: str) -> None:
        """Show another equation and run."""
        if self._key_of(equation, run) is not None:
            self._buttons[equation].setChecked(True)
            self._fill_runs(equation, self._key_of(equation, run))
            self.changed.emit()

    def equation(self) -> str | None:
        """The equation shown."""
        return next((name for name, button in self._buttons.items() if button.isChecked()), None)

    def comparison(self) -> Comparison | None:
        """The equation and run shown."""
        equation, run = self.equation(), self.runs.currentData()
        return self._comparisons.get((equation, run)) if equation is not None and run is not None else None

    def show_error(self, before: EquationError | None, now: EquationError | None) -> None:
        """The error of the equation shown, with the nominal model and now."""
        self._error = ("", "")
        if before is not None and now is not None:
            was, is_now, floor, unit = error_texts(before, now)
            change = f"{was} → <b>{is_now}</b>" if before is not now else f"<b>{is_now}</b>"
            self._error = (f"error {change} {unit}", f", floor {floor}")
        self._fit_error()

    def _fit_error(self) -> None:
        """The floor is left out where room is short; the table below and the plot show it, too."""
        error, floor = self._error
        others = sum(
            button.sizeHint().width() + 4 for button in self._buttons.values() if button.isVisibleTo(self)
        )
        short, plain = (re.sub("<[^>]*>", "", text) for text in (error, error + floor))
        # The bar may get as narrow as the short wording lets it.
        self.error.setMinimumWidth(self._letters.horizontalAdvance(short))
        needed = others + self.runs.minimumSizeHint().width() + 24 + self._letters.horizontalAdvance(plain)
        self.error.setText(error + floor if needed <= self.width() else error)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_error()

    # choice

    def choose_equation(self, equation: str) -> None:
        """The same as a click on the equation's button."""
        if self._buttons[equation].isVisibleTo(self):
            self._buttons[equation].click()

    def step_run(self, step: int) -> None:
        """The next (1) or previous (-1) run."""
        row = self.runs.currentIndex() + step
        if 0 <= row < self.runs.count():
            self.runs.setCurrentIndex(row)

    def _fill_runs(self, equation: str, key: str | None) -> None:
        many = len({comparison.session for comparison in self._comparisons.values()}) > 1
        self.runs.blockSignals(True)
        self.runs.clear()
        for (name, run), comparison in self._comparisons.items():
            if name == equation:
                text = run_text(comparison, self._sessions.get(comparison.session), many)
                self.runs.addItem(text, run)
                self.runs.setItemData(self.runs.count() - 1, text, Qt.ItemDataRole.ToolTipRole)
        rows = [row for row in range(self.runs.count()) if self.runs.itemData(row) == key]
        self.runs.setCurrentIndex(rows[0] if rows else 0)
        self.runs.blockSignals(False)

    def _key_of(self, equation: str, run: str) -> str | None:
        for (name, key), comparison in self._comparisons.items():
            if name == equation and comparison.run == run:
                return key
        return None

    def _on_equation(self) -> None:
        equation = self.equation()
        if equation is not None:
            self._fill_runs(equation, self.runs.currentData())
            self.changed.emit()

    def _on_run(self, row: int) -> None:
        if row >= 0:
            self.changed.emit()


def _session_of(comparison: Comparison, sessions: Sequence[Session]) -> Session:
    """The session that a comparison names by path, file name or title."""
    for session in sessions:
        if comparison.session in (str(session.path), session.path.name, session.path.stem, session.title):
            return session
    return sessions[0]

"""Why the chosen candidate is where it is: words, strength, fingerprint."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from fingerlab.identify.results import Candidate, Diagnosis, Fingerprint

from ..widgets.labels import ElidedLabel, remark
from fingerlab.report.screen import estimate_text
from .equations import EQUATION_TEXTS, FLOOR_HELP, equation_text, family_title
from .fingerprint_plot import FingerprintPlot
from .legend import FINGERPRINT, RESIDUAL_ONLY, LegendKeys
from .wording import OUTCOME_TITLES, find_candidate, outcome_explanation, parameter_words


class EvidencePanel(QWidget):
    """Shows one candidate, or one of the two outcomes, with the picture that supports it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title = ElidedLabel()
        self.title.setProperty("role", "heading")
        font = self.title.font()
        font.setBold(True)
        self.title.setFont(font)
        self.title.setObjectName("evidenceTitle")
        self.explanation = remark()
        self.explanation.setObjectName("explanation")
        self.strength = ElidedLabel()
        self.strength.setObjectName("strength")
        self.plot = FingerprintPlot()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        self.strength.setAlignment(Qt.AlignmentFlag.AlignRight)
        head = QHBoxLayout()
        head.setContentsMargins(0, 0, 8, 0)
        head.setSpacing(16)
        head.addWidget(self.title, 2)
        head.addWidget(self.strength, 3)
        layout.addLayout(head)
        layout.addWidget(self.explanation)
        keys = QHBoxLayout()
        keys.setContentsMargins(72, 0, 0, 0)
        self.keys = LegendKeys(FINGERPRINT)
        keys.addWidget(self.keys)
        keys.addStretch(1)
        layout.addLayout(keys)
        layout.addWidget(self.plot, 1)

    def show_choice(self, key: str | None, diagnosis: Diagnosis | None) -> None:
        """Show an effect (by id) or an outcome of a diagnosis; None clears the panel."""
        if key is None or diagnosis is None:
            for label in (self.title, self.explanation, self.strength):
                label.setText("")
            self.plot.show_fingerprint(None)
            return
        candidate = find_candidate(diagnosis, key)
        if candidate is not None:
            self._show_candidate(candidate, diagnosis)
        elif key in OUTCOME_TITLES:
            self._show_outcome(key, diagnosis)

    def _show_candidate(self, candidate: Candidate, diagnosis: Diagnosis) -> None:
        places = ", ".join(_place(name) for name in candidate.equations)
        self.title.setText(candidate.title)
        self.title.setToolTip(f"{candidate.title} acts in: {places}" if places else candidate.title)
        self.explanation.setText(candidate.explanation)
        self.explanation.setToolTip(candidate.explanation)
        self._set_strength(
            "   ".join(
                f"{parameter_words(name)} {estimate_text(estimate)}"
                for name, estimate in candidate.parameters.items()
            )
        )
        self.keys.set_keys(FINGERPRINT)
        self.plot.show_fingerprint(candidate.fingerprint, _floor(candidate.fingerprint, diagnosis))
        self.plot.setToolTip(_plot_help(candidate.fingerprint, with_curve=True))

    def _show_outcome(self, outcome: str, diagnosis: Diagnosis) -> None:
        self.title.setText(OUTCOME_TITLES[outcome])
        text = outcome_explanation(outcome, diagnosis)
        self.explanation.setText(text)
        self.explanation.setToolTip(text)
        self._set_strength("")
        shown = next((c.fingerprint for c in diagnosis.candidates if c.fingerprint is not None), None)
        self.keys.set_keys(RESIDUAL_ONLY)
        self.plot.show_fingerprint(shown, _floor(shown, diagnosis), with_curve=False)
        self.plot.setToolTip(_plot_help(shown, with_curve=False))

    def _set_strength(self, text: str) -> None:
        self.strength.setText(text)
        lines = text.replace("   ", "\n")
        self.strength.setToolTip(f"{lines}\nFitted strength with its 90 % interval." if text else "")


def _place(name: str) -> str:
    title = equation_text(name).quantity if name in EQUATION_TEXTS else family_title(name)
    return title if title[:2].isupper() else title.lower()


def _floor(fingerprint: Fingerprint | None, diagnosis: Diagnosis) -> float | None:
    """The floor of the fingerprint's equation, where it is in the fingerprint's unit."""
    if fingerprint is None:
        return None
    for comparison in diagnosis.comparisons:
        if comparison.equation == fingerprint.equation and comparison.unit == fingerprint.value_unit:
            return comparison.floor
    return None


def _plot_help(fingerprint: Fingerprint | None, with_curve: bool) -> str:
    if fingerprint is None:
        return ""
    text = (
        f"Residual of the {equation_text(fingerprint.equation).quantity} equation, averaged in bins of "
        f"{fingerprint.coordinate}: points with the 90 % interval of the mean (orange). "
    )
    if with_curve:
        text += "What the fitted effect itself contributes: green line. "
    return text + "Grey band: floor. " + FLOOR_HELP

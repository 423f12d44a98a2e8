"""Why the chosen candidate is where it is: words, strength, fingerprint."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from fingerlab.core.text import estimate_text, printed
from fingerlab.diagnosis.answer.results import EQUATION_TITLES, Candidate, Diagnosis, Fingerprint
from fingerlab.report.diagnosis_words import FAMILY_TITLES, in_sentence, listed, parameter_titles, suspects

from ..theme import small_font
from ..widgets.labels import ElidedLabel, WholeLabel
from .equations import FLOOR_HELP, equation_text
from .fingerprint_plot import FingerprintPlot
from .legend import FINGERPRINT, LOOK_ALIKES, RESIDUAL_ONLY, LegendKeys
from .wording import OUTCOME_TITLES, find_candidate, outcome_explanation

LEAST_PLOT = 104
"""Height of the fingerprint from which its shape is seen, px."""


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
        self.explanation = WholeLabel()
        self.explanation.setFont(small_font())
        self.explanation.setObjectName("explanation")
        self.plot = FingerprintPlot()
        self.plot.setMinimumHeight(LEAST_PLOT)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addWidget(self.title)
        layout.addWidget(self.explanation)
        keys = QHBoxLayout()
        keys.setContentsMargins(72, 0, 0, 0)
        self.keys = LegendKeys(FINGERPRINT, wraps=True)
        keys.addWidget(self.keys)
        layout.addLayout(keys)
        layout.addWidget(self.plot, 1)

    def show_choice(self, key: str | None, diagnosis: Diagnosis | None) -> None:
        """Show an effect (by id) or an outcome of a diagnosis; None clears the panel."""
        if key is None or diagnosis is None:
            for label in (self.title, self.explanation):
                label.setText("")
            self.plot.show_fingerprint(None)
            return
        candidate = find_candidate(diagnosis, key)
        if candidate is not None:
            self._show_candidate(candidate, diagnosis)
        elif key in OUTCOME_TITLES:
            self._show_outcome(key, diagnosis)

    def _show_candidate(self, candidate: Candidate, diagnosis: Diagnosis) -> None:
        self.title.setText(candidate.title)
        words = printed(candidate.explanation)
        self.explanation.setText(words)
        self.explanation.setToolTip(words)
        self.title.setToolTip(_strength(candidate))
        shown, alike = candidate.fingerprint, look_alikes(candidate, diagnosis)
        self.keys.set_keys(LOOK_ALIKES if alike else FINGERPRINT)
        self.plot.show_fingerprint(shown, _floor(shown, diagnosis), look_alikes=alike)
        dotted = f"Dotted, what could not be told from it: {listed(list(map(in_sentence, alike)))}. "
        self.plot.setToolTip(_plot_help(shown, with_curve=True) + (dotted.rstrip() if alike else ""))

    def _show_outcome(self, outcome: str, diagnosis: Diagnosis) -> None:
        self.title.setText(OUTCOME_TITLES[outcome])
        text = outcome_explanation(outcome, diagnosis)
        self.explanation.setText(text)
        self.explanation.setToolTip(text)
        shown = next((c.fingerprint for c in diagnosis.candidates if c.fingerprint is not None), None)
        self.keys.set_keys(RESIDUAL_ONLY)
        self.plot.show_fingerprint(shown, _floor(shown, diagnosis), with_curve=False)
        self.plot.setToolTip(_plot_help(shown, with_curve=False))


def look_alikes(candidate: Candidate, diagnosis: Diagnosis) -> dict[str, Fingerprint]:
    """Of an effect of the set: the others, by title, whose curves can be drawn over the same residual."""
    own, alike = candidate.fingerprint, suspects(diagnosis)
    if own is None or candidate.effect not in alike:
        return {}
    return {
        one.title: one.fingerprint
        for one in diagnosis.candidates
        if one.effect in alike
        and one is not candidate
        and one.fingerprint is not None
        # Of other coordinates the residual is another picture.
        and (one.fingerprint.equation, one.fingerprint.coordinate) == (own.equation, own.coordinate)
    }


def _strength(candidate: Candidate) -> str:
    """Where the effect acts and how strong it is, a line each."""
    lines = [candidate.title]
    if candidate.equations:
        lines.append(f"acts in: {listed([_place(name) for name in candidate.equations])}")
    titles = parameter_titles(candidate.effect, list(candidate.parameters))
    lines += [f"{titles[name]} {estimate_text(p)}" for name, p in candidate.parameters.items()]
    if candidate.parameters:
        lines.append("fitted, with 90 % interval")
    return "\n".join(lines)


def _place(name: str) -> str:
    return in_sentence(EQUATION_TITLES.get(name) or FAMILY_TITLES.get(name, name))


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

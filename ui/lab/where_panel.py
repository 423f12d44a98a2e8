"""Where does it fail? The residual of the equation shown over what may be to blame, and the worst place."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from fingerlab.diagnosis.answer.results import Comparison
from fingerlab.diagnosis.answer.where import COORDINATES, Profile, most_orderly, profile
from fingerlab.report.diagnosis_words import axis_title, bin_words, miss_words, worst_words

from ..widgets.labels import ElidedLabel, remark
from .equations import FLOOR_HELP, equation_text
from .legend import WHERE, LegendKeys
from .where_plot import WherePlot

HELP = (
    "Bars: root mean square of measured less modelled in each bin, over all runs. Points: its mean with the "
    "90 % interval; a mean far from zero is what a missing effect leaves, bars without it are scatter. "
    f"Click a bar, or use ← and →, to see it in the curves above. {FLOOR_HELP}"
)


class WherePanel(QWidget):
    """Signal ``place_chosen(profile, bin)``: a bin was chosen by the user."""

    place_chosen = Signal(object, int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._comparisons: tuple[Comparison, ...] = ()
        self._profiles: dict[str, Profile] = {}
        self._equation = ""
        self._by_hand = ""
        self.title = ElidedLabel()
        self.title.setProperty("role", "heading")
        font = self.title.font()
        font.setBold(True)
        self.title.setFont(font)
        self.coordinate = QComboBox()
        self.coordinate.setObjectName("whereCoordinate")
        self.coordinate.setAccessibleName("Residual over")
        self.coordinate.setToolTip(
            "What the residual is drawn over; at first that in which its mean is the least like scatter."
        )
        label = QLabel("&Over")
        label.setBuddy(self.coordinate)
        self.words = remark()
        self.words.setObjectName("whereWords")
        self.plot = WherePlot()
        self.plot.setToolTip(HELP)
        top = QHBoxLayout()
        top.setSpacing(8)
        top.addWidget(self.title, 1)
        top.addWidget(label)
        top.addWidget(self.coordinate)
        keys = QHBoxLayout()
        keys.setContentsMargins(72, 0, 0, 0)
        keys.addWidget(LegendKeys(WHERE, wraps=True))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addLayout(top)
        layout.addWidget(self.words)
        layout.addLayout(keys)
        layout.addWidget(self.plot, 1)
        self.coordinate.activated.connect(self._on_coordinate)
        self.plot.chosen.connect(self._on_bin)

    def show_equation(self, comparisons: Sequence[Comparison], equation: str | None) -> None:
        """The residual of another equation, or of another model; the coordinate chosen by hand stays."""
        given = tuple(comparisons)
        same = given == () and not self._comparisons
        if same or (equation == self._equation and _identical(given, self._comparisons)):
            return
        self._comparisons, self._equation = given, equation or ""
        made = {name: profile(given, self._equation, name) for name in COORDINATES} if given else {}
        self._profiles = {name: one for name, one in made.items() if one is not None}
        self.title.setText(f"Residual of {equation_text(self._equation).quantity}" if self._profiles else "")
        self.coordinate.clear()
        for name, one in self._profiles.items():
            self.coordinate.addItem(axis_title(one), name)
        wanted = self._by_hand if self._by_hand in self._profiles else most_orderly(self._profiles)
        self.coordinate.setCurrentIndex(self.coordinate.findData(wanted))
        self._show()

    @property
    def found(self) -> Profile | None:
        """The profile that is shown."""
        return self._profiles.get(str(self.coordinate.currentData()))

    def choose_worst(self) -> None:
        """Mark the worst bin, as a click on it does."""
        if self.found is not None:
            self.plot.choose(self.found.worst)

    def _on_coordinate(self) -> None:
        self._by_hand = str(self.coordinate.currentData())
        self._show()
        self.choose_worst()

    def _show(self) -> None:
        found = self.found
        self.plot.show_profile(found)
        self.words.setText(worst_words(found) if found is not None else "")

    def _on_bin(self, number: int) -> None:
        found = self.found
        if found is None:
            return
        words = worst_words(found)
        if number != found.worst:
            words += f" Chosen: {bin_words(found, number)}: {miss_words(found, number)}."
        self.words.setText(words)
        self.place_chosen.emit(found, number)


def _identical(one: Sequence[Comparison], other: Sequence[Comparison]) -> bool:
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))

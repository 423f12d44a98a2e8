"""The review of one session: a run against time, others over it, their strokes, cursors with differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from PySide6.QtCore import QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtWidgets import QComboBox, QGridLayout, QPushButton, QSizePolicy, QWidget

from fingerlab.core.text import AMPERE, ScreenUnit, with_minus
from fingerlab.library.index import started_at
from fingerlab.library.reviewing import Cycles, markers_of, period_of
from fingerlab.report.line_units import LineUnits, line_units
from fingerlab.sessions.model import Array, Run, Session

from ..widgets.free_plots import FreePlots, PlotsButton
from ..widgets.layout import FLUSH, WrappedRow, described, vbox
from ..widgets.tables import ElidedLabel, remark
from .review_data import PANES, Layer, ReviewChannel, ReviewData, channels_of
from .review_pane import Overlays, clock_text
from .review_plots import ReviewPlots
from .session_table import duration, run_words

if TYPE_CHECKING:
    from ..app.context import Settings

CURSOR_MS = 60
FREE_MS = 200
"""After a move, before the user's own plots follow it."""
FILL_MS = 300
"""While a long run is read, its picture grows this often."""


class ReviewPage(QWidget):
    """Signals: back_asked; cut_asked: between the cursors; beside_asked: a session whose runs are laid over;
    changed: another run, or cursors on or off; refused(sentence): why another run cannot be laid over.
    """

    back_asked = Signal()
    cut_asked = Signal()
    beside_asked = Signal()
    changed = Signal()
    refused = Signal(str)

    def __init__(self, data: ReviewData, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.data = data
        self.session: Session | None = None
        self.overlays = Overlays(self)
        self._strokes: dict[int, Cycles] = {}
        self.plots = ReviewPlots()
        self.back = _button("reviewBack", "‹ &All sessions", "Back to the table (Alt+Left).")
        self.runs = _as_choice(
            QComboBox(), "reviewRun", "Run shown", "Run shown (Alt+Up, Alt+Down for the next)."
        )
        self.over = _as_choice(
            self.overlays.field,
            "reviewOver",
            "Run over it",
            "Lay another run over this one, dashed, from its own start; up to four, of other sessions, too.",
        )
        self.strokes = _switch(
            "strokes", "Stro&kes", "The strokes of a sine over one another, with those of the runs over it."
        )
        self.cursors = _switch("reviewCursors", "&Cursors", "Two cursors to drag, with differences (Ctrl+K).")
        self.heights = _switch(
            "heights", "Fi&t heights", "Scale each plot to what is seen of it, not to the run."
        )
        self.free = FreePlots(
            free_channels(LineUnits()), pane_titles(LineUnits()), ("motor_torque", "motor_position")
        )
        self.arrange = PlotsButton(self.free)
        self.cut = _button("cut", "C&ut…", "What lies between the cursors as a session of its own.")
        self.values = described(ElidedLabel(), "reviewValues", accessible="At the cursors")
        self.state = described(remark(wrap=False), "reviewState")
        self._timer = QTimer(self, singleShot=True, interval=CURSOR_MS)
        self.cut.setEnabled(False)
        self._moved = QTimer(self, singleShot=True, interval=FREE_MS)
        self._growing = QTimer(self, singleShot=True, interval=FILL_MS)
        self._build()
        self._connect()
        self._tell_units(LineUnits())

    def _build(self) -> None:
        buttons = (self.strokes, self.heights, self.cursors, self.arrange, self.free.switch, self.cut)
        row = WrappedRow((self.back, (self.runs, 3), (self.over, 2), *buttons))
        top = QGridLayout()
        top.setContentsMargins(16, 8, 16, 0)
        top.setSpacing(4)
        top.addWidget(row, 0, 0, 1, 2)
        top.addWidget(self.values, 1, 0)
        top.addWidget(self.state, 1, 1, Qt.AlignmentFlag.AlignRight)
        top.addWidget(self.overlays.row, 2, 0, 1, 2)
        top.setColumnStretch(0, 1)
        vbox(self, top, (self.free.beside(self.plots), 1), margins=FLUSH, spacing=4)

    def _connect(self) -> None:
        self.back.clicked.connect(self.back_asked)
        self.cut.clicked.connect(self.cut_asked)
        self.runs.currentIndexChanged.connect(self._on_run)
        self.overlays.changed.connect(self._show)
        self.overlays.beside_asked.connect(self.beside_asked)
        self.overlays.refused.connect(self.refused)
        self.strokes.toggled.connect(self._on_strokes)
        self.cursors.toggled.connect(self._on_cursors)
        self.heights.toggled.connect(self._on_heights)
        self.plots.samples_wanted.connect(self.data.want_samples)
        self.plots.cursors_moved.connect(lambda *_: self._timer.start())
        self._timer.timeout.connect(self._ask_values)
        self.free.changed.connect(lambda: self.plots.leave_out(self.free.left_out))
        self.free.wanted.connect(self._ask_free)
        self.plots.top.getViewBox().sigXRangeChanged.connect(lambda *_: self._moved.start())
        self._moved.timeout.connect(self._ask_free)
        self.data.freed.connect(self._on_freed)
        self._growing.timeout.connect(self._grow)
        self.data.filled.connect(self._on_filled)
        self.data.sampled.connect(self._on_sampled)
        self.data.valued.connect(self._on_valued)
        self.data.cycled.connect(self._on_cycled)

    # what is shown

    def show_session(self, session: Session | None, others: Sequence[Session] = ()) -> None:
        """Review another session, from its first run; None lets go of it. Runs of ``others`` are offered."""
        self.data.stop()
        self.session = session
        with QSignalBlocker(self.runs):
            self.runs.clear()
            if session is not None:
                for run in session.runs:
                    self.runs.addItem(run_words(run, session), run.name)
            self.runs.setCurrentIndex(0)
        self.overlays.offer_all((session, *others) if session is not None else ())
        self._tell_units(line_units((session,) if session is not None else ()))
        self._on_run()
        self.plots.setFocus()

    def _tell_units(self, line: LineUnits) -> None:
        channels, titles = channels_of(line), pane_titles(line)
        told = (name for spec in PANES if spec.title in titles for name in spec.channels)
        self.plots.setToolTip("\n".join(channels[name].help() for name in told))
        self.free.call(titles)

    def show_beside(self, session: Session) -> None:
        """Offer the runs of another session, too, and lay the first of them over."""
        if self.session is not None:
            self.overlays.offer_beside(session)

    @property
    def run(self) -> Run | None:
        """The run shown."""
        name = self.runs.currentData()
        runs = self.session.runs if self.session is not None else ()
        return next((run for run in runs if run.name == name), None)

    @property
    def began(self) -> datetime | None:
        """When the run's time was 0, by the clock of the bench; None where nobody knows."""
        run = self.run
        return started_at(self.session, run) if self.session is not None and run is not None else None

    def _on_run(self) -> None:
        for button in (self.strokes, self.cursors):
            button.setChecked(False)
        run = self.run
        self.strokes.setEnabled(run is not None and period_of(run) is not None)
        self._show()
        self.changed.emit()

    def _show(self) -> None:
        run, session = self.run, self.session
        if run is None or session is None:
            self.plots.show_layers([], None, ())
            return
        layers, overs = [self.data.layer(0, session, run)], self.overlays.shown_over(run)
        for over in overs:
            layer = self.data.layer(over.number, over.session, over.run)
            layer.name, layer.shift = over.name, layers[0].pyramid.first_time - layer.pyramid.first_time
            layers.append(layer)
        self.overlays.row.show_overs(overs)
        self.plots.show_layers(layers, self.began, markers_of(run))
        self.free.offer(channels_of_run(run, layers[0].line))
        self._ask_free()
        if self.strokes.isChecked():
            self._ask_strokes()
        else:
            self._tell_state(1.0 if layers[0].pyramid.complete else 0.0)

    def remember(self, settings: Settings) -> None:
        """Arrange the plots as they were left, and keep every change."""
        self.free.remember(settings, "review")

    def _ask_free(self) -> None:
        """Samples of what is in view, for the user's own plots."""
        run, layers = self.run, self.plots.layers
        if run is None or not layers or not self.free.plots or self.strokes.isChecked():
            return
        left, right = self.plots.top.viewRange()[0]
        self.data.want_free(layers[0], self.free.names(self.free.plots), left, right)

    def _on_freed(self, samples: Mapping[str, Array]) -> None:
        if self.run is not None:
            self.free.show_samples(samples, self.run.sample_rate_hz)

    def _tell_state(self, share: float) -> None:
        run = self.run
        if run is None:
            return
        clock = "" if self.began is not None else ", clock time not in the file"
        reading = "" if share >= 1.0 else f", reading {100 * share:.0f} %"
        self.state.setText(f"{duration(run.seconds)} at {run.sample_rate_hz:g} Hz{clock}{reading}")

    # data

    def _on_filled(self, number: int, share: float) -> None:
        layers = self.plots.layers
        layer = next((one for one in layers if one.number == number), None)
        if layer is None:
            return
        if number == 0 and not self.strokes.isChecked():
            self._tell_state(share)
        elif share >= 1.0:
            layer.shift = layers[0].pyramid.first_time - layer.pyramid.first_time
        if share >= 1.0:
            self._grow()
        elif not self._growing.isActive():
            self._growing.start()

    def _grow(self) -> None:
        self._growing.stop()
        self.plots.set_heights()
        self.plots.feed()
        if self.plots.cycles is None:
            self.plots.set_limits()

    def _on_sampled(self, layer: Layer) -> None:
        if any(layer is one for one in self.plots.layers):
            self.plots.feed()

    def _on_strokes(self, on: bool) -> None:
        self.cursors.setChecked(False)
        self.cursors.setEnabled(not on)  # the time of a stroke is not the run's
        if on and self.plots.layers:
            self._ask_strokes()
        else:
            self._strokes = {}
            self.plots.show_cycles({})
            self._tell_state(1.0)

    def _ask_strokes(self) -> None:
        """Those of each run that has any; they come one after the other."""
        self._strokes = {}
        for layer in self.plots.layers:
            if period_of(layer.run) is not None:
                self.data.want_cycles(layer)

    def _on_cycled(self, layer: Layer, cycles: Cycles) -> None:
        if not self.strokes.isChecked() or not any(layer is one for one in self.plots.layers):
            return
        self._strokes[layer.number] = cycles
        if 0 not in self._strokes:
            return
        self.plots.show_cycles(self._strokes)
        first, others = self._strokes[0], len(self._strokes) - 1
        many = f"{first.count} of {first.total}" if first.count < first.total else str(first.total)
        beside = f", with those of {others} other run{'s' * (others > 1)}" if others else ""
        without = [one.name for one in self.plots.layers if period_of(one.run) is None]
        lacking = f"; none in {', '.join(without)}" if without else ""
        self.state.setText(f"{many} strokes of {first.period:.4g} s over one another{beside}{lacking}")

    def _on_heights(self, on: bool) -> None:
        self.plots.fits_heights = on
        self.plots.set_heights()

    # cursors

    def _on_cursors(self, on: bool) -> None:
        self.values.setText("")
        self.cut.setEnabled(on)
        self.plots.show_cursors(on)
        self.changed.emit()

    def _ask_values(self) -> None:
        cursors = self.plots.cursors
        if cursors is not None and self.plots.layers:
            self.data.want_values(self.plots.layers[0], cursors)

    def _on_valued(self, found: list[tuple[float, dict[str, float]]]) -> None:
        if self.plots.cursors is None or len(found) != 2:
            return
        channels = channels_of(self.plots.layers[0].line)
        head, lines = cursor_texts(found[0], found[1], self.began, channels)
        self.values.setText(head)
        self.values.setToolTip("\n".join(lines))


def free_channels(line: LineUnits) -> dict[str, ReviewChannel]:
    """What one's own plots know of an axis with these units: the current as well."""
    current = ReviewChannel(line.called("motor_current"), AMPERE, 3, "i")
    return {**channels_of(line), "motor_current": current}


def channels_of_run(run: Run, line: LineUnits) -> dict[str, ReviewChannel]:
    """Every channel of a run: those of the contract, and what else was recorded, as it stands there."""
    own, known = (name for name in run.units if name != "time"), free_channels(line)
    return {
        name: known.get(name) or ReviewChannel(name.replace("_", " "), ScreenUnit(run.units[name], 1.0), 4)
        for name in own
    }


def pane_titles(line: LineUnits) -> dict[str, str]:
    """The stacked plots that an axis with these units can have, by the key under which they are left out."""
    return {spec.title: title for spec in PANES if (title := spec.title_of(line))}


def cursor_texts(
    a: tuple[float, dict[str, float]],
    b: tuple[float, dict[str, float]],
    began: datetime | None,
    channels: Mapping[str, ReviewChannel],
) -> tuple[str, list[str]]:
    """What the cursors say: differences in one line, and every value in lines of their own."""
    (time_a, at_a), (time_b, at_b) = a, b
    change = time_b - time_a
    clock = [f" ({clock_text(began, t, 0.001)})" if began is not None else "" for t in (time_a, time_b)]
    places = f"A {time_a:.3f} s{clock[0]}, B {time_b:.3f} s{clock[1]}"
    rate = f" ({1 / abs(change):.3g} Hz)" if change else ""
    differences, lines = [f"{change:+.3f} s{rate}"], [places]
    for name, value in at_a.items():
        shown = channels[name]
        if value == value and at_b[name] == at_b[name]:
            sign = "+" if at_b[name] >= value else ""
            differences.append(f"{shown.title} {sign}{shown.text(at_b[name] - value)}")
            lines.append(f"{shown.title}: A {shown.text(value)}, B {shown.text(at_b[name])}")
    return with_minus(f"B − A: {', '.join(differences)}"), [with_minus(text) for text in lines]


def _button(name: str, text: str, help_text: str) -> QPushButton:
    return described(QPushButton(text), name, tip=help_text)


def _switch(name: str, text: str, help_text: str) -> QPushButton:
    button = _button(name, text, help_text)
    button.setCheckable(True)
    return button


def _as_choice(field: QComboBox, name: str, title: str, help_text: str) -> QComboBox:
    field.setObjectName(name)
    field.setAccessibleName(title)
    field.setToolTip(help_text)
    field.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
    field.setMinimumContentsLength(8)
    field.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    return field

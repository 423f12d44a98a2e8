"""The result of a calibration in words and pictures: accept, accept with a reason, reject."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QLineEdit, QVBoxLayout, QWidget

from fingerlab.calibration import Calibration
from fingerlab.calibration.outcome import CalibrationOutcome, amount_text, compare
from fingerlab.calibration.sensors import Sensor
from fingerlab.calibration.store import CalibrationRecord
from fingerlab.core.text import ParameterEstimate, decimals_for, fixed, held_together, printed, r2_text

from ..widgets.fields import ActionButton
from ..widgets.layout import FLUSH, SideRoom, described, hbox
from ..widgets.tables import WholeLabel, heading, remark
from .calibration_pictures import FitPlot, ResidualPlot

SENSOR_NAMES = {"load-cell": "Load cell", "mcp": "MCP angle sensor", "pip": "PIP angle sensor"}


def estimate_words(sensor: Sensor, estimate: ParameterEstimate) -> str:
    """Value and half width of its 90 % interval, as ``11.194 ± 0.003 N/V``."""
    factor = sensor.screen.factor
    unit = estimate.unit.replace("rad", "°")
    half = factor * (estimate.high - estimate.low) / 2
    digits = decimals_for(half)
    behind = unit if unit.startswith("°") else f" {unit}"
    return f"{fixed(factor * estimate.value, digits)} ± {fixed(half, digits)}{behind}"


def number_rows(
    outcome: CalibrationOutcome, previous: CalibrationRecord | None
) -> list[tuple[str, str, str]]:
    """Name, value and explanation of each number of a result."""
    calibration, sensor = outcome.calibration, outcome.sensor
    rows = [
        ("Gain", estimate_words(sensor, calibration.gain), "Slope of the line, with its 90 % interval."),
        ("Offset", estimate_words(sensor, calibration.offset), "Value at 0 V, with its 90 % interval."),
        ("R²", r2_text(calibration.r2), "Share of the known values' variation that the line explains."),
        ("Off the line", amount_text(sensor, calibration.rms), "Root mean square of the residuals."),
        ("Zero at", f"{fixed(calibration.zero_volts, 4)} V", "Reading at no load or at 0°."),
    ]
    rows += _repeat_rows(outcome)
    rows.append(_sheet_row(calibration))
    if sensor.published is not None:
        gain, offset = sensor.published
        rows.append(
            ("Thesis", f"{gain:g} {sensor.unit}/V, {fixed(offset, 3)} {sensor.unit}", "Equation 2.1.")
        )
    rows.append(("Before", previous_words(outcome, previous), "Against the last accepted calibration."))
    return rows


def _repeat_rows(outcome: CalibrationOutcome) -> list[tuple[str, str, str]]:
    repeat, sensor = outcome.repeat, outcome.sensor
    beside = ", doubtful step and all" if outcome.misplaced else ""
    if repeat is None:
        return [("Repeatability", "one pass only", "Two passes are needed to tell.")]
    rows = [
        (
            "Repeatability",
            amount_text(sensor, repeat.deviation) + beside,
            "Standard deviation of one step: root mean square of the differences between the passes over √2.",
        )
    ]
    if {sweep.name for sweep in outcome.sweeps} == {"loading", "unloading"}:
        explained = "Largest difference between loading and unloading at the same weight."
        rows.append(("Hysteresis", amount_text(sensor, abs(repeat.largest)) + beside, explained))
    else:
        explained = "At the same known value."
        rows.append(("Passes differ by", f"up to {amount_text(sensor, abs(repeat.largest))}", explained))
    return rows


def _sheet_row(calibration: Calibration) -> tuple[str, str, str]:
    sensor = calibration.sensor
    factor, unit = sensor.screen.factor, sensor.screen.symbol
    low, high = sensor.gain.low * factor, sensor.gain.high * factor
    size = calibration.gain.value if sensor.name == "load-cell" else abs(calibration.gain.value)
    word = "inside" if sensor.gain.low <= size <= sensor.gain.high else "outside"
    return (
        "Data sheet",
        f"{low:.1f} to {high:.1f}{_close(unit)}/V: {word}",
        f"Gain allowed by the {sensor.gain.source}.",
    )


def previous_words(outcome: CalibrationOutcome, previous: CalibrationRecord | None) -> str:
    """Against the calibration that counts now."""
    if previous is None:
        return "no earlier one"
    change = compare(outcome.calibration, previous.data["gain"], previous.data["offset"])
    sign = "+" if change.gain >= 0 else "−"
    word = "same within intervals" if change.within else "changed"
    largest = amount_text(outcome.sensor, abs(change.largest))
    share = 100 * abs(change.gain)
    return f"v{previous.version}: gain {sign}{share:.2f} %, at most {largest}: {word}"


def verdict_words(outcome: CalibrationOutcome) -> str:
    """The result in one line."""
    sensor = outcome.sensor
    gain = estimate_words(sensor, outcome.calibration.gain)
    quality = r2_text(outcome.calibration.r2)
    count = len(outcome.objections)
    word = "nothing speaks against it" if not count else f"{count} objection{'s' if count > 1 else ''}"
    return f"{SENSOR_NAMES[sensor.name]}: {gain}, R² {quality}; {word}"


def record_words(sensor: Sensor, record: CalibrationRecord | None) -> str:
    """What counts now for a sensor."""
    if record is None:
        return "not calibrated on this rig yet"
    gain = sensor.screen.after(fixed(sensor.screen.factor * record.gain, 3))
    return f"{record.title}: {gain}/V ({record.verdict})"


def _close(unit: str) -> str:
    """A unit behind its number: degrees stand close."""
    return unit if unit == "°" else f" {unit}"


def listed(sentences: Sequence[str]) -> str:
    """One sentence a line."""
    return held_together(printed("\n".join(sentences)))


PANEL_WIDTH = 400
REASON_FIRST = "There are objections; say below why it is good all the same, then accept with the reason."


class ResultPage(QWidget):
    """Its buttons call ``decide(accept, reason)``, or ``back`` to undo the last step or leave."""

    def __init__(self, decide: Callable[[bool, str], None], back: Callable[[], None]) -> None:
        super().__init__()
        self.verdict = described(heading(large=True), "calibrationVerdict")
        self.verdict.setWordWrap(True)
        self.fit, self.residuals = FitPlot(), ResidualPlot()
        self.legend = remark()
        self.numbers = QGridLayout()
        self.numbers.setHorizontalSpacing(16)
        self.numbers.setVerticalSpacing(8)
        self.numbers.setColumnStretch(1, 1)
        self._rows: list[tuple[QLabel, QLabel]] = []
        self.objections_title = heading("What speaks against it")
        self.objections = described(WholeLabel(), "calibrationObjections")
        self.notes = remark()
        self.reason = described(QLineEdit(), "calibrationReason", accessible="Reason for accepting")
        self.reason.setPlaceholderText("Reason, if it is accepted all the same")
        self.accept = ActionButton(
            "&Accept",
            "acceptCalibration",
            "Store it as the calibration that counts from the next connection on.",
            lambda: decide(True, ""),
        )
        self.accept.setProperty("primary", "true")
        self.with_reason = ActionButton(
            "Accept with the &reason",
            "acceptWithReason",
            "Store it with the reason as the calibration that counts.",
            lambda: decide(True, self.reason.text()),
        )
        self.reject = ActionButton(
            "Re&ject",
            "rejectCalibration",
            "Store it as rejected; the calibration before goes on to count.",
            lambda: decide(False, self.reason.text()),
        )
        self.back = ActionButton("Back", "backToSteps", "Back to the last step, or to the start.", back)
        self.reason.textChanged.connect(lambda _: self._refuse())
        self._outcome: CalibrationOutcome | None = None
        self._build()

    def _build(self) -> None:
        left = QVBoxLayout()
        left.setContentsMargins(16, 16, 8, 8)
        left.setSpacing(8)
        left.addWidget(self.verdict)
        left.addWidget(self.legend)
        left.addWidget(self.fit, 3)
        left.addWidget(self.residuals, 2)
        content = QWidget()
        content.setFixedWidth(PANEL_WIDTH - 1)
        words = QVBoxLayout(content)
        words.setContentsMargins(16, 16, 16, 0)
        words.setSpacing(8)
        words.addLayout(self.numbers)
        words.addSpacing(8)
        words.addWidget(self.objections_title)
        words.addWidget(self.objections)
        words.addWidget(self.notes)
        words.addStretch(1)
        decision = QVBoxLayout()
        decision.setContentsMargins(16, 8, 16, 16)
        decision.setSpacing(8)
        decision.addWidget(self.reason)
        for button in (self.accept, self.with_reason, self.reject, self.back):
            decision.addWidget(button)
        panel = described(QWidget(), "acquirePanel")
        panel.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        side = QVBoxLayout(panel)
        side.setContentsMargins(1, 0, 0, 0)  # beside the panel's edge
        side.setSpacing(0)
        side.addWidget(SideRoom(content), 1)  # many words scroll; the buttons stay in sight
        side.addLayout(decision)
        hbox(self, (left, 1), panel, margins=FLUSH, spacing=0)

    def show_outcome(
        self, outcome: CalibrationOutcome, previous: CalibrationRecord | None, notes: list[str], back: str
    ) -> None:
        """Show a result; ``back`` is what the last button says."""
        self._outcome = outcome
        self.verdict.setText(verdict_words(outcome))
        names = [sweep.name for sweep in outcome.sweeps]
        shapes = f"Circles: {names[0]}" + (f"; triangles: {names[1]}" if len(names) > 1 else "")
        limit = amount_text(outcome.sensor, outcome.sensor.accuracy.high)
        ring = " A ring marks a doubtful step." if outcome.misplaced else ""
        self.legend.setText(f"{shapes}. Grey: within the ±{limit} of the data sheet.{ring}")
        self.fit.show_outcome(outcome)
        self.residuals.show_outcome(outcome)
        self._show_numbers(number_rows(outcome, previous))
        self.objections.setText(listed(outcome.objections) or "Nothing.")
        self.notes.setText(listed(notes))
        self.notes.setVisible(bool(notes))
        self.reason.clear()
        self.back.setText(back)
        self._refuse()

    def _show_numbers(self, rows: list[tuple[str, str, str]]) -> None:
        while len(self._rows) < len(rows):
            title, value = remark(wrap=False), WholeLabel()
            self.numbers.addWidget(title, len(self._rows), 0)
            self.numbers.addWidget(value, len(self._rows), 1)
            self._rows.append((title, value))
        for number, (left, right) in enumerate(self._rows):
            name, text, explained = rows[number] if number < len(rows) else ("", "", "")
            left.setText(name)
            right.setText(text)
            right.setObjectName(f"number-{name}" if name else "")
            right.setAccessibleName(name)
            for label in (left, right):
                label.setToolTip(explained)
                label.setVisible(bool(name))

    def _refuse(self) -> None:
        objected = self._outcome is not None and bool(self._outcome.objections)
        self.accept.refuse(REASON_FIRST if objected else "")
        self.with_reason.refuse("" if self.reason.text().strip() else "Write the reason first.")

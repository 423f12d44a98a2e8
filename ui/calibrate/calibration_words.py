"""Numbers and sentences of the tab, from what the calibration says."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fingerlab.calibration import Calibration
from fingerlab.calibration.outcome import CalibrationOutcome, amount_text, compare
from fingerlab.calibration.sensors import Sensor
from fingerlab.calibration.store import CalibrationRecord
from fingerlab.core.text import ParameterEstimate, decimals_for, fixed, printed, r2_text

_AMOUNT = re.compile(r"(?<=\d) (?=(?:g|kg|s|V|mV|N|mN)\b)")
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


def held_together(text: str) -> str:
    """The same words; no line ends between a number and its unit."""
    return _AMOUNT.sub("\u00a0", text)


def listed(sentences: Sequence[str]) -> str:
    """One sentence a line."""
    return held_together(printed("\n".join(sentences)))

"""Units and digits on the screen, against values worked out by hand."""

from __future__ import annotations

import math

import pytest

from fingerlab.core.text import estimate_text, fixed, percent, score_text, screen_unit
from fingerlab.models.file import ParameterEstimate


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "text"),
    [
        (0.0048, 0.0046, 0.0050, "N m", "4.8 ± 0.2 mN m"),
        (0.00480, 0.00468, 0.00492, "N m", "4.80 ± 0.12 mN m"),
        (0.91, 0.86, 0.96, "N", "0.91 ± 0.05 N"),
        (0.16, 0.15, 0.17, "s", "160 ± 10 ms"),
        (math.radians(60), math.radians(57), math.radians(63), "rad", "60 ± 3°"),
        (0.0031, 0.0030, 0.0032, "m", "3.10 ± 0.10 mm"),
        (-0.0031, -0.0034, -0.0028, "m", "−3.1 ± 0.3 mm"),
        (5.1e-3, 4.2e-3, 6.8e-3, "N m", "5.1 mN m (4.2 to 6.8)"),
        (1.3, 1.3, 1.3, "", "1.3"),
    ],
)
def test_estimates_carry_the_digits_of_their_interval(
    value: float, low: float, high: float, unit: str, text: str
) -> None:
    assert estimate_text(ParameterEstimate(value, unit, low, high)) == text


@pytest.mark.parametrize(
    ("si", "largest", "symbol", "one"),
    [
        ("N m", 0.02, "mN m", 1e3),
        ("N m", 2.5, "N m", 1.0),
        ("m", 0.01, "mm", 1e3),
        ("m/N", 1e-4, "µm/N", 1e6),
        ("rad/s", 1.0, "°/s", 180 / math.pi),
        ("s", 30.0, "s", 1.0),
        ("s", 0.2, "ms", 1e3),
        ("N m s/rad", 1e-3, "mN m s/rad", 1e3),
        ("kg m^2", 1e-6, "g cm²", 1e7),
        ("1", 0.3, "", 1.0),
    ],
)
def test_units_on_the_screen(si: str, largest: float, symbol: str, one: float) -> None:
    unit = screen_unit(si, largest)
    assert unit.symbol == symbol
    assert unit.factor == pytest.approx(one)


def test_rounding_never_shows_minus_zero_or_a_false_certainty() -> None:
    assert fixed(-0.0004, 2) == "0.00"
    assert fixed(-1.25, 1) == "−1.2"
    assert percent(0.9999) == "> 99 %"
    assert percent(0.001) == "< 1 %"
    assert percent(0.944) == "94 %"
    assert [score_text(s) for s in (1.036, 12.44, 312.7)] == ["1.04", "12.4", "313"]

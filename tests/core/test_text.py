"""Units and digits as a person reads them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fingerlab.core.text import (
    amount,
    decimals_for,
    estimate_text,
    held_together,
    in_words,
    percent,
    printed,
    r2_text,
    score_text,
    screen_unit,
    significant,
)
from fingerlab.diagnosis.answer.parameter_explorer import FittedParameter
from fingerlab.models.file import ParameterEstimate
from fingerlab.report.diagnosis_words import in_sentence, listed
from fingerlab.report.parameter_words import cells, parameter_titles


@pytest.mark.parametrize(
    ("value", "unit", "low", "high", "text"),
    [
        (0.0048, "N m", 0.0046, 0.0050, "4.8 ± 0.2 mN m"),
        (0.0108, "m", 0.0104, 0.0112, "10.8 ± 0.4 mm"),
        (3.6e-4, "m/N", 3.3e-4, 3.9e-4, "360 ± 30 µm/N"),
        (0.16, "s", 0.148, 0.172, "160 ± 12 ms"),
        (math.radians(12), "rad", math.radians(10), math.radians(14), "12 ± 2°"),
        (1.0, "rad/s", 0.5, 1.5, "60 ± 30°/s"),
        (0.0029 / 1000, "kg m^2", 2.7e-6, 3.1e-6, "29 ± 2 g cm²"),
        (2.7e-3, "kg m^2", 1.1e-3, 4.3e-3, "27 ± 16 kg cm²"),
        (0.0716, "1", 0.0666, 0.0766, "0.072 ± 0.005"),
        (-0.0004, "N m", -0.0034, 0.0026, "0 ± 3 mN m"),
        (0.08, "deg", 0.08, 0.25, "0.08° (0.08 to 0.25)"),
        (0.0048, "N m", math.nan, math.nan, "4.8 mN m"),
        (-0.03, "tan", -0.08, 0.02, "−0.03 ± 0.05 tan"),
    ],
)
def test_a_quantity_has_its_unit_and_the_digits_of_its_interval(value, unit, low, high, text) -> None:
    assert estimate_text(ParameterEstimate(value, unit, low, high)) == text


def test_a_factor_turns_si_into_what_the_symbol_says() -> None:
    for si, largest, symbol, factor in (
        ("N m", 0.02, "mN m", 1e3), ("N", 0.9, "N", 1.0), ("N", 0.02, "mN", 1e3), ("m", 5e-6, "µm", 1e6),
        ("rad", 1.0, "°", 180 / math.pi), ("kg", 0.01, "g", 1e3), ("s", 0.2, "ms", 1e3),
        ("s", 20.0, "s", 1.0), ("m/s^2", 9.81, "m/s²", 1.0), ("furlong", 1.0, "furlong", 1.0),
    ):  # fmt: skip
        unit = screen_unit(si, largest)
        assert (unit.symbol, unit.factor) == (symbol, pytest.approx(factor)), si


def test_no_probability_is_shown_as_certain() -> None:
    assert [percent(p) for p in (0.0, 0.004, 0.5, 0.994, 0.996, 1.0)] == [
        "< 1 %", "< 1 %", "50 %", "99 %", "> 99 %", "> 99 %"
    ]  # fmt: skip
    assert [percent(p, counted=True) for p in (0.0017, 0.14, 1.0)] == ["0.17 %", "14 %", "100 %"]


def test_scores_and_r2_keep_what_matters() -> None:
    assert [score_text(s) for s in (1.034, 12.44, 340.2, math.nan)] == ["1.03", "12.4", "340", "–"]
    assert [r2_text(r) for r in (0.8744, 0.99419, 0.999955, 1.0, -0.193, -22495.0, math.nan)] == [
        "0.874", "0.9942", "0.999955", "1.000000", "−0.193", "below −10", "–"
    ]  # fmt: skip
    # As the tables of "fit" round it; what is not 1 is never told as 1.
    assert [r2_text(r) for r in (0.9797, 0.9999999)] == ["0.980", "0.999999"]


def test_large_numbers_have_no_exponent_and_three_digits() -> None:
    assert [significant(v) for v in (34100.0, 120.4, 0.012345, 99999.0, 3.35e8)] == [
        "34100", "120", "0.0123", "1e+05", "3.35e+08",
    ]  # fmt: skip
    assert significant(12953.0, 4) == "12950"
    assert [amount(v, "N m") for v in (34.1, 0.7371, -12.953, 1.0)] == [
        "34.1 N m", "737 mN m", "-13 N m", "1 N m",
    ]  # fmt: skip
    assert amount(1300.0, "N") == "1300 N"
    assert [score_text(s) for s in (334598885.0, 12345.0, 999.4)] == ["335000000", "12300", "999"]
    assert estimate_text(ParameterEstimate(12953.0, "1", 12953.0, 12953.0)) == "12950"
    assert in_words(ParameterEstimate(12.9, "N m", 11.6, 14.2)) == "12.9 ± 1.3 N m"
    assert in_words(ParameterEstimate(0.0108, "N m", 0.0104, 0.0112)) == "10.8 ± 0.4 mN m"


def test_decimals_follow_the_first_digit_of_the_uncertainty() -> None:
    assert [decimals_for(u) for u in (0.2, 0.12, 0.019, 0.02, 3.0, 17.0)] == [1, 2, 3, 2, 0, 0]


def test_titles_inside_a_sentence() -> None:
    assert in_sentence("Cable slack") == "cable slack"
    assert in_sentence("Coulomb joint friction") == "Coulomb joint friction"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed([]) == ""


def test_parameters_of_an_effect_have_titles_that_differ() -> None:
    titles = parameter_titles("stribeck_friction", ["coulomb_mcp", "extra_mcp", "stribeck_speed"])
    assert len(set(titles.values())) == 3
    assert titles["stribeck_speed"] == "stribeck speed"
    assert all(t.startswith("MCP ") for n, t in titles.items() if n.endswith("_mcp"))
    assert parameter_titles("an_effect_of_my_own", ["gap_deg"]) == {"gap_deg": "gap"}


def test_a_bound_that_no_fit_could_meet_is_not_told() -> None:
    def told(value: float, half: float, low: float, high: float) -> str:
        found = ParameterEstimate(value, "N m", value - half, value + half)
        return cells(FittedParameter("bench_offset", "", found, low, high, "", 0.0, True, False), ())[3]

    assert told(0.02, 0.002, -0.05, 0.05) == "−50 to 50"
    assert told(0.02, 0.002, -11.5, 11.5) == "−11\u202f500 to 11\u202f500"
    assert told(0.02, 0.002, 0.0, 1e4) == "from 0"
    assert told(0.02, 0.002, -100.0, 100.0) == "none"
    assert told(0.02, 0.002, -100.0, 0.05) == "up to 50"


def test_no_interval_goes_beyond_a_bound_and_a_value_at_it_says_so() -> None:
    found = ParameterEstimate(-0.05, "1", -0.065, -0.035)
    stiffness = FittedParameter("mcp_stiffness", "", found, -0.05, 0.05, "rig file", 0.02, True, False)
    _, value, interval, bounds, unit, known = cells(stiffness, ())
    assert (value, interval, bounds, unit) == ("−5.0", "−5.0 to −3.5", "−5 to 5", "%")
    assert known == "fitted here, before: rig file; at its bound"
    tilt = FittedParameter(
        "lateral", "", replace(found, unit="tan"), -0.12, 0.12, "assumed", 0.05, True, False
    )
    assert cells(tilt, ())[4:] == ("1", "fitted here, before: assumed")


@pytest.mark.parametrize(
    "amount",
    [
        "3.07 ± 0.14 mN m",
        "350 ± 70 µm/N",
        "3 ± 2 µm s/N",
        "> 99 %",
        "−742 g cm²",
        "1.18 floors",
        "22 mN m/rad",
        "5.4 ×",
    ],
)
def test_no_line_ends_within_an_amount(amount: str) -> None:
    whole = held_together(f"In 14 runs a torque of {amount}, in 2 others not.")
    assert whole.replace("\u00a0", " ") == f"In 14 runs a torque of {amount}, in 2 others not."
    assert whole.split(" ")[6] == amount.replace(" ", "\u00a0") + ","


def test_powers_of_ten_are_written_out() -> None:
    told = "give of tip 1.3e+03 um/N; less than 2e-05 m; -4.5e-03 N m; run 12e4.h5 stays"
    assert printed(told) == "give of tip 1300 µm/N; less than 2 × 10⁻⁵ m; −4.5 × 10⁻³ N m; run 12e4.h5 stays"

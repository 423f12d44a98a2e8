"""What the headline and the sentences below it claim, and no more."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest

from fingerlab.core.text import NO_BREAK
from fingerlab.diagnosis.answer.error_parts import ScorePart
from fingerlab.report.budget_words import coordinates_of
from fingerlab.report.score_words import score_sentence
from fingerlab.ui.lab.result_words import verdict_headline

from .. import invented


def test_a_headline_of_several_says_that_it_names_the_likeliest() -> None:
    found = invented.nominal_diagnosis("s.h5")
    first, *rest = found.candidates
    assert verdict_headline(found) == f"Missing: Coulomb joint friction, 83{NO_BREAK}%"
    several = replace(found, candidates=(replace(first, probability=0.44), *rest))
    assert verdict_headline(several) == f"Missing, likeliest: Coulomb joint friction, 44{NO_BREAK}%"
    told_apart = replace(several, set=several.set[:1])
    assert verdict_headline(told_apart) == f"Missing: Coulomb joint friction, 44{NO_BREAK}%"


def test_what_is_not_in_the_catalogue_is_said_with_its_probability() -> None:
    found = replace(invented.nominal_diagnosis("s.h5"), verdict="not_in_catalogue", set=())
    for chance, words in ((0.4, "may not be"), (0.93, "is not")):
        said = verdict_headline(replace(found, probability_unknown=chance))
        assert said == f"What is missing {words} in the catalogue, {100 * chance:.0f}{NO_BREAK}%"


def test_the_parts_of_the_error_add_up_and_one_alone_is_not_told() -> None:
    parts = tuple(
        ScorePart((run,), "on_air", "extension", "pip_torque", 0.5, 0.0, squared)
        for run, squared in (("001", 4.0), ("002", 4.0))
    )
    found = replace(invented.nominal_diagnosis("s.h5"), score=3.0, score_parts=parts)
    said = score_sentence(found)
    assert said.startswith(
        "The square of this error, 9.00, is the sum of 1 for the floor, 4.00 for PIP torque in run"
    )
    assert score_sentence(replace(found, score_parts=parts[:1])) == ""


def test_the_sentence_adds_up_digit_by_digit() -> None:
    """53.66 leaves remainders that rounded one by one sum to 53.7 beside a square of 53.6."""
    squares = (13.94, 9.62, 6.34, 22.76)
    parts = tuple(
        ScorePart((f"{run:03}",), "on_air", "extension", "pip_torque", 0.2, 0.0, squared)
        for run, squared in enumerate(squares, start=1)
    )
    found = replace(
        invented.nominal_diagnosis("s.h5"), score=math.sqrt(1.0 + sum(squares)), score_parts=parts
    )
    whole, *each = map(float, re.findall(r"\d+\.\d+", score_sentence(found)))
    assert whole == pytest.approx(1.0 + sum(each), abs=1e-9)
    assert whole == pytest.approx(53.7, abs=0.11)


def test_a_motor_alone_is_not_drawn_over_the_tension_of_a_cable() -> None:
    found = invented.nominal_diagnosis("s.h5").comparisons
    equation = found[0].equation
    assert "tension" in coordinates_of(found, equation)
    alone = tuple(replace(one, phase="motor_bench") for one in found)
    assert "tension" not in coordinates_of(alone, equation)

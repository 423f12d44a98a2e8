"""What a proposed run will have brought: gains corrected by past ones, and the set that follows."""

from __future__ import annotations

import json
from importlib.resources import files
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fingerlab.diagnosis.experiment.separation import GainLine, Outlook, gain_calibration
from fingerlab.diagnosis.fit.solver import Fit
from fingerlab.diagnosis.score.calibration import Odds, calibrated, calibration
from fingerlab.diagnosis.score.fitted_model import FittedModel, Sensitivity, values_if_there
from tests.hidden.sweep.gains import fit_line, fit_shows, well_told

NAMES = ("coulomb_friction", "viscous_friction", "stribeck_friction")


def seen(*logs: float) -> Odds:
    """An effect is missing for certain; log odds of three effects."""
    weights = np.exp(np.array(logs))
    return Odds(NAMES, (1.0 - 2e-9) * weights / weights.sum(), np.zeros(3), 1e-9, 1e-9)


def outlook(odds: Odds) -> Outlook:
    return Outlook(odds, 1.05, 1.0, calibration())


def test_a_line_is_straight_for_small_gains_and_for_logarithms_of_large_ones() -> None:
    line = GainLine(offset=0.0, slope=1.0, spread=0.5, trials=9)
    assert line.gain(3.0) == pytest.approx(3.0)
    assert line.gain(50.0, 1.0) / 50.0 == pytest.approx(np.exp(0.5), rel=1e-3)
    assert line.gain(50.0, -1.0) / 50.0 == pytest.approx(np.exp(-0.5), rel=1e-3)


def test_a_run_that_tells_nothing_apart_brings_nothing() -> None:
    line = GainLine(offset=0.4, slope=1.1, spread=1.3, trials=9, fades=True)
    assert line.gain(0.0, np.array([-1.0, 0.0, 1.0])).tolist() == [0.0, 0.0, 0.0]
    assert abs(line.gain(0.05, 1.0)) < 0.15
    # Of large gains nothing is taken: as without it, within a hundredth.
    assert line.gain(50.0, 1.0) == pytest.approx(GainLine(0.4, 1.1, 1.3, 9).gain(50.0, 1.0), rel=0.01)


def test_gains_go_from_the_other_effects_to_the_true_one() -> None:
    """Log odds after a run are those before plus the gain; what is not an effect keeps its share."""
    before = seen(0.0, -1.0, -2.0)
    after = outlook(before).with_gains(1, np.array([3.0, 0.0, 5.0]))
    logs = np.log(after.found)
    assert logs[1] - logs[0] == pytest.approx(-1.0 + 3.0)
    assert logs[1] - logs[2] == pytest.approx(1.0 + 5.0)
    assert after.found.sum() == pytest.approx(before.found.sum())
    assert (after.nothing, after.unknown) == (before.nothing, before.unknown)


@pytest.mark.parametrize(
    "logs", [(0.0, -0.3, -0.6), (0.0, -4.0, -5.0), (0.0, -30.0, -40.0), (-20.0, -25.0, 0.0)]
)
def test_the_set_is_the_one_that_the_diagnosis_would_give(logs: tuple[float, ...]) -> None:
    odds = seen(*logs)
    now = outlook(odds)
    told, said = calibrated(odds, "missing_effect", {"left": 1.05}, "contact on_air")
    assert said.widening == 1.0
    assert now.probabilities() == pytest.approx(told)
    wanted = {name for name in said.cannot_be_ruled_out if name in NAMES}
    assert {NAMES[i] for i in now.found_set(told)} == wanted


def test_an_effect_that_was_seen_leaves_nothing_to_the_others() -> None:
    hidden = Odds(NAMES, np.full(3, 1e-4), np.array([0.1, 0.1, 0.05]), 0.7, 0.0497)
    after = outlook(hidden).when_found(2, np.array([40.0, 40.0, 0.0]))
    now = outlook(hidden)
    assert now.found_set(now.probabilities(after)) == [2]
    assert after.found[2] > 0.9
    assert after.nothing < 1e-100


@pytest.mark.parametrize(("found", "typical", "there"), [(1.9, 2.0, 2.0), (2.5, 2.0, 2.0), (-2.5, 2.0, -2.0)])
def test_a_tolerance_at_its_bound_hides_nothing_twice(found: float, typical: float, there: float) -> None:
    """Runs know the sum of a tolerance (sd 0.5, bound 1.25) and an effect to 3: it is at its end.

    The effect has its typical strength in the sense in which it came out; of what is added to what came out,
    the tolerance takes (1 / 9) / (1 / 9 + 4) back.
    """
    bound = float(np.copysign(1.25, found))
    information = np.array([[1 / 9 + 4.0, 1 / 9], [1 / 9, 1 / 9]])
    model = SimpleNamespace(
        index={"tolerance": 0, "effect": 1}, low=np.array([-1.25, -99.0]), high=np.array([1.25, 99.0])
    )
    fit = Fit(np.array([bound, found]), information, 0.0)
    seen = Sensitivity(np.zeros(1), {"effect": typical})
    values = values_if_there(FittedModel(cast(Any, model), fit, {}, np.zeros((1, 2)), sensitivity=seen))
    assert values[1] == pytest.approx(there)
    hidden = bound - (there - found) / 9 / (1 / 9 + 4.0)
    assert values[0] == pytest.approx(np.clip(hidden, -1.25, 1.25))


def test_the_table_of_the_program_is_fitted_and_finite() -> None:
    text = files("fingerlab.resources").joinpath("gain_calibration.json").read_text(encoding="utf-8")
    told, table = json.loads(text), gain_calibration()
    assert told["version"] == table.version
    assert table.fitted >= 10
    for line in (table.among, table.bench, table.shows):
        assert 0.1 <= line.slope <= 2.0
        assert 0.0 < line.spread < 5.0


def test_a_correction_is_found_again() -> None:
    """Gains that came out half as large as predicted, and 400 of them outweigh what is thought beforehand."""
    rng = np.random.default_rng(1)
    predicted = np.exp(rng.uniform(1.0, 4.0, 400))
    achieved = 0.5 * predicted * np.exp(0.3 * rng.standard_normal(400))
    line = fit_line(list(zip(predicted, achieved, strict=True)))
    assert line.gain(20.0) == pytest.approx(10.0, rel=0.1)
    assert line.spread == pytest.approx(0.3, rel=0.2)
    shown = [(p, float(p * np.exp(0.5 * rng.standard_normal()) > 10.0)) for p in predicted]
    found = fit_shows(shown)
    assert found.gain(10.0) == pytest.approx(5.0, rel=0.2)
    assert found.spread == pytest.approx(0.5, rel=0.3)


@pytest.mark.parametrize(
    ("foretold", "gained", "well"),
    [(4.0, 7.9, True), (4.0, 8.1, False), (4.0, 1.9, False), (0.1, -0.3, True)],
)
def test_well_told_is_within_a_factor_of_two(foretold: float, gained: float, well: bool) -> None:
    assert well_told(foretold, gained) is well

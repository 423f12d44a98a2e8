"""Parameters at hand: other values are told as a fit or the equations would, held ones stay and are named."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.parameter_explorer import ParameterExplorer
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.report import diagnosis_words as words
from fingerlab.report import parameter_words
from fingerlab.report.score_words import story
from fingerlab.sessions import Session

from . import closed_form as made

FRICTION = (0.004, 0.002)  # N m s/rad
ARM = "arm_pip@extension"
BENCH = made.Bench(missing=made.Missing(viscous=FRICTION))
EFFECT = "viscous_friction"


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(BENCH, 3, contact=2)


@pytest.fixture(scope="module")
def kept(session: Session) -> Reduction:
    return Reduction([session])


@pytest.fixture(scope="module")
def found(session: Session, kept: Reduction) -> Diagnosis:
    return diagnose([session], [EFFECT], options=DiagnosisOptions(kept=kept))


@pytest.fixture(scope="module")
def at_hand(kept: Reduction, found: Diagnosis) -> ParameterExplorer:
    return ParameterExplorer(kept, found)


def test_every_parameter_has_value_interval_bounds_unit_and_source(
    at_hand: ParameterExplorer, found: Diagnosis
) -> None:
    assert {one.key for one in at_hand.parameters} == set(found.parameters)
    by_key = {one.key: one for one in at_hand.parameters}
    arm, mass = by_key[ARM], by_key["proximal_mass"]
    assert (arm.low, arm.high) == pytest.approx((0.002, 0.04), rel=0.05)
    assert arm.estimate.value == pytest.approx(BENCH.arms[-1][1], rel=0.02)
    assert parameter_words.known_by(arm) == "fitted here"
    assert "rig file" in parameter_words.known_by(mass)
    title, value, interval, bounds, unit, source = parameter_words.cells(arm, list(by_key))
    assert title == "Moment arm at the PIP, extension cable"
    assert unit == "mm"
    assert float(value) == pytest.approx(8.3, rel=0.02)
    assert float(interval.split(" to ")[0]) < float(value) < float(interval.split(" to ")[1])
    assert all(one.source for one in at_hand.parameters)
    assert bounds
    assert source


def test_as_fitted_it_says_what_the_diagnosis_said(at_hand: ParameterExplorer, found: Diagnosis) -> None:
    fitted = found.fitted
    assert fitted is not None
    told = np.sqrt(1.0 + fitted.in_sample[:, 0].sum() / fitted.count)
    assert at_hand.as_fitted.score == pytest.approx(told, rel=1e-4)
    shown = found.comparisons[0]
    again = at_hand.comparisons(at_hand.as_fitted, shown.session, shown.run)
    assert np.nanmax(np.abs(again[0].modelled - shown.modelled)) < 1e-3 * shown.floor


def test_a_moved_value_moves_the_curve_by_what_the_equation_says(
    at_hand: ParameterExplorer, found: Diagnosis
) -> None:
    """A viscous torque is c times speed: 1 mN m s/rad more adds a thousandth of the speed to the torque."""
    key, more = f"{EFFECT}.viscous_mcp", 1e-3
    moved = at_hand.what_if({key: found.parameters[key].value + more})
    shown = next(one for one in found.comparisons if one.equation == "mcp_torque")
    new = at_hand.comparisons(moved, shown.session, shown.run)[0]
    change = new.modelled - shown.modelled
    speed = shown.coordinates["joint speed mcp"]
    slope = np.polyfit(speed, change, 1)[0]
    assert abs(slope) == pytest.approx(more, rel=0.05)
    assert np.std(change - slope * speed - np.mean(change)) < 0.05 * np.std(change)
    assert moved.score > at_hand.as_fitted.score
    assert moved.errors["joint_torque"].rmse > at_hand.as_fitted.errors["joint_torque"].rmse
    assert moved.errors["cable_kinematics"].rmse == at_hand.as_fitted.errors["cable_kinematics"].rmse


def test_others_that_follow_leave_less(at_hand: ParameterExplorer, found: Diagnosis) -> None:
    wanted = 1.03 * found.parameters[ARM].value
    alone, followed = at_hand.what_if({ARM: wanted}), at_hand.what_if({ARM: wanted}, follow=True)
    assert alone.values[ARM] == pytest.approx(wanted)
    assert followed.values[ARM] == pytest.approx(wanted)
    assert at_hand.as_fitted.score < followed.score < alone.score
    assert {k for k, v in alone.values.items() if v != at_hand.as_fitted.values[k]} == {ARM}


def test_what_is_held_stays_and_is_named_wherever_the_verdict_is(
    session: Session, kept: Reduction, found: Diagnosis
) -> None:
    wanted = 1.05 * BENCH.arms[-1][1]
    options = DiagnosisOptions(kept=kept, held={ARM: wanted})
    held = diagnose([session], [EFFECT], with_curves=False, options=options)
    estimate = held.parameters[ARM]
    assert estimate.value == pytest.approx(wanted, rel=1e-9)
    assert estimate.high - estimate.low < 1e-6
    assert held.final_parameters[ARM].value == pytest.approx(wanted, rel=1e-9)
    assert held.score > found.score
    assert "held at 8.715 mm, by hand" in words.verdict_sentence(held)
    assert held.to_json()["held"] == {ARM: wanted}
    assert story([found, held])[0].title.startswith("Moment arm at the PIP, extension cable held at")
    assert story([held, found])[0].title == "Nothing held any more"
    laid_out = ParameterExplorer(kept, held)
    (one,) = [p for p in laid_out.parameters if p.held]
    assert one.key == ARM
    assert one.low < wanted < one.high
    assert parameter_words.known_by(one) == "held by hand"
    again = diagnose([session], [EFFECT], with_curves=False, options=DiagnosisOptions(kept=kept))
    assert again.score == found.score
    assert again.to_json()["candidates"] == found.to_json()["candidates"]
    assert "held" not in again.to_json()


@pytest.mark.parametrize(
    ("held", "why"),
    [({"arm": 0.01}, "no parameter 'arm'"), ({ARM: 0.5}, "hold it between 0.002"),
     ({"coulomb_friction.coulomb_mcp": 0.001}, "no parameter 'coulomb")],
)  # fmt: skip
def test_what_cannot_be_held_is_refused(
    session: Session, kept: Reduction, held: dict[str, float], why: str
) -> None:
    with pytest.raises(UserError, match=why):
        diagnose([session], [EFFECT], with_curves=False, options=DiagnosisOptions(kept=kept, held=held))


def test_every_unknown_of_a_bench_has_its_words_and_unit() -> None:
    for name, one in nuisance_ranges(made.RIG).items():
        _, unit = parameter_words.TITLES[name]
        assert unit.replace("%", "1") == one.unit, name

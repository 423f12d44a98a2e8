"""What a second look tries: around what was found, and only where there is something between the points."""

from __future__ import annotations

import pytest

from fingerlab.identify.diagnosis.model import Choice
from fingerlab.identify.diagnosis.second_look import worth_a_look
from fingerlab.physics.effects import CATALOGUE
from fingerlab.physics.effects.closer import either, every, plus, rubbing, times


@pytest.mark.parametrize(
    ("name", "worth"),
    [("viscous_friction", False), ("cable_slack", False), ("joint_stop", True), ("backlash", True)],
)
def test_a_look_is_worth_it_where_a_shape_has_neighbours(name: str, worth: bool) -> None:
    assert worth_a_look([Choice(CATALOGUE[name], 0)]) == worth


def test_one_effect_is_enough() -> None:
    assert not worth_a_look([])
    assert worth_a_look([Choice(CATALOGUE["viscous_friction"]), Choice(CATALOGUE["joint_stop"], 3)])


def test_shapes_around_one() -> None:
    found = {"edge": 4.0, "round": 1.0}
    assert plus("edge", (-1.0, 0.0, 2.0))(found) == [{**found, "edge": e} for e in (3.0, 4.0, 6.0)]
    assert times("edge", (0.5, 1.0))(found) == [{**found, "edge": e} for e in (2.0, 4.0)]
    both = every(times("edge", (0.5, 1.0)), either("round", (0.0, 1.0)))(found)
    assert both == [{"edge": e, "round": r} for e in (2.0, 4.0) for r in (0.0, 1.0)]


def test_sharper_friction_is_tried_where_it_lacks_as_much_work() -> None:
    """Behind a reversal 1 - (1 - x / (p d))^p lacks the work d p / (1 + p) of its sliding force."""
    lacking = {1.0: 1.0 / 2.0, 0.5: 2.0 / 3.0, 0.0: 1.0}  # of d: one contact, evenly, exponential
    for found in ({"travel_deg": 0.3}, {"travel_deg": 0.6, "sharpness": 1.0}):
        tried = rubbing(factors=(1.0,))(found)
        work = [s["travel_deg"] * lacking[s["sharpness"]] for s in tried]
        assert work == pytest.approx([0.3] * 3)

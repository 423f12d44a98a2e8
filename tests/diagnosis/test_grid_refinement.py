"""What a refined grid holds: around what was found, and only where there is something between the points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.core.progress import SILENT
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.grid_refinement import can_refine, extend_path, fit_effects, fit_refined
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import either, every, plus, rubbing, times
from tests.reduced import reduce_sessions

from . import closed_form as made


@pytest.mark.parametrize(
    ("name", "worth"),
    [("viscous_friction", False), ("cable_slack", False), ("joint_stop", True), ("backlash", True)],
)
def test_a_look_is_worth_it_where_a_shape_has_neighbours(name: str, worth: bool) -> None:
    assert can_refine([Choice(CATALOGUE[name], 0)]) == worth


def test_one_effect_is_enough() -> None:
    assert not can_refine([])
    assert can_refine([Choice(CATALOGUE["viscous_friction"]), Choice(CATALOGUE["joint_stop"], 3)])
    # What a spring on the motor side keeps says when the cable hangs loose.
    assert not can_refine([Choice(CATALOGUE["motor_spring"])])
    assert can_refine([Choice(CATALOGUE["motor_spring"]), Choice(CATALOGUE["cable_slack"])])


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


def test_in_what_order_effects_are_given_does_not_matter() -> None:
    """Two effects hide each other: the points of their grids are found beside each other."""
    bench = made.Bench(missing=made.Missing(tilt=0.25, compliance=5e-4))
    session = made.session(bench, 2)
    densities, tilts = [], []
    for names in (("gravity_tilt", "cable_stretch"), ("cable_stretch", "gravity_tilt")):
        effects = [CATALOGUE[name] for name in names]
        scorer = Scorer(reduce_sessions([session], effects))
        found = fit_effects(scorer, effects)
        densities.append(scorer.deviance(found))
        tilts.append(found.fit.values[found.model.index["gravity_tilt.tilt"]])
    assert densities[0] == pytest.approx(densities[1], abs=1.0)
    assert tilts == pytest.approx([0.25, 0.25], abs=0.03)


def test_a_path_that_goes_on_begins_with_what_was_given() -> None:
    """Given one effect, one found: beyond it the path is given, found, further, and never less than given."""
    bench = made.Bench(missing=made.Missing(motor_viscous=3e-3, tilt=0.25, compliance=5e-4))
    effects = [CATALOGUE[n] for n in ("motor_viscous_friction", "gravity_tilt", "cable_stretch")]
    kept = Reduction([made.session(bench, 2)])
    scorer = Scorer(kept.of(effects))
    path = [scorer.score_held_out(fit_effects(scorer, effects[:k])) for k in (1, 2)]
    longer = extend_path(kept, effects, path, SILENT)
    assert longer is not None
    assert [step.effect_ids for step in longer[1]] == [[e.id for e in effects[:k]] for k in (1, 2, 3)]
    assert longer[1][2].score < 1.2 < longer[1][1].score
    assert longer[1][-1].values["gravity_tilt.tilt"] == pytest.approx(0.25, abs=0.03)


@pytest.mark.parametrize("edge_deg", [-18.3, -22.7])
def test_a_stop_that_is_entered_by_degrees_is_found_at_its_edge(edge_deg: float) -> None:
    """Round faces of 2 N m/rad^1.5, between the points of any grid; begun from flat faces, too."""
    bench = made.Bench(missing=made.Missing(stop=(np.radians(edge_deg), 2.0)))
    kept = Reduction([made.session(bench, 2)])
    (effect,) = kept.suited([CATALOGUE["joint_stop"]])
    for hertz in (0.0, 1.0):
        given = replace(effect, shapes=tuple(s for s in effect.shapes if s["hertz"] == hertz))
        scorer, found = fit_refined(kept, [given])
        shape = found.choices[0].effect.shapes[found.choices[0].shape]
        assert shape["hertz"] == 1.0
        assert shape["edge_deg"] == pytest.approx(edge_deg, abs=0.1)
        assert found.values["joint_stop.stop_pip"] * kept.scales.torque == pytest.approx(2.0, rel=0.04)
        assert scorer.score_held_out(found).score < 1.1

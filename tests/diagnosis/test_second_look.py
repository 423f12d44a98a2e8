"""What a second look tries: around what was found, and only where there is something between the points."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from fingerlab.core.progress import SILENT
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import reduce_sessions
from fingerlab.diagnosis.score.scorer import Study
from fingerlab.diagnosis.search import grid_refinement as second_look
from fingerlab.diagnosis.search.grid_refinement import settled, worth_a_look
from fingerlab.diagnosis.search.path import density
from fingerlab.effects import CATALOGUE
from fingerlab.effects.grids import either, every, plus, rubbing, times

from . import closed_form as made


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


def test_in_what_order_effects_are_given_does_not_matter() -> None:
    """Two effects hide each other: the points of their grids are found beside each other."""
    bench = made.Bench(missing=made.Missing(tilt=0.25, compliance=5e-4))
    session = made.session(bench, 2)
    densities, tilts = [], []
    for names in (("gravity_tilt", "cable_stretch"), ("cable_stretch", "gravity_tilt")):
        effects = [CATALOGUE[name] for name in names]
        study = Study(reduce_sessions([session], effects))
        found = settled(study, effects)
        densities.append(density(study, found))
        tilts.append(found.fit.values[found.model.index["gravity_tilt.tilt"]])
    assert densities[0] == pytest.approx(densities[1], abs=1.0)
    assert tilts == pytest.approx([0.25, 0.25], abs=0.03)


def test_a_path_that_goes_on_begins_with_what_was_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """Given one effect, one found: beyond it the path is given, found, further, and never less than given."""
    names = ["viscous_friction", "joint_stop", "motor_inertia"]
    choices = [Choice(CATALOGUE[n]) for n in names]

    def holding(count: int) -> Any:
        return SimpleNamespace(model=SimpleNamespace(choices=tuple(choices[:count])))

    class Fits:
        reduced = SimpleNamespace(layout=SimpleNamespace(effects=()))

        def hold_out(self, trial: Any) -> Any:
            return trial

        def fit(self, chosen: tuple[Choice, ...], _: Any) -> Any:
            return holding(len(chosen))

    monkeypatch.setattr(second_look, "Study", lambda _: Fits())
    monkeypatch.setattr(second_look, "settled", lambda _, given: holding(len(given)))
    monkeypatch.setattr(second_look, "least_fall", lambda _: 0.0)
    monkeypatch.setattr(second_look, "weigh", lambda *_: None)
    monkeypatch.setattr(second_look, "forward", lambda *_: [holding(2), holding(3)])
    monkeypatch.setattr(second_look, "look_again_along", lambda _, path, *__: (None, path))
    reduction = cast(Any, SimpleNamespace(of=lambda *_: None))
    longer = second_look.look_beyond(reduction, [], cast(Any, [holding(1), holding(2)]), SILENT)
    assert longer is not None
    assert [len(step.model.choices) for step in longer[1]] == [1, 2, 3]

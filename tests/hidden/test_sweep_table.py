"""The sweep's figures, counted by hand on a few made-up answers."""

from __future__ import annotations

from typing import Any

import pytest

from tests.hidden.sweep.__main__ import trials
from tests.hidden.sweep.table import BY_HAND, answers, figures, markdown


def entry(
    effects: tuple[str, ...], found: tuple[str, ...], probability: float, protocol: str = "rich", **more: Any
) -> dict[str, Any]:
    """An answer that found these effects, the first of them with a probability; or nothing."""
    trial = {"source": "twin", "protocol": protocol, "effects": list(effects), "seed": 1}
    verdict = "missing_effect" if found else "nothing_missing"
    return {
        "trial": {**trial, "left_out": more.pop("left_out", []), "proposed": more.pop("proposed", False)},
        "verdict": verdict,
        "first": found[0] if found else "contact_angle",
        "probability": probability if found else 1.0 - probability,
        "nothing": 0.0 if found else probability,
        "unknown": 0.0,
        "set": list(found),
        "score": 3.0,
        "path": [[None, 3.0]] + [[name, 1.2] for name in found],
        **more,
    }


FRICTION = ("viscous_friction", "coulomb_friction")


def test_every_kind_is_counted_against_its_own_truth() -> None:
    told = dict(
        figures(
            [
                entry((), (), 0.95),
                entry((), ("backlash",), 0.9),
                entry(("backlash",), ("backlash",), 0.99, coverage={"share": 0.90}),
                entry(("backlash",), ("cable_slack", "backlash"), 0.9, coverage={"share": 0.99}),
                entry(FRICTION, FRICTION, 0.9),
                entry(FRICTION, FRICTION[:1], 0.9),
                entry(
                    ("capstan_friction",), ("load_dependent_friction",), 0.9, left_out=["capstan_friction"]
                ),
                entry(("capstan_friction",), ("torque_ripple",), 0.9, left_out=["capstan_friction"]),
            ]
        )
    )
    assert told["rich: nothing: false alarms"] == "1 of 2 (50 %)"
    assert told["rich: one effect: first"] == "1 of 2 (50 %)"
    assert told["rich: one effect: in the set"] == "2 of 2 (100 %)"
    assert told["rich: one effect: in the set, and the verdict is a missing effect"] == "2 of 2 (100 %)"
    assert told["rich: one effect: median set"] == "1.5"
    assert told["pairs: both found"] == "1 of 2 (50 %)"
    assert told["outside the catalogue: called so, or a neighbour"] == "1 of 2 (50 %)"
    inside = "rich: force inside its 90 % interval, mean; sessions with 85 to 95 %"
    assert told[inside] == "94.5 %; 1 of 2 (50 %)"


def test_a_proposed_experiment_is_counted_by_what_it_changed() -> None:
    proposal = {"expected_if": {"backlash": 10.0}}
    after = {**entry(("backlash",), ("backlash",), 0.99), "proposal": proposal, "gained": 6.0}
    told = dict(
        figures(
            [
                entry(("backlash",), ("cable_slack", "backlash"), 0.6, "thesis", proposed=True, after=after),
                entry(("backlash",), ("cable_slack",), 0.99, "thesis", proposed=True),
                entry(("backlash",), ("backlash",), 0.99, "thesis", proposed=True),
            ]
        )
    )
    name = "thesis: one effect: "
    assert told[name + "first"] == "1 of 3 (33 %)"
    assert told[name + "first after one proposed experiment"] == "2 of 3 (67 %)"
    assert told[name + "proposed where the truth did not stand alone"] == "1 of 2"
    assert told[name + "the truth alone in the set after it"] == "2 of 3 (67 %)"
    assert told[name + "... of those taken, where it was not alone before"] == "1 of 1 (100 %)"
    assert told[name + "gain foretold of the truth within a factor of two"] == "1 of 1 (100 %)"


def test_calibration_compares_what_was_told_with_what_was_right() -> None:
    """Four answers told with 0.9, three of them right: off by 0.15; Brier score (3 * 0.01 + 0.81) / 4."""
    right = [entry(("backlash",), ("backlash",), 0.9)] * 3
    entries = [*right, entry(("backlash",), ("cable_slack",), 0.9)]
    assert answers(entries) == [(0.9, True)] * 3 + [(0.9, False)]
    told = dict(figures(entries))
    assert told["calibration: told with 90.0 % on average"] == "3 of 4 (75 %)"
    assert told["calibration: mean distance of told and true share; Brier score"] == "0.150; 0.210"


def test_the_page_keeps_what_was_written_by_hand() -> None:
    start, stop = BY_HAND
    before = f"# Old\n\n{start}\nWhy it falls short.\n{stop}\n\n| old | table |\n"
    page = markdown([entry(("backlash",), ("backlash",), 0.9)], "the command", before)
    assert f"{start}\nWhy it falls short.\n{stop}" in page
    assert "| old | table |" not in page
    assert markdown([entry((), (), 0.9)], "the command").count(start) == 1


@pytest.mark.parametrize("seeds", [1, 5])
def test_every_effect_and_protocol_gets_its_seeds(seeds: int) -> None:
    ids = ["backlash", "cable_slack", "torque_ripple"]
    every = trials({"rich", "thesis", "after", "pairs", "outside"}, ids, list(range(101, 101 + seeds)))
    keys = {t.key for t in every}
    assert len(keys) == len(every)
    for left_out in (False, True):
        for protocol in ("rich",) if left_out else ("rich", "thesis"):
            alone = [
                t.effects[0]
                for t in every
                if t.protocol == protocol and len(t.effects) == 1 and bool(t.left_out) == left_out
            ]
            assert sorted(alone) == sorted(ids * seeds)
    assert all(t.proposed for t in every if t.protocol == "thesis" and t.effects)


def test_an_effect_that_is_said_not_to_show_is_in_the_set_but_not_found() -> None:
    hidden = {**entry(("added_mass",), (), 0.8), "set": ["added_mass", "motor_inertia"]}
    told = dict(figures([hidden]))
    assert told["rich: one effect: first"] == "0 of 1 (0 %)"
    assert told["rich: one effect: in the set"] == "1 of 1 (100 %)"
    assert told["rich: one effect: in the set, and the verdict is a missing effect"] == "0 of 1 (0 %)"

"""Known changes of a machine: told in a run's attribute, in words, and refused where they are none."""

from __future__ import annotations

import json

import pytest

from fingerlab.core.errors import UserError
from fingerlab.rig.file import (
    INTERVENTION,
    UNCHANGED,
    Intervention,
    intervention_of,
    read_intervention,
)


def test_a_change_is_told_by_the_numbers_that_are_not_usual() -> None:
    change = Intervention(added_mass=0.013, added_mass_at=0.048, pip_arm=1.2)
    told = change.attributes()
    assert json.loads(told[INTERVENTION]) == {"added_mass": 0.013, "added_mass_at": 0.048, "pip_arm": 1.2}
    assert intervention_of(told, "001") == change
    assert intervention_of({}, "001") is None
    assert UNCHANGED.attributes() == {}


def test_a_change_is_said_in_an_operators_units() -> None:
    change = Intervention(added_mass=0.013, added_mass_at=0.048, load_torque=0.03, mcp_stiffness=-0.06)
    assert change.words() == (
        "with 13 g fixed to the finger 48 mm beyond the PIP axis and a known load of 30 mN m on the pulley "
        "beside the cable and a spring taken away at the MCP joint, 60 mN m/rad"
    )
    assert Intervention(pip_arm=1.2).words() == (
        "with the cable guided round the PIP joint at 1.2 times its moment arm"
    )


@pytest.mark.parametrize(
    ("told", "word"),
    [
        ("{", "Run 001, attribute 'intervention'"),
        ("[1]", "object"),
        ('{"weight": 0.01}', "'weight'; it should be one of added_mass"),
        ('{"added_mass": "10 g"}', "a number in kg"),
        ('{"added_mass": -0.01}', "should be positive"),
        ('{"mcp_arm": 0}', "should be positive"),
    ],
)
def test_what_is_no_change_is_refused_with_a_sentence(told: str, word: str) -> None:
    with pytest.raises(UserError, match=word.replace("'", ".")):
        intervention_of({INTERVENTION: told}, "001")
    with pytest.raises(UserError):
        read_intervention(json.dumps([told]), "here")

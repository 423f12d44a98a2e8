"""Every effect's file has an example, and its columns are what the example says, computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.effects import CATALOGUE

WITHOUT_COLUMN = {"cable_slack", "transport_delay", "routing_change"}


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_columns_are_those_of_the_example(name: str) -> None:
    effect = CATALOGUE[name]
    assert effect.example is not None
    assert effect.example_problem() == ""
    assert (not effect.example.expected) == (name in WITHOUT_COLUMN)


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name not in WITHOUT_COLUMN])
def test_an_example_with_another_value_is_told(name: str) -> None:
    effect = CATALOGUE[name]
    assert effect.example is not None
    for key, values in effect.example.expected.items():
        wrong = replace(effect.example, expected={key: np.asarray(values, float) * 1.01 + 1e-4})
        assert key in replace(effect, example=wrong).example_problem()

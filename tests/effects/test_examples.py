"""Every effect's file has an example, and its columns are what the example says, computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect, Row


def columns(effect: Effect) -> dict[str, np.ndarray]:
    """Column by "EQUATION gain"; two terms of one gain in one equation are added up."""
    assert effect.example is not None
    found: dict[str, np.ndarray] = {}
    for term in effect.columns(effect.example.motion(), effect.example.shape):
        key = f"{Row(term.row).name} {term.gain}"
        found[key] = found.get(key, 0.0) + np.asarray(term.values)
    return found


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_columns_are_those_of_the_example(name: str) -> None:
    effect = CATALOGUE[name]
    assert effect.example is not None
    found, expected = columns(effect), effect.example.expected
    assert set(expected) <= set(found)
    assert bool(expected) == bool(found), "an effect without a column has nothing to expect"
    for key, values in expected.items():
        wanted = np.broadcast_to(np.asarray(values, float), found[key].shape)
        assert found[key] == pytest.approx(wanted, rel=1e-6, abs=1e-12), key


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if e.example and e.example.expected])
def test_an_example_shows_every_equation_or_gain_at_other_values_than_zero(name: str) -> None:
    effect = CATALOGUE[name]
    assert effect.example is not None
    assert any(np.any(np.asarray(values) != 0.0) for values in effect.example.expected.values())

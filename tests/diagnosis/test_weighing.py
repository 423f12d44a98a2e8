"""When weights are taken to belong to their fit."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.fit.data import change

KEY = ("flexion", "free")


@pytest.mark.parametrize(("before", "after", "told"), [(2.0, 2.2, 0.1), (2.2, 2.0, 0.1), (1.0, 1.0, 0.0)])
def test_a_change_of_weights_counts_either_way(before: float, after: float, told: float) -> None:
    """An equation that a group of runs does not have weighs nothing, and changes nothing."""
    one, other = (np.diag([weight, 3.0, 0.0]) for weight in (before, after))
    assert change({KEY: one}, {KEY: other}) == pytest.approx(told)

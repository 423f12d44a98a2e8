"""How far numbers depend on shapes: closed forms of the odds among laws."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.answer.shape_spread import weighted_variance


def test_a_shape_counts_by_what_it_leaves() -> None:
    """Odds go by ((error + more) / error)^-8 with an error of 0.1: 1 to 256 where 0.1 more is left."""
    told = {"friction": 5e-3, "held": 1.0}
    others = [{"friction": 5e-3, "held": 1.0}, {"friction": 8e-3, "held": 1.0}]
    alike = weighted_variance(told, others, np.array([0.05, 0.05]))
    assert alike["friction"] == pytest.approx(0.5 * (3e-3) ** 2)
    apart = weighted_variance(told, others, np.array([0.05, 0.15]))
    assert apart["friction"] == pytest.approx((3e-3) ** 2 / 257.0)
    assert alike["held"] == apart["held"] == 0.0


def test_an_unknown_that_another_shape_lacks_counts_as_told() -> None:
    told = {"friction": 5e-3}
    assert weighted_variance(told, [{}], np.array([0.0])) == {"friction": 0.0}

"""Relaxation of a fixed-point iteration, against the fixed point in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.fit.bounded_step import LEAST_FACTOR, aitken_factor


@pytest.mark.parametrize(("slope", "at_once"), [(-0.8, True), (-2.0, True), (0.5, False), (0.0, True)])
def test_what_goes_to_and_fro_is_met_in_two_steps(slope: float, at_once: bool) -> None:
    """Closed form: a turn leads from u to u* + s (u - u*).

    Without relaxation its distance from u* is multiplied by s a turn, and grows where s is -2. A straight
    line's fixed point is met with the second factor, 1 / (1 - s), unless that is more than the whole way.
    """
    best, shape = 0.12, np.linspace(0.5, 1.5, 40)
    sent, before, missed = np.full(40, 0.1), None, []
    for _ in range(3):
        change = best * shape + slope * (sent - best * shape) - sent
        factor = aitken_factor(before, change)
        assert LEAST_FACTOR <= factor <= 1.0
        before, sent = (factor, change), sent + factor * change
        missed.append(float(np.abs(sent - best * shape).max()))
    assert missed[0] == pytest.approx(abs(slope) * np.abs(0.1 - best * shape).max())
    assert missed[1] == pytest.approx(
        0.0 if at_once else slope**2 * np.abs(0.1 - best * shape).max(), abs=1e-12
    )
    assert aitken_factor(None, change) == 1.0
    assert aitken_factor((0.5, change), change) == 1.0  # that stays the same is gone whole

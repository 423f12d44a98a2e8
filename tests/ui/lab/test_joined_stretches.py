"""Stretches of a long run become one curve with gaps, whatever their order."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.answer.error_parts import Comparison
from fingerlab.ui.lab.comparison_curves import joined, run_key


def stretch(run: str, start: float, value: float, floor: float, count: int = 4) -> Comparison:
    time = start + np.arange(count) * 0.1
    values = np.full(count, value)
    return Comparison("pip_torque", "a.h5", run, "on_air", time, values, values / 2, "N m", floor)


def test_stretches_of_a_run_are_joined_in_time_with_a_gap_between() -> None:
    pieces = [stretch("001", 60.0, 2.0, 0.3, 8), stretch("002", 0.0, 9.0, 1.0), stretch("001", 0.0, 1.0, 0.6)]
    result = joined(pieces)
    assert [key[1].split("\n")[1] for key in result] == ["001", "002"]
    whole = result["pip_torque", run_key(pieces[0])]
    assert (np.diff(whole.time) >= 0).all()
    np.testing.assert_array_equal(whole.measured[:5], [1, 1, 1, 1, np.nan])
    np.testing.assert_array_equal(whole.modelled[5:], [1.0] * 8 + [np.nan])
    assert whole.floor == pytest.approx((4 * 0.6 + 8 * 0.3) / 12)
    assert result["pip_torque", run_key(pieces[1])] is pieces[1]

"""Decimation for the screen loses neither a spike nor a gap."""

from __future__ import annotations

import numpy as np

from fingerlab.ui.widgets.series import envelope


def test_a_spike_of_one_sample_survives_wherever_it_is() -> None:
    time = np.arange(100_003) / 1000.0
    for place in (0, 1, 54_321, len(time) - 1):
        values = np.sin(time)
        values[place] = 7.0
        _, drawn = envelope(time, values, 300)
        assert len(drawn) == 600
        assert np.nanmax(drawn) == 7.0
        assert np.nanmin(drawn) == values.min()


def test_a_gap_stays_a_gap_and_does_not_spread() -> None:
    time = np.arange(10_000) / 100.0
    values = np.cos(time)
    values[3000:5000] = np.nan
    x, drawn = envelope(time, values, 100)
    empty = np.isnan(drawn)
    assert empty.sum() == 2 * 20
    assert x[empty].min() == time[3000]
    assert x[empty].max() == time[4999]


def test_short_series_are_drawn_as_they_are() -> None:
    time = np.arange(50.0)
    x, drawn = envelope(time, time**2, 100)
    assert x is time
    assert drawn[-1] == 49.0**2


def test_times_stay_in_order() -> None:
    x, _ = envelope(np.arange(10_001.0), np.random.default_rng(1).normal(size=10_001), 321)
    assert (np.diff(x) >= 0).all()

"""A look-alike whose curve is many times the data: the fingerprint keeps the height of the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from fingerlab.ui.lab.evidence import FingerprintPlot

from .. import invented


def test_a_curve_far_beyond_the_data_is_cut_by_the_view(qtbot: QtBot) -> None:
    """Data of 4.8 mN m beside a look-alike of 5000 mN m: the view reaches a little beyond 5 mN m."""
    plot = FingerprintPlot()
    qtbot.addWidget(plot)
    own = invented.nominal_diagnosis("s").candidates[0].fingerprint
    assert own is not None
    far = replace(own, curve=5.0 * np.sin(4.0 * own.centre))  # N m
    plot.show_fingerprint(own, invented.FLOOR, look_alikes={"Far off": far})
    low, high = plot.getPlotItem().viewRange()[1]  # mN m
    assert 5.0 < high < 8.0
    assert low == pytest.approx(-high)
    assert np.abs(plot.alike["Far off"].yData).max() > 1000.0  # it is drawn, and told in the numbers
    assert max(np.abs(one.y).max() for one in plot.shown_series()) > 1000.0
    # The effect that is named is whole, however large.
    plot.show_fingerprint(replace(own, curve=3.0 * own.curve), invented.FLOOR, look_alikes={"Far off": far})
    assert plot.getPlotItem().viewRange()[1][1] > 3e3 * invented.FRICTION

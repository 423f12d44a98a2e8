"""What the live plots draw: round ticks, buckets that stay, gaps that stay gaps, history without an end."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QFontMetrics
from pytestqt.qtbot import QtBot

from fingerlab.ui.acquire.live_canvas import WORDS_APART, Canvas
from fingerlab.ui.acquire.live_history import LiveHistory
from fingerlab.ui.widgets.series import live_envelope, round_ticks
from fingerlab.ui.widgets.theme import small_font


@pytest.mark.parametrize(
    ("low", "high", "most", "words"),
    [
        (0.0, 10.0, 5, ["0", "2", "4", "6", "8", "10"]),
        (-13.0, 13.0, 2, ["−10", "0", "10"]),
        (0.013, 0.094, 4, ["0.02", "0.04", "0.06", "0.08"]),
        (3.0, 3.0, 4, []),
    ],
)
def test_ticks_are_round_and_at_least_two(low: float, high: float, most: int, words: list[str]) -> None:
    assert [text for _, text in round_ticks(low, high, most)] == words


@pytest.mark.parametrize(("share", "words"), [(2.0, 3), (0.9, 2), (0.4, 1)])
def test_words_of_ticks_do_not_stand_on_one_another(qtbot: QtBot, share: float, words: int) -> None:
    """In a low plot, as with larger letters, "10", "0" and "−10" had been one blot."""
    canvas = Canvas("Torque residual", "mN m")
    qtbot.addWidget(canvas)
    ticks = round_ticks(-13.0, 13.0, 0)
    needed = QFontMetrics(small_font()).capHeight() + WORDS_APART
    assert len(ticks[:: canvas._every(ticks, share * needed / 10.0)]) == words


def test_a_low_plot_has_room_for_its_unit(qtbot: QtBot) -> None:
    canvas = Canvas("Torque residual", "a unit of many letters")
    qtbot.addWidget(canvas)
    assert canvas.minimumHeight() >= QFontMetrics(small_font()).horizontalAdvance("a unit of many letters")


def test_a_spike_at_the_live_edge_is_drawn_and_buckets_do_not_move() -> None:
    y = np.zeros(1003)
    y[-1] = 5.0
    places, values = live_envelope(7, y, 10)
    assert values.max() == 5.0
    assert places[-1] == 7 + 1002
    more_places, more = live_envelope(7, np.append(y, np.zeros(10)), 10)
    inner = places < 1000
    assert np.array_equal(places[inner], more_places[: inner.sum()])
    assert np.array_equal(values[inner], more[: inner.sum()])


def test_lost_samples_are_nan_and_the_oldest_are_forgotten() -> None:
    history = LiveHistory(("a",), 100.0, seconds=10.0)
    assert history.extend(np.arange(0.0, 50.0), {"a": np.arange(50.0)})
    assert not history.extend(np.arange(60.0, 80.0), {"a": np.arange(60.0, 80.0)})
    first, values = history.series("a", 40, 70)
    assert first == 40
    assert np.isnan(values[10:20]).all()
    assert values[25] == 65.0
    for start in range(80, 5000, 33):
        index = np.arange(start, start + 33, dtype=float)
        history.extend(index, {"a": index})
    assert len(history) == 1000
    assert history.value("a", history.stop - 1) == history.stop - 1
    assert history.value("a", history.first) == history.first
    history.fill(history.stop - 40, {"a": np.full(5, -1.0)})
    assert history.value("a", history.stop - 41) == -1.0
    assert history.value("a", history.stop - 40) == history.stop - 40

"""Columns and pixels of the live plots: right in each column, and the same whether kept or drawn anew."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtGui import QImage, QPainter
from pytestqt.qtbot import QtBot

from fingerlab.ui.acquire.live_canvas import Canvas
from fingerlab.ui.acquire.live_curves import Raster, RasterLook, ShownPart, grid_columns
from fingerlab.ui.acquire.live_history import ColumnView, LiveHistory, LiveTrace, PixelColumns, extremes

NAMES = ("a", "late")
SURFACE, GRID, AXIS, BLACK, BLUE = 0xFFFFFFFF, 0xFFDDDDDD, 0xFF777777, 0xFF000000, 0xFF0072B2
SIZE = 120, 40


def filled(values: np.ndarray, rate_hz: float = 1000.0, first: int = 0) -> LiveHistory:  # type: ignore[type-arg]
    """A history of one column."""
    history = LiveHistory(("a",), rate_hz)
    history.extend(np.arange(first, first + len(values), dtype=float), {"a": values})
    return history


def test_a_column_reaches_from_the_least_to_the_greatest_of_the_line_in_it() -> None:
    values = np.random.default_rng(1).normal(size=900)
    wide = 7.3
    low, high = extremes(filled(values), "a", 3, 100, wide)
    fine = np.arange(0, 899, 1e-3)
    line = np.interp(fine, np.arange(900), values)  # the line itself, a thousand times as fine
    for number in (0, 1, 50, 96):
        inside = (fine >= (3 + number) * wide - 1e-9) & (fine <= (4 + number) * wide + 1e-9)
        assert low[number] == pytest.approx(line[inside].min(), abs=1e-2)
        assert high[number] == pytest.approx(line[inside].max(), abs=1e-2)
    assert (low[1:] <= high[:-1]).all()  # neighbours join
    assert (high[1:] >= low[:-1]).all()


def test_closer_than_a_sample_a_column_the_line_is_straight_between_samples() -> None:
    low, high = extremes(filled(np.array([0.0, 1.0, -1.0])), "a", 0, 20, 0.1)
    assert low[:10] == pytest.approx(np.arange(10) / 10)
    assert high[:10] == pytest.approx(np.arange(1, 11) / 10)
    assert (low[10], high[10]) == pytest.approx((0.8, 1.0))


def test_a_gap_stays_a_gap_and_a_lone_sample_a_dot() -> None:
    values = np.full(100, np.nan)
    values[:20], values[57] = 1.0, 3.0
    low, high = extremes(filled(values), "a", 0, 20, 5.0)
    assert np.isnan(low[4:11]).all()
    assert (low[11], high[11]) == (3.0, 3.0)
    assert np.isnan(high[12:]).all()
    assert (low[:4] == 1.0).all()


def test_samples_that_never_came_are_none_of_what_stood_in_their_place() -> None:
    """A gap, and a column that was not given, where other samples were before all was forgotten."""
    history = LiveHistory(NAMES, 1000.0, seconds=1.0)
    index = np.arange(100.0)
    history.extend(index, dict.fromkeys(NAMES, index + 1.0))
    history.clear()
    history.extend(np.array([0.0, 1.0, 5.0, 6.0]), {"a": np.array([1.0, 2.0, 6.0, 7.0])})
    _, came = history.series("a", 0, 100)
    _, late = history.series("late", 0, 100)
    np.testing.assert_array_equal(came, [1.0, 2.0, np.nan, np.nan, np.nan, 6.0, 7.0])
    np.testing.assert_array_equal(late, np.full(7, np.nan))


def look(scale: tuple[float, float] = (-4.0, 4.0)) -> RasterLook:
    """A narrow black curve and a wide blue one over it."""
    curves = ((BLACK, 1), (BLUE, 2))
    return RasterLook(SIZE, 1.0, scale, (10, 20), 17.3, curves, 1.0, SURFACE, GRID, AXIS)


def shown(raster: Raster, view: ColumnView) -> np.ndarray:  # type: ignore[type-arg]
    """What is painted, shape (rows, columns)."""
    image = QImage(*SIZE, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    raster.paint(painter, QPoint(0, 0), view)
    painter.end()
    return np.frombuffer(image.constBits(), dtype=np.uint32).reshape(SIZE[1], SIZE[0]).copy()


def steps() -> Iterator[tuple[LiveHistory, int, int]]:
    """A bench that runs, with a curve that comes later, gaps, holding and scrolling, zoom, a new start."""
    rng = np.random.default_rng(7)
    history = LiveHistory(NAMES, 1000.0, seconds=4.0)
    now, wide, back = 0, 1000, 0
    for step in range(300):
        count = int(rng.integers(1, 60))
        now += 25 if step % 50 == 30 else 0  # samples that never came
        if step == 200:
            now = 0
        index = np.arange(now, now + count, dtype=float)
        now += count
        history.extend(index, {"a": np.sin(index / 90) + 0.3 * rng.normal(size=count)})
        delay = 40
        history.fill(now - delay, {"late": np.cos(index / 90) - 2})
        if step % 70 > 55:
            back = int(rng.integers(0, 900))
        elif step % 70 == 0:
            back = 0
            wide = (1000, 130, 777, 61, 1500)[step // 70]
        yield history, max(now - back, 1), wide


def test_the_picture_that_is_kept_is_the_one_that_would_be_drawn_anew(qapp: object) -> None:
    """Pixel by pixel, whatever happened since."""
    columns, raster = PixelColumns(), Raster(look())
    whole = 0
    for history, stop, wide in steps():
        view = ColumnView.ending(stop, wide, SIZE[0])
        runs = columns.follow(history, NAMES, view)
        whole += runs == [(view.first, view.stop)]
        for first, last in runs:
            raster.draw(columns, view, (first, min(last + raster.reach - 1, view.stop)))
        anew, again = PixelColumns(), Raster(look())
        anew.follow(history, NAMES, view)
        again.draw(anew, view, (view.first, view.stop))
        # A wide line's first column also shows the one before, which is out of view where all is drawn anew.
        beside = raster.reach - 1
        assert np.array_equal(shown(raster, view)[:, beside:], shown(again, view)[:, beside:])
    assert whole < 100  # most of the 300 steps had columns to keep


def test_pixels_are_where_the_samples_are(qapp: object) -> None:
    history = filled(np.where(np.arange(1200) < 600, -2.0, 2.0))
    columns, raster = (
        PixelColumns(),
        Raster(RasterLook(SIZE, 1.0, (-4.0, 4.0), (), 0.0, ((BLACK, 1),), 1.0, SURFACE, GRID, AXIS)),
    )
    view = ColumnView.ending(1200, 1200, SIZE[0])
    for first, last in columns.follow(history, ("a",), view):
        raster.draw(columns, view, (first, last))
    picture = shown(raster, view)
    (row,) = np.flatnonzero(picture[:, 5] == BLACK)
    assert row == round(39 - 2 * 40 / 8)  # a quarter of the height above the bottom
    (row,) = np.flatnonzero(picture[:, 100] == BLACK)
    assert row == round(39 - 6 * 40 / 8)
    assert (picture[39] == AXIS).all()
    step = np.flatnonzero((picture == BLACK).sum(axis=0) > 1)
    assert step.tolist() == [59]  # the line rises between samples 599 and 600


def test_grid_lines_keep_their_columns() -> None:
    whole = grid_columns(1000, 1200, 17.3)
    assert whole.tolist() == [math.floor(number * 17.3 + 0.5) for number in range(58, 70)]
    pieces = [grid_columns(start, start + 8, 17.3) for start in range(1000, 1200, 8)]
    assert np.concatenate(pieces).tolist() == whole.tolist()
    assert len(grid_columns(0, 100, 0.0)) == 0


def test_a_canvas_of_another_size_or_scale_shows_what_a_new_one_shows(qtbot: QtBot) -> None:
    rng = np.random.default_rng(3)
    history = filled(rng.normal(size=5000))
    traces = (LiveTrace("a", "measured", wide=True),)

    def canvas() -> Canvas:
        made = Canvas("Torque", "mN m")
        qtbot.addWidget(made)
        made.time_axis = True
        return made

    kept = canvas()
    kept.resize(500, 160)
    kept.show_part(ShownPart(history, traces, frozenset(), 0, 2000, 1.0))
    kept.grab()
    for stop, size, scale in ((2100, (500, 160), 4.0), (2500, (377, 140), 4.0), (2500, (377, 140), 9.0)):
        part = ShownPart(history, traces, frozenset(), stop - 2000, stop, 1.0)
        least, most = kept.show_part(part)
        assert (least, most) == pytest.approx((-3.5, 3.5), abs=1.0)
        kept.resize(*size)
        kept.set_scale((-scale, scale))
        new = canvas()
        new.resize(*size)
        new.set_scale((-scale, scale))
        new.show_part(part)
        assert kept.grab().toImage() == new.grab().toImage()

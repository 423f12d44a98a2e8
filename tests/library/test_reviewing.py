"""Pyramid and review, against the samples themselves."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.library.reviewing import (
    BASE,
    LEVELS,
    MOST_SAMPLES,
    PIECE,
    Marker,
    Pyramid,
    broken_at_gaps,
    fill,
    fold,
    load_between,
    markers_of,
    period_of,
    values_at,
)
from fingerlab.sessions.model import Run


def make_run(length: int, trajectory: dict[str, object] | None = None) -> Run:
    """1 kHz with a gap of 5 s in the middle, a spike, and some seconds of force that were not read."""
    time = np.arange(length) / 1000.0
    time[length // 2 :] += 5.0
    position = np.sin(2 * np.pi * time)
    position[length // 3] = 9.0
    force = np.cos(time)
    force[1000:3000] = np.nan
    return Run.from_arrays(
        {"time": time, "motor_position": position, "endpoint_force": force},
        trajectory=trajectory,
        attributes={
            "markers": json.dumps([{"time": 2.0, "note": "b"}, {"time": 1.0, "note": "a"}, {"x": 1}])
        },
    )


@pytest.fixture(scope="module")
def long_run() -> Run:
    return make_run(3 * PIECE + 4321)


@pytest.fixture(scope="module")
def pyramid(long_run: Run) -> Pyramid:
    made = Pyramid(long_run, ["motor_position", "endpoint_force"])
    fill(made, long_run)
    return made


@pytest.mark.parametrize("buckets", [2, 20, 200, 2000])
@pytest.mark.parametrize(("left", "right"), [(0.0, 1e9), (100.0, 180.0), (190.0, 220.0)])
def test_every_extreme_between_two_times_is_in_the_series(
    long_run: Run, pyramid: Pyramid, left: float, right: float, buckets: int
) -> None:
    time, values = long_run.channel("time"), long_run.channel("motor_position")
    inside = (time >= left) & (time <= right)
    x, y = pyramid.series("motor_position", left, right, buckets)
    assert y.max() >= values[inside].max() - 1e-6
    assert y.min() <= values[inside].min() + 1e-6
    assert (np.diff(x) >= 0).all()
    assert x[0] <= max(left, time[0])
    # Never many more points than the picture is wide, however long the run.
    assert len(y) <= 2 * max(4 * buckets, len(values) // PIECE + 1) + 4
    for stretch_start, low, high in zip(x[::2], y[::2], y[1::2], strict=True):
        assert low - 1e-6 <= np.interp(stretch_start, time, values) <= high + 1e-6


def test_what_was_never_read_stays_a_gap(pyramid: Pyramid) -> None:
    x, y = pyramid.series("endpoint_force", 1.2, 2.8, 10)
    assert np.isnan(y[(x > 1.2) & (x < 2.8)]).all()


def test_memory_of_ten_hours_is_small() -> None:
    ten_hours = Run.from_arrays({"time": np.arange(4) / 1000.0, "motor_position": np.zeros(4)})
    object.__setattr__(ten_hours, "length", 36_000_000)
    made = Pyramid(ten_hours, [f"c{k}" for k in range(8)])
    assert made.bytes_held < 30e6
    assert made.series("c0", 0.0, 36_000.0, 1000)[0].size <= 8 * 1000
    assert LEVELS == 6


def test_a_partly_filled_pyramid_shows_what_it_has_and_can_be_continued(long_run: Run) -> None:
    made = Pyramid(long_run, ["motor_position"])
    with pytest.raises(Cancelled):
        fill(made, long_run, cancelled=lambda: made.filled >= PIECE)
    assert made.filled == PIECE
    x, y = made.series("motor_position", 0.0, 1e9, 3000)
    assert np.isfinite(y[x < 131.0]).all()
    assert np.isnan(y[x > 131.2]).all()
    assert (np.diff(x) >= 0).all()
    fill(made, long_run)
    assert made.complete
    assert made.last_time == pytest.approx(long_run.channel("time")[-1])


def test_samples_are_read_only_where_they_are_few(long_run: Run, pyramid: Pyramid) -> None:
    piece = load_between(long_run, pyramid, ["motor_position"], 10.0, 11.0)
    assert piece is not None
    assert piece["time"][0] <= 10.0
    assert piece["time"][-1] >= 11.0
    assert len(piece["time"]) <= 1001 + 3 * BASE
    longest = Run.from_arrays({"time": np.arange(4) / 1000.0})
    object.__setattr__(longest, "length", MOST_SAMPLES * 2)
    assert load_between(longest, Pyramid(longest, []), [], 0.0, 1e9) is None


def test_no_line_runs_over_a_gap_in_time() -> None:
    time, values = np.array([0.0, 0.001, 0.002, 3.0, 3.001]), np.arange(5.0)
    x, y = broken_at_gaps(time, values, 1000.0)
    assert x.tolist() == [0.0, 0.001, 0.002, 0.002, 3.0, 3.001]
    assert np.array_equal(y, [0.0, 1.0, 2.0, np.nan, 3.0, 4.0], equal_nan=True)


def test_the_value_at_a_cursor_is_that_of_the_nearest_sample(long_run: Run, pyramid: Pyramid) -> None:
    for wanted in (0.0, 12.3454, 300.0, 1e9):
        all_times = long_run.channel("time")
        index = int(np.argmin(np.abs(all_times - wanted)))
        time, values = values_at(long_run, pyramid, ["motor_position"], wanted)
        assert time == all_times[index]
        assert values["motor_position"] == long_run.channel("motor_position")[index]


def test_markers_in_the_order_of_time(long_run: Run) -> None:
    assert markers_of(long_run) == (Marker(1.0, "a"), Marker(2.0, "b"))


def test_strokes_lie_over_one_another() -> None:
    time = np.arange(10_500) / 1000.0
    run = Run.from_arrays(
        {"time": time, "motor_position": np.sin(2 * np.pi * 2.0 * time)},
        trajectory={"kind": "sine", "frequency_hz": 2.0},
    )
    made = Pyramid(run, ["motor_position"])
    fill(made, run)
    assert period_of(run) == 0.5
    cycles = fold(run, made, ["motor_position"])
    assert (cycles.count, cycles.total) == (20, 20)
    x, y = cycles.series["motor_position"]
    there = np.isfinite(y)
    assert y[there] == pytest.approx(np.sin(4 * np.pi * x[there]), abs=1e-9)
    assert (~there).sum() == 20
    with pytest.raises(UserError, match="no sine"):
        fold(Run.from_arrays({"time": time}), made, [])

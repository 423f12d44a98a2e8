"""Operators with memory against a plain loop over the samples and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim

from fingerlab.effects.base import STEEP
from fingerlab.physics.friction_states import (
    dahl_states,
    first_order_lags,
    friction_state,
    lagging_state,
    rubbing_forces,
    slip_state,
    slip_states,
    stop_operators,
)
from fingerlab.sessions.model import Array


def stop_operator(position: Array, travel: float) -> Array:
    return stop_operators(position, [travel])[0]


def rubbing_force(position: Array, limit: Array, stiffness: float) -> Array:
    return rubbing_forces(position, limit, [stiffness])[0]


def dahl_state(position: Array, travel: float) -> Array:
    return dahl_states(position, [travel])[0]


def first_order_lag(values: Array, time_constant: float, rate_hz: float) -> Array:
    return first_order_lags(values, [time_constant], rate_hz)[0]


def triangle(amplitude: float, samples: int, cycles: int) -> Array:
    """From zero up to the amplitude and on in straight lines; ``samples`` a quarter of a cycle."""
    up = np.arange(samples) / samples
    cycle = np.concatenate((up, 1 - up, -up, up - 1))
    return amplitude * np.tile(cycle, cycles)


def looped_stop(position: Array, travel: float) -> Array:
    state, result = 0.0, [0.0]
    for step in np.diff(position):
        state = max(-1.0, min(1.0, state + step / travel))
        result.append(state)
    return np.array(result)


def looped_dahl(position: Array, travel: float, substeps: int = 2000) -> Array:
    """dz = (1 - z sign(dx)) dx / travel in very small Euler steps."""
    state, result = 0.0, [0.0]
    for step in np.diff(position):
        for _ in range(substeps):
            state += (1.0 - state * np.sign(step)) * step / substeps / travel
        result.append(state)
    return np.array(result)


@pytest.mark.parametrize("length", [1, 2, 3, 17, 1000, 1025])
@pytest.mark.parametrize("travel", [0.002, 0.05, 3.0])
def test_stop_operator_is_the_loop(length: int, travel: float) -> None:
    position = 0.4 + 0.01 * np.cumsum(np.random.default_rng(length).standard_normal(length))
    assert stop_operator(position, travel) == pytest.approx(looped_stop(position, travel), abs=1e-10)


def test_stop_operator_on_a_triangle_wave() -> None:
    amplitude, travel, quarter = 0.2, 0.05, 400
    position = triangle(amplitude, quarter, 3)
    state = stop_operator(position, travel)
    rising = slice(0, quarter)
    assert state[rising] == pytest.approx(np.minimum(position[rising] / travel, 1.0), abs=1e-12)
    # After the reversal at the top it lets go over twice the travel, from +1 to -1.
    falling = slice(quarter, 3 * quarter)
    way = amplitude - position[falling]
    assert state[falling] == pytest.approx(np.maximum(1.0 - way / travel, -1.0), abs=1e-12)
    # Work lost in a closed cycle: a parallelogram of height 2 and length 2 (amplitude - travel).
    last = slice(8 * quarter, 12 * quarter)
    lost = np.sum(0.5 * (state[last][1:] + state[last][:-1]) * np.diff(position[last]))
    assert lost == pytest.approx(4 * (amplitude - travel), rel=2e-2)


def test_stop_operator_does_not_rub_within_its_travel() -> None:
    """Below the travel it is a spring: the state follows the position and nothing is lost."""
    position = 0.9 * 0.05 * np.sin(np.linspace(0, 20, 3000))
    assert stop_operator(position, 0.05) == pytest.approx(position / 0.05, abs=1e-12)


@pytest.mark.parametrize(("power", "start"), [(1.0, 1.0), (1.5, 1.0), (2.0, 1.0), (2.0, 0.7), (1.0, 0.6)])
def test_friction_goes_along_its_virgin_curve_and_back_along_twice_of_it(power: float, start: float) -> None:
    """F(x) = 1 - (1 - (x / d)^a / p)^p, and 1 - 2 F(x / 2) behind a reversal (Masing 1926)."""
    travel = 0.1  # twice d

    def curve(way: Array) -> Array:
        return 1.0 - np.maximum(1.0 - (way / (0.5 * travel)) ** start / power, 0.0) ** power

    position = triangle(0.25, 500, 2)
    state = friction_state(position, travel, 1.0 / power, start=start)
    rising, falling = slice(0, 500), slice(500, 1500)
    near = 0.02 if start == 1.0 else 0.08  # before the first slider lets go a steep curve is a straight one
    assert state[rising] == pytest.approx(curve(position[rising]), abs=near)
    assert state[falling] == pytest.approx(1.0 - 2.0 * curve(0.5 * (0.25 - position[falling])), abs=2 * near)
    off = state[rising] - curve(position[rising])
    assert np.sqrt(np.mean(off**2)) < 0.02


def test_equal_contacts_with_travels_spread_evenly_begin_steeply() -> None:
    """Contacts as strong as each other that let go evenly up to L: F = y (1 - ln y) with y = x / L."""
    way = np.linspace(0.0, 0.3, 1501)
    y = np.clip(way / 0.2, 1e-12, 1.0)
    exact = y * (1.0 - np.log(y))

    def off(travel: float, start: float) -> float:
        return float(np.sqrt(np.mean((friction_state(way, travel, 0.5, start=start) - exact) ** 2)))

    travels = np.linspace(0.08, 0.3, 100)
    assert min(off(travel, STEEP) for travel in travels) < 0.015
    assert min(off(travel, 1.0) for travel in travels) > 0.03


def test_no_sharpness_is_many_sliders() -> None:
    position = triangle(0.2, 300, 2)
    assert friction_state(position, 0.05) == pytest.approx(slip_state(position, 0.05), abs=1e-12)


@pytest.mark.parametrize("travel", [0.01, 0.1, 1.0])
def test_dahl_is_the_loop(travel: float) -> None:
    position = -0.3 + 0.02 * np.cumsum(np.random.default_rng(3).standard_normal(120))
    assert dahl_state(position, travel) == pytest.approx(looped_dahl(position, travel), abs=2e-3)


def test_dahl_on_first_loading_and_in_the_steady_cycle() -> None:
    """Dahl 1968: z = 1 - exp(-x / travel) at first; a cycle of amplitude A peaks at tanh(A / travel)."""
    amplitude, travel, quarter = 0.06, 0.1, 250
    position = triangle(amplitude, quarter, 40)
    state = dahl_state(position, travel)
    assert state[:quarter] == pytest.approx(1 - np.exp(-position[:quarter] / travel), abs=1e-12)
    last = state[-4 * quarter :]
    assert last.max() == pytest.approx(np.tanh(amplitude / travel), rel=1e-6)
    assert last.min() == pytest.approx(-np.tanh(amplitude / travel), rel=1e-6)


def test_dahl_far_from_a_reversal_is_coulomb_friction() -> None:
    state = dahl_state(triangle(2.0, 500, 2), 0.05)
    assert state[499] == pytest.approx(1.0, abs=1e-9)
    assert state[1499] == pytest.approx(-1.0, abs=1e-9)


def test_neither_depends_on_how_densely_a_path_is_sampled() -> None:
    fine, coarse = triangle(0.2, 600, 2), triangle(0.2, 60, 2)
    assert stop_operator(fine, 0.03)[::10] == pytest.approx(stop_operator(coarse, 0.03), abs=1e-9)
    assert dahl_state(fine, 0.03)[::10] == pytest.approx(dahl_state(coarse, 0.03), abs=1e-9)


def test_neither_depends_on_where_it_starts_or_on_the_sign() -> None:
    path = np.cumsum(np.random.default_rng(8).standard_normal(700)) * 0.01
    for operator in (stop_operator, dahl_state):
        assert operator(path + 5.0, 0.04) == pytest.approx(operator(path, 0.04), abs=1e-9)
        assert operator(-path, 0.04) == pytest.approx(-operator(path, 0.04), abs=1e-9)


def test_slip_state_builds_up_as_its_closed_form() -> None:
    """Behind a reversal 1 - 2 exp(-x / d), and from rest, where half the way is to go, 1 - exp(-2 x / d)."""
    travel = 0.3
    out, back = np.linspace(0.0, 3.0, 4001), np.linspace(3.0, 0.0, 4001)[1:]
    state = slip_state(np.concatenate((out, back)), travel)
    assert state[:4001] == pytest.approx(1.0 - np.exp(-2 * out / travel), abs=0.025)
    turned = 3.0 - back
    assert state[4001:] == pytest.approx(-(1.0 - 2.0 * np.exp(-turned / travel)), abs=0.05)


def test_a_small_shake_leaves_the_slip_state_alone_and_wears_dahls_down() -> None:
    position = np.concatenate((np.linspace(0.0, 1.0, 2000), 1.0 + 2e-3 * (np.arange(4000) % 2)))
    assert slip_state(position, 0.1)[-1] > 0.95
    assert dahl_state(position, 0.1)[-1] < 0.1


def test_slip_states_share_the_sliders_of_travels_that_are_twice_as_long() -> None:
    asked: list[Array] = []
    position = 0.01 * np.cumsum(np.random.default_rng(5).standard_normal(700))

    def stops(path: Array, travels: Array) -> Array:
        asked.append(travels)
        return stop_operators(path, travels)

    travels = np.radians((0.15, 0.3, 0.6))
    found = slip_states(position, travels, stops)
    assert [len(sliders) for sliders in asked] == [6]
    for travel, state in zip(travels, found, strict=True):
        assert state == pytest.approx(slip_state(position, float(travel)), abs=1e-12)


@pytest.mark.parametrize("length", [1, 2, 31, 32, 33, 1025])
@pytest.mark.parametrize("time_constant", [0.004, 0.3, 40.0])
def test_first_order_lag_is_that_of_scipy(length: int, time_constant: float) -> None:
    """Of values that change evenly between samples (``lsim`` interpolates them), at rest on the first one."""
    values = np.cumsum(np.random.default_rng(length).standard_normal(length))
    time = np.arange(max(length, 2)) / 250.0
    padded = np.resize(values, len(time)) - values[0]
    expected = values[0] + lsim(([1.0], [time_constant, 1.0]), padded, time)[1][:length]
    assert first_order_lag(values, time_constant, 250.0) == pytest.approx(expected, abs=1e-9)


def test_several_constants_at_once_are_each_on_its_own() -> None:
    rng = np.random.default_rng(6)
    position, limit = 0.01 * np.cumsum(rng.standard_normal(500)), rng.random(500)
    constants = (0.004, 0.03, 0.2)
    for several, one in (
        (stop_operators(position, constants), [stop_operator(position, c) for c in constants]),
        (dahl_states(position, constants), [dahl_state(position, c) for c in constants]),
        (rubbing_forces(position, limit, constants), [rubbing_force(position, limit, c) for c in constants]),
        (
            first_order_lags(position, constants, 250.0),
            [first_order_lag(position, c, 250.0) for c in constants],
        ),
    ):
        assert several == pytest.approx(np.stack(one), abs=1e-12)


def looped_rubbing(position: Array, limit: Array, stiffness: float) -> Array:
    force, result = 0.0, []
    for step, most in zip(np.diff(position, prepend=position[:1]), limit, strict=True):
        force = min(max(force + stiffness * step, -most), most)
        result.append(force)
    return np.array(result)


@pytest.mark.parametrize("length", [1, 2, 5, 300, 1025])
def test_rubbing_force_is_the_loop(length: int) -> None:
    rng = np.random.default_rng(length)
    position = np.cumsum(rng.standard_normal(length)) * 1e-5
    limit = np.clip(rng.standard_normal(length).cumsum() * 0.1 + 0.3, 0.0, None)
    found = rubbing_force(position, limit, 3e4)
    assert found == pytest.approx(looped_rubbing(position, limit, 3e4), abs=1e-9)


def test_a_tip_that_sticks_keeps_its_force_while_it_is_pressed_harder() -> None:
    position = np.concatenate((np.linspace(0.0, 1e-4, 100), np.full(100, 1e-4)))
    limit = np.concatenate((np.full(100, 0.5), np.linspace(0.5, 2.0, 50), np.linspace(2.0, 0.2, 50)))
    force = rubbing_force(position, limit, 1e5)
    assert force[60:170] == pytest.approx(0.5)  # it slid at 0.5 N and then stood
    assert force[-1] == pytest.approx(0.2)  # what its friction can still hold


def test_what_sticks_is_damped_and_holds_no_more_than_its_limit() -> None:
    """A spring of 100 N/m with a damper of 0.02 of that, s, moved at 0.1 m/s and back; it holds 5 N."""
    time = np.arange(0.0, 2.0, 1e-3)
    speed = np.where(time < 1.0, 0.1, -0.1)
    position = np.concatenate(([0.0], np.cumsum(speed[:-1]) * 1e-3))
    limit = np.full(len(time), 5.0)
    force = rubbing_forces(position, limit, [100.0], lead=0.02 * speed)[0]
    spring = rubbing_forces(position, limit, [100.0])[0]
    sticks = np.abs(spring) < 4.7
    np.testing.assert_allclose(force[sticks], (spring + 100.0 * 0.02 * speed)[sticks])
    assert float(np.abs(force).max()) == 5.0
    assert force[np.searchsorted(time, 0.9)] == 5.0  # 9 N of stretch would be more than it holds


def test_a_friction_that_falls_follows_over_the_travel() -> None:
    """Up as 1 - exp(-x/d) under a level of one, and down from there as exp(-x/d) when the level is gone."""
    travel, way = 0.3, np.linspace(0.0, 2.0, 401)
    level = (way <= 1.0).astype(float)
    top = 1.0 - np.exp(-1.0 / travel)
    expected = np.where(way <= 1.0, 1.0 - np.exp(-way / travel), top * np.exp(-(way - 1.0) / travel))
    assert lagging_state(way, level, travel) == pytest.approx(expected, abs=1e-12)
    assert lagging_state(-way, level, travel) == pytest.approx(-expected, abs=1e-12)

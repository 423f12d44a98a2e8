"""The plant's equations against an independent derivation and closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp

from fingerlab.twin.bench import build_bench, draw_truth, place_bench
from fingerlab.twin.integrate import (
    advance_finger,
    advance_motor,
    cable_path,
    dry_friction,
    finger_bias,
    finger_mass,
    fingertip,
    joint_elastic,
    moment_arms,
    pose,
)
from fingerlab.twin.plant import BRISTLES, MCP, STATE
from fingerlab.twin.protocols import load_preset


@pytest.fixture
def plant() -> Any:
    bench = build_bench(load_preset(), draw_truth(load_preset(), np.random.default_rng(5)), "flexion")
    place_bench(bench, in_contact=False)
    bench.plant["knuckle_mass"] = 0.004
    bench.plant["hung_mass"], bench.plant["hung_at"] = 0.006, 0.041
    bench.plant["coupling"] = 0.02
    bench.plant["cubic_1"], bench.plant["cubic_2"] = 0.3, 0.2
    bench.plant["arm_slope_1"], bench.plant["arm_slope_2"] = 0.4, -0.3
    return bench.plant


def lagrangian_torques(plant: Any, share: float) -> Any:
    """Left-hand sides from sympy's Lagrangian, as functions of angles, speeds and accelerations."""
    t = sp.Symbol("t")
    q1, q2 = sp.Function("q1")(t), sp.Function("q2")(t)
    long1, long2 = 2 * float(plant["proximal_half_length"]), 2 * float(plant["distal_half_length"])
    up1 = float(plant["tilt"]) - q1
    up2 = up1 - q2

    def body(mass: float, x: Any, y: Any) -> tuple[Any, Any]:
        return sp.Rational(1, 2) * mass * (x.diff(t) ** 2 + y.diff(t) ** 2), mass * float(
            plant["gravity"]
        ) * y

    knuckle = (long1 * sp.cos(up1), long1 * sp.sin(up1))
    parts = (
        body(float(plant["proximal_mass"]), knuckle[0] / 2, knuckle[1] / 2),
        body(float(plant["knuckle_mass"]), *knuckle),
        body(
            float(plant["distal_mass"]),
            knuckle[0] + long2 / 2 * sp.cos(up2),
            knuckle[1] + long2 / 2 * sp.sin(up2),
        ),
        body(
            float(plant["hung_mass"]),
            knuckle[0] + float(plant["hung_at"]) * sp.cos(up2),
            knuckle[1] + float(plant["hung_at"]) * sp.sin(up2),
        ),
    )
    kinetic = sum(p[0] for p in parts)
    kinetic += sp.Rational(1, 2) * float(plant["proximal_inertia"]) * q1.diff(t) ** 2
    kinetic += sp.Rational(1, 2) * float(plant["distal_inertia"]) * (share * q1.diff(t) + q2.diff(t)) ** 2
    potential = sum(p[1] for p in parts)
    potential += float(plant["stiffness_1"]) * q1**2 / 2 + float(plant["stiffness_2"]) * q2**2 / 2
    potential += float(plant["cubic_1"]) * q1**4 / 4 + float(plant["cubic_2"]) * q2**4 / 4
    potential += float(plant["coupling"]) * (q1 - q2) ** 2 / 2
    lagrangian = kinetic - potential
    names = sp.symbols("a1 a2 w1 w2 x1 x2")
    values = [q1.diff(t, 2), q2.diff(t, 2), q1.diff(t), q2.diff(t), q1, q2]
    left = [(lagrangian.diff(q.diff(t)).diff(t) - lagrangian.diff(q)).doit() for q in (q1, q2)]
    return sp.lambdify(names, [e.subs(list(zip(values, names, strict=True))) for e in left])


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_equations_of_motion_are_those_of_the_lagrangian(plant: Any, share: float) -> None:
    plant["distal_rotation"] = share
    expected = lagrangian_torques(plant, share)
    rng = np.random.default_rng(0)
    for _ in range(20):
        a1, a2, w1, w2 = rng.normal(0.0, 20.0, 4)
        q1, q2 = rng.uniform(-1.0, 1.0, 2)
        at = pose(plant, q1, q2)
        m11, m12, m22 = finger_mass(plant, at)
        c1, c2 = finger_bias(plant, at, w1, w2)
        k1, k2 = joint_elastic(plant, q1, q2, w2, q1, q2)
        ours = [m11 * a1 + m12 * a2 + c1 + k1, m12 * a1 + m22 * a2 + c2 + k2]
        np.testing.assert_allclose(ours, expected(a1, a2, w1, w2, q1, q2), rtol=1e-11, atol=1e-14)


def test_moment_arms_are_the_slopes_of_the_cable_path(plant: Any) -> None:
    h = 1e-6
    for q1, q2 in ((0.3, -0.5), (-0.4, 0.6)):
        arms = moment_arms(plant, pose(plant, q1, q2))
        slope1 = (
            cable_path(plant, q1 + h, q2, pose(plant, q1 + h, q2))
            - cable_path(plant, q1 - h, q2, pose(plant, q1 - h, q2))
        ) / (2 * h)
        slope2 = (
            cable_path(plant, q1, q2 + h, pose(plant, q1, q2 + h))
            - cable_path(plant, q1, q2 - h, pose(plant, q1, q2 - h))
        ) / (2 * h)
        np.testing.assert_allclose(arms, (slope1, slope2), rtol=1e-8)


def test_fingertip_slopes_are_those_of_its_position(plant: Any) -> None:
    h, q1, q2 = 1e-6, 0.35, 0.45
    _, _, x1, x2, y1, y2 = fingertip(plant, pose(plant, q1, q2))
    for slope, index, d1, d2 in ((x1, 0, h, 0.0), (x2, 0, 0.0, h), (y1, 1, h, 0.0), (y2, 1, 0.0, h)):
        ahead = fingertip(plant, pose(plant, q1 + d1, q2 + d2))[index]
        behind = fingertip(plant, pose(plant, q1 - d1, q2 - d2))[index]
        assert slope == pytest.approx((ahead - behind) / (2 * h), rel=1e-7)


def test_finger_hangs_where_springs_carry_its_weight() -> None:
    preset = load_preset()
    bench = build_bench(preset, draw_truth(preset, np.random.default_rng(1)), "extension")
    p = bench.plant
    q1, q2 = place_bench(bench, in_contact=False)
    m1, m2, l1, l2 = p["proximal_mass"], p["distal_mass"], p["proximal_half_length"], p["distal_half_length"]
    distal = m2 * 9.81 * l2 * math.cos(q1 + q2 - math.radians(15))
    proximal = 9.81 * (m1 + 2 * m2) * l1 * math.cos(math.radians(15) - q1)
    assert q2 == pytest.approx(distal / p["stiffness_2"], rel=1e-9)
    assert q1 == pytest.approx((distal + proximal) / p["stiffness_1"], rel=1e-9)


def test_small_oscillations_have_the_frequencies_of_the_linear_system() -> None:
    preset = load_preset()
    bench = build_bench(preset, draw_truth(preset, np.random.default_rng(2)), "extension")
    p = bench.plant
    rest = place_bench(bench, in_contact=False)
    p["viscous_1"] = p["viscous_2"] = 0.0
    m1, m2, l1, l2 = p["proximal_mass"], p["distal_mass"], p["proximal_half_length"], p["distal_half_length"]
    i1, i2, c2 = p["proximal_inertia"], p["distal_inertia"], math.cos(rest[1])
    m12 = m2 * (l2**2 + 2 * l1 * l2 * c2)
    mass = np.array(
        [[i1 + (m1 + 4 * m2) * l1**2 + m2 * l2**2 + 4 * m2 * l1 * l2 * c2, m12], [m12, m2 * l2**2 + i2]]
    )
    sag1 = 9.81 * (m1 + 2 * m2) * l1 * math.sin(math.radians(15) - rest[0])
    sag2 = -9.81 * m2 * l2 * math.sin(rest[0] + rest[1] - math.radians(15))
    stiffness = np.array([[p["stiffness_1"] - sag1 - sag2, -sag2], [-sag2, p["stiffness_2"] - sag2]])
    squares, modes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    for omega, mode in zip(np.sqrt(squares), modes.T, strict=True):
        assert swing(bench, rest, 1e-4 * mode) == pytest.approx(omega, rel=2e-4)


def swing(bench: Any, rest: tuple[float, float], start: Any) -> float:
    """Angular frequency (rad/s) of a free swing, from the times at which it passes the rest angle."""
    state = np.zeros(1, STATE)[0]
    state["q1"], state["q2"] = rest[0] + start[0], rest[1] + start[1]
    memory, step = np.zeros(BRISTLES), 2e-5
    values = np.empty(30_000)
    for k in range(len(values)):
        values[k] = state["q2"] - rest[1]
        at = pose(bench.plant, state["q1"], state["q2"])
        advance_finger(bench.plant, bench.friction, memory, state, at, 0.0, step)
    up = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
    times = (up - values[up] / (values[up + 1] - values[up])) * step
    return float(2 * math.pi * (len(times) - 1) / (times[-1] - times[0]))


def rubbing_bench() -> Any:
    preset = load_preset()
    bench = build_bench(preset, draw_truth(preset, np.random.default_rng(3)), "none")
    bench.friction[2]["forward"] = bench.friction[2]["backward"] = 6e-3
    return bench


def test_motor_held_by_friction_does_not_creep() -> None:
    """A load of 5 mN m that shakes by 0.8 mN m stays below a friction of 6 mN m: nothing moves for good."""
    bench = rubbing_bench()
    state, memory = np.zeros(1, STATE)[0], np.zeros(BRISTLES)
    where = []
    for k in range(60_000):
        load = min(k * 1e-4, 1.0) * (5e-3 + 0.8e-3 * math.sin(2 * math.pi * 2 * k * 1e-4))
        advance_motor(bench.plant, bench.friction, memory, state, load, 0.0, 1e-4)
        if k in (29_999, 59_999):  # whole periods of the shake
            where.append(float(state["theta"]))
    assert abs(where[0]) < bench.friction[2]["travel"]  # wound up elastically, not slid
    assert abs(where[1] - where[0]) < 1e-9


def test_joint_held_by_friction_stays_where_it_was_released() -> None:
    """Released 0.015 rad off its rest against 2.5 mN m of friction (spring: 1.7 mN m), it stays for good."""
    preset = load_preset()
    bench = build_bench(preset, draw_truth(preset, np.random.default_rng(4)), "extension")
    bench.friction["forward"][:2] = bench.friction["backward"][:2] = 2.5e-3
    rest = place_bench(bench, in_contact=False)
    state, memory = np.zeros(1, STATE)[0], np.zeros(BRISTLES)
    state["q1"], state["q2"] = rest[0] + 0.015, rest[1] + 0.015
    where = []
    for k in range(20_000):
        at = pose(bench.plant, state["q1"], state["q2"])
        advance_finger(bench.plant, bench.friction, memory, state, at, 0.0, 1e-4)
        if k in (9_999, 19_999):
            where.append((float(state["q1"]) - rest[0], float(state["q2"]) - rest[1]))
    np.testing.assert_allclose(where[1], where[0], atol=1e-10)
    assert min(where[1]) > 0.012


def test_motor_slides_when_the_load_exceeds_friction() -> None:
    """Constant acceleration (load - friction) / inertia once it slides."""
    bench = rubbing_bench()
    bench.plant["motor_viscous"] = 0.0
    state, memory = np.zeros(1, STATE)[0], np.zeros(BRISTLES)
    speeds = []
    for k in range(10_000):
        advance_motor(bench.plant, bench.friction, memory, state, 9e-3, 0.0, 1e-4)
        if k in (4_999, 9_999):
            speeds.append(float(state["omega"]))
    assert (speeds[1] - speeds[0]) / 0.5 == pytest.approx(-3e-3 / bench.plant["inertia"], rel=1e-6)


def test_presliding_friction_follows_masings_rule() -> None:
    """A reversed branch is the first loading curve at twice the scale; closed form of the curve known.

    For sliders whose yield travels are spread evenly up to D the force after a first travel x is
    2 F (x/D) - F (x/D)^2, up to the spacing of the sliders.
    """
    bench = rubbing_bench()
    law = bench.friction[MCP]
    law["forward"] = law["backward"] = 0.0
    law["spread"], law["spread_travel"] = 4e-3, 0.1
    memory = np.zeros(BRISTLES)

    def travel(distance: float) -> float:
        force = 0.0
        for _ in range(100):
            force = dry_friction(bench.friction, memory, MCP, distance / 100, 0.0, 0.0, 1e-4)
        return force

    def first(x: float) -> float:
        return 4e-3 * (2 * x / 0.1 - (x / 0.1) ** 2)

    assert travel(0.06) == pytest.approx(first(0.06), abs=4e-3 / 8**2)
    assert travel(-0.08) == pytest.approx(first(0.06) - 2 * first(0.04), abs=2 * 4e-3 / 8**2)
    assert travel(0.08) == pytest.approx(first(0.06), abs=4e-3 / 8**2)  # the loop closes
    assert travel(0.5) == pytest.approx(4e-3, rel=1e-12)  # and it ends at its level

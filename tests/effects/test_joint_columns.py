"""Torques at the joints: each column has the size and sign that a closed form gives.

A column of the joint equations is a torque that the cable has to hold up on top of the nominal one: friction
at positive gain opposes motion, springs oppose deflection.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.effects.joints import lateral_levers
from fingerlab.physics import nominal

from .moving import FINGER, RATE, column, moving, wave

TILT_RAD = np.radians(16.0)  # a point of the grid
LAST = slice(500, None)  # the third and fourth second: a whole cycle of the slower joint
SPEEDS = {Row.MCP: "mcp_velocity", Row.PIP: "pip_velocity"}
ANGLES = {Row.MCP: "mcp", Row.PIP: "pip"}
FRICTION = ["viscous_friction", "coulomb_friction", "stribeck_friction", "presliding_hysteresis"]


@pytest.mark.parametrize("row", list(SPEEDS))
@pytest.mark.parametrize("name", [*FRICTION, "viscoelastic_creep"])
def test_friction_takes_work_over_a_cycle(name: str, row: Row) -> None:
    motion = moving()
    speed = getattr(motion.joints, SPEEDS[row])
    gain = f"relaxing_{row.name.lower()}" if name == "viscoelastic_creep" else None
    for shape in CATALOGUE[name].shapes:
        torque = column(CATALOGUE[name].columns(motion, shape), row, gain)
        # The torque that the cable must add does work on the joint: friction turns it into heat.
        assert np.sum((torque * speed)[LAST]) > 0
        if name == "coulomb_friction" and shape["travel_deg"] < 0.2:  # a longer travel is still building up
            fast = (np.abs(speed) > 0.5) & (motion.time > 0.1)  # it starts unloaded
            assert torque[fast] == pytest.approx(np.sign(speed[fast]), abs=0.02)


@pytest.mark.parametrize("held_rad", [0.0, 0.6])
def test_creep_of_a_joint_that_had_been_held_elsewhere(held_rad: float) -> None:
    """T dz/dt = angle - z from the angle where it was held, by scipy; the spring holds K (angle - z)."""
    motion = moving()
    assert motion.joints is not None
    angle, stiffness = motion.joints.mcp, 0.02
    for shape in CATALOGUE["viscoelastic_creep"].shapes:
        constant = shape["time_constant"]

        def rate(t: float, z: np.ndarray, constant: float = constant) -> np.ndarray:
            return (np.interp(t, motion.time, angle) - z) / constant

        relaxed = solve_ivp(rate, (0.0, motion.time[-1]), [held_rad], t_eval=motion.time, max_step=2e-3).y[0]
        terms = CATALOGUE["viscoelastic_creep"].columns(motion, shape)
        torque = stiffness * column(terms, Row.MCP, "relaxing_mcp")
        torque += stiffness * (angle[0] - held_rad) * column(terms, Row.MCP, "start_mcp")
        assert torque == pytest.approx(stiffness * (angle - relaxed), abs=1e-4)


def test_work_lost_to_viscous_and_coulomb_friction() -> None:
    """Per cycle of amplitude A at angular frequency w: pi w A^2, and 4 A less what comes back on reversals.

    After a reversal the torque is 1 - 2 exp(-x / d): over both reversals of a cycle that is 4 d less.
    """
    motion = moving()
    amplitude, omega = 0.25, 2 * np.pi  # of the MCP joint; two cycles in the last two seconds

    def work(name: str, shape: int = 0) -> float:
        torque = column(CATALOGUE[name].columns(motion, CATALOGUE[name].shapes[shape]), Row.MCP)
        assert motion.joints is not None
        return float(np.sum((torque * motion.joints.mcp_velocity)[LAST]) / RATE / 2)

    assert work("viscous_friction") == pytest.approx(np.pi * omega * amplitude**2, rel=1e-3)
    for shape, travel in enumerate(np.radians((0.06, 0.085, 0.12))):
        assert CATALOGUE["coulomb_friction"].shapes[shape] == {
            "travel_deg": pytest.approx(np.degrees(travel))
        }
        assert work("coulomb_friction", shape) == pytest.approx(4 * (amplitude - travel), rel=5e-3)


@pytest.mark.parametrize("law", [{}, {"masing": 1.0, "start": 1.0, "sharpness": 0.5}])
def test_presliding_of_the_pip_joint_may_have_a_travel_of_its_own(law: dict[str, float]) -> None:
    """Each joint then has what both have at its travel."""
    motion, effect = moving(), CATALOGUE["presliding_hysteresis"]
    apart = effect.columns(motion, {**law, "travel_deg": 2.0, "pip_travel_deg": 6.0})
    for row, travel in ((Row.MCP, 2.0), (Row.PIP, 6.0)):
        alike = column(effect.columns(motion, {**law, "travel_deg": travel}), row)
        assert column(apart, row) == pytest.approx(alike, abs=1e-12)
    assert column(apart, Row.PIP) != pytest.approx(
        column(effect.columns(motion, {**law, "travel_deg": 2.0}), Row.PIP), abs=0.05
    )


def test_stribeck_excess_is_gone_at_speed() -> None:
    motion = moving()
    assert motion.joints is not None
    for shape in CATALOGUE["stribeck_friction"].shapes:
        terms = CATALOGUE["stribeck_friction"].columns(motion, shape)
        extra, sliding = column(terms, Row.MCP, "extra_mcp"), column(terms, Row.MCP, "coulomb_mcp")
        ratio = np.abs(motion.joints.mcp_velocity) / shape["stribeck_speed"]
        assert np.abs(extra[ratio > 3]) == pytest.approx(0.0, abs=2e-4)
        near = ratio < 0.1
        assert extra[near] == pytest.approx(sliding[near], abs=0.011)


def test_hardening_stiffness_and_coupling() -> None:
    motion = moving()
    q = motion.joints
    assert q is not None
    cubic = CATALOGUE["spring_hardening"].columns(motion, {})
    linear = CATALOGUE["stiffness_error"].columns(motion, {})
    for row, name in ANGLES.items():
        angle = getattr(q, name)
        assert column(cubic, row) == pytest.approx(angle**3)
        assert column(linear, row) == pytest.approx(angle)
    coupling = CATALOGUE["joint_coupling"].columns(motion, {})
    # Energy k (theta1 - theta2)^2 / 2: its derivative with either angle.
    assert column(coupling, Row.MCP) == pytest.approx(q.mcp - q.pip)
    assert column(coupling, Row.PIP) == pytest.approx(q.pip - q.mcp)


@pytest.mark.parametrize("shape", CATALOGUE["joint_stop"].shapes)
def test_stop_is_nothing_within_and_pushes_back_beyond(shape: dict[str, float]) -> None:
    """The depth itself or, of two round faces, its power 1.5 (Hertz 1882); damped as it presses."""
    motion, edge, power = moving(), shape["edge_deg"], 1.5 if shape["hertz"] else 1.0
    q = motion.joints
    assert q is not None
    terms = CATALOGUE["joint_stop"].columns(motion, shape)
    reached = q.pip > np.radians(edge) if edge > 0 else q.pip < np.radians(edge)  # one end of the travel
    depth = np.where(reached, np.abs(q.pip - np.radians(edge)), 0.0)
    stop = column(terms, Row.PIP, "stop_pip")
    assert stop == pytest.approx(np.sign(edge) * depth**power, abs=1e-12)
    # An edge that lies a little further in adds its share wherever it is passed.
    shift = column(terms, Row.PIP, "shift_pip")
    clear = depth > 1e-3
    nearer = np.sign(edge) * ((depth + 1e-7) ** power - depth**power) / 1e-7 / power
    assert shift[clear] == pytest.approx(nearer[clear], rel=1e-3)
    assert not shift[~reached].any()
    damp = column(terms, Row.PIP, "damp_pip")
    assert damp == pytest.approx(depth**power * q.pip_velocity, abs=1e-12)


@pytest.mark.parametrize(("edge", "hertz"), [(-10.0, 0.0), (-10.0, 1.0), (20.0, 0.0), (20.0, 1.0)])
def test_a_shifted_edge_is_told_by_the_gain_of_the_shift(edge: float, hertz: float) -> None:
    """A stop K (depth)^p whose edge lies a thousandth of a degree elsewhere, less the one at its edge."""
    motion, stiffness, step = moving(), 2.0, 1e-3
    effect, shape = CATALOGUE["joint_stop"], {"edge_deg": edge, "hertz": hertz}
    assert effect.slopes is not None
    slopes = effect.slopes(shape, {"stop_mcp": 0.0, "stop_pip": stiffness})["edge_deg"]
    assert slopes["shift_mcp"] == 0.0
    side, power = np.sign(edge), 1.5 if hertz else 1.0

    def stop(at: float) -> np.ndarray:
        return side * stiffness * np.maximum(side * (motion.joints.pip - np.radians(at)), 0.0) ** power

    inside = side * (motion.joints.pip - np.radians(edge)) > 0.01
    shift = column(effect.columns(motion, shape), Row.PIP, "shift_pip") * slopes["shift_pip"] * step
    assert inside.any()
    assert shift[inside] == pytest.approx((stop(edge + step) - stop(edge))[inside], rel=2e-3)


def test_a_stop_is_looked_for_where_the_joints_went_furthest() -> None:
    """MCP between 0.2 - 0.25 and 0.2 + 0.25 rad, PIP between 0.15 - 0.35 and 0.15 + 0.35 rad."""
    effect = CATALOGUE["joint_stop"]
    assert effect.shapes_seen is not None
    edges = {shape["edge_deg"] for shape in effect.shapes_seen([moving()])}
    ends = np.degrees([-0.05, 0.45, -0.2, 0.5])  # lowest and highest of MCP, then of PIP
    for depth in (1.0, 2.5):
        for end in ends:
            assert round(end - np.sign(end) * depth, 1) in edges
    assert min(edges) > ends.min()
    assert max(edges) < ends.max()
    assert not effect.shapes_seen([moving(joints=None)])


@pytest.mark.parametrize("time_constant", [0.1, 0.3, 1.0, 3.0])
def test_creep_is_a_maxwell_branch(time_constant: float) -> None:
    """Spring and damper in series under a sine: gain w tau / sqrt(1 + (w tau)^2), lead atan(1 / w tau)."""
    motion = moving(seconds=40.0)
    assert motion.joints is not None
    branch = column(
        CATALOGUE["viscoelastic_creep"].columns(motion, {"time_constant": time_constant}), Row.PIP
    )
    omega = 2 * np.pi * 0.5
    turn = omega * motion.time + 1.1
    lead = np.arctan(1.0 / (omega * time_constant))
    expected = 0.35 * omega * time_constant / np.hypot(1.0, omega * time_constant) * np.sin(turn + lead)
    late = slice(-1000, None)
    assert branch[late] == pytest.approx(expected[late], abs=0.35 * 0.01)


class Symbols:
    """The finger as masses at places of a moving plane, derived anew from its energies."""

    def __init__(self) -> None:
        t = sp.Symbol("t")
        self.t = t
        self.q1, self.q2 = sp.Function("q1")(t), sp.Function("q2")(t)
        self.alpha, self.place, self.mass = sp.symbols("alpha place mass")
        self.pip = self.along(self.q1 - self.alpha, 2 * FINGER.proximal_half_length)

    @staticmethod
    def along(flexion, length):
        """A point ``length`` along a body; gravity pulls flexing joints on (the finger hangs over)."""
        return sp.Matrix([length * sp.cos(flexion), -length * sp.sin(flexion)])

    def torques(self, mass, point):
        """Left-hand sides that a point mass adds to the MCP and PIP equation (Lagrange)."""
        speed = point.diff(self.t)
        energy = mass * speed.dot(speed) / 2 - mass * FINGER.gravity * point[1]
        return [
            sp.diff(sp.diff(energy, q.diff(self.t)), self.t) - sp.diff(energy, q) for q in (self.q1, self.q2)
        ]

    def evaluate(self, expression, motion, **values):
        q = motion.joints
        order = [
            (self.q1.diff(self.t, 2), q.mcp_acceleration), (self.q2.diff(self.t, 2), q.pip_acceleration),
            (self.q1.diff(self.t), q.mcp_velocity), (self.q2.diff(self.t), q.pip_velocity),
            (self.q1, q.mcp), (self.q2, q.pip),
        ]  # fmt: skip
        names = sp.symbols("a1 a2 w1 w2 th1 th2")
        plain = expression.doit()
        for (symbol, _), name in zip(order, names, strict=True):
            plain = plain.subs(symbol, name)
        plain = plain.subs(
            {self.alpha: FINGER.wrist_angle, **{getattr(self, k): v for k, v in values.items()}}
        )
        return sp.lambdify(names, plain)(*(value for _, value in order)) * np.ones_like(motion.time)


@pytest.fixture(scope="module")
def symbols() -> Symbols:
    return Symbols()


@pytest.mark.parametrize("place", [s["place"] for s in CATALOGUE["added_mass"].shapes])
def test_point_mass_follows_from_lagrange(symbols: Symbols, place: float) -> None:
    motion = moving()
    distal = symbols.along(
        symbols.q1 + symbols.q2 - symbols.alpha, 2 * FINGER.distal_half_length * symbols.place
    )
    expected = symbols.torques(1, symbols.pip + distal)
    terms = CATALOGUE["added_mass"].columns(motion, {"place": place})
    for row, torque in zip((Row.MCP, Row.PIP), expected, strict=True):
        values = symbols.evaluate(torque, motion, place=place)
        assert column(terms, row) == pytest.approx(values, abs=1e-9 + 1e-9 * np.abs(values).max())


def test_tilt_is_the_change_of_gravity_with_the_wrist_angle(symbols: Symbols) -> None:
    motion = moving()
    half = symbols.along(symbols.q1 - symbols.alpha, FINGER.proximal_half_length)
    distal = symbols.along(symbols.q1 + symbols.q2 - symbols.alpha, FINGER.distal_half_length)
    energies = (
        -FINGER.proximal_mass * FINGER.gravity * half[1]
        - FINGER.distal_mass * FINGER.gravity * (symbols.pip + distal)[1]
    )
    terms = CATALOGUE["gravity_tilt"].columns(motion, {})
    for row, q in ((Row.MCP, symbols.q1), (Row.PIP, symbols.q2)):
        # Potential energy V adds dV/dq to the left-hand side; energies holds -V.
        expected = sp.diff(-energies, q, symbols.alpha)
        assert column(terms, row) == pytest.approx(symbols.evaluate(expected, motion), abs=1e-12)


def test_distal_rotation_is_the_energy_of_the_absolute_rate(symbols: Symbols) -> None:
    motion = moving()
    w1, w2 = symbols.q1.diff(symbols.t), symbols.q2.diff(symbols.t)
    energy = FINGER.distal_inertia * ((w1 + w2) ** 2 - w2**2) / 2
    terms = CATALOGUE["distal_rotation"].columns(motion, {})
    for row, speed in ((Row.MCP, w1), (Row.PIP, w2)):
        expected = sp.diff(sp.diff(energy, speed), symbols.t)
        assert column(terms, row) == pytest.approx(symbols.evaluate(expected, motion), abs=1e-15)


def test_contact_force_by_virtual_work(symbols: Symbols) -> None:
    """A force on the tip loads each joint by force times the tip's travel with that joint's angle."""
    motion = moving(force=1.0)
    assert motion.force is not None
    tip = symbols.pip + symbols.along(symbols.q1 + symbols.q2 - symbols.alpha, 2 * FINGER.distal_half_length)
    gain = CATALOGUE["load_cell_gain"].columns(motion, {})
    lateral = lateral_levers(motion, "lateral")
    for row, q in ((Row.MCP, symbols.q1), (Row.PIP, symbols.q2)):
        down = symbols.evaluate(-sp.diff(tip[1], q), motion)  # the tip moves down as the joint flexes
        assert column(gain, row) == pytest.approx(motion.force * down, abs=1e-12)
        across = symbols.evaluate(-sp.diff(tip[0], q), motion)
        assert column(lateral, row) == pytest.approx(across, abs=1e-12)


def test_no_force_no_contact_effect() -> None:
    for term in CATALOGUE["load_cell_gain"].columns(moving(), {}):
        assert not term.values.any()


def test_wave_is_its_own_derivative() -> None:
    """The closed form that all this stands on."""
    time = np.arange(1000) / 1000.0
    value, speed, acceleration = wave(time, 0.1, 0.2, 1.3, 0.4)
    assert np.gradient(value, time)[5:-5] == pytest.approx(speed[5:-5], abs=1e-4)
    assert np.gradient(speed, time)[5:-5] == pytest.approx(acceleration[5:-5], abs=1e-3)


def test_a_large_tilt_is_told_by_its_own_point_of_the_grid() -> None:
    """At the tilt that a point of the grid stands for, the terms are the change of the torques themselves."""
    motion = moving(force=1.0)
    assert motion.force is not None
    assert motion.joints is not None
    tilted = replace(FINGER, wrist_angle=FINGER.wrist_angle + TILT_RAD)
    shape = {"cell_stays": 1.0, "turn_deg": 16.0}
    terms = CATALOGUE["gravity_tilt"].columns(motion, shape)
    q = motion.joints
    for row, torque, lever in (
        (Row.MCP, nominal.mcp_torque, nominal.contact_lever_mcp),
        (Row.PIP, nominal.pip_torque, nominal.contact_lever_pip),
    ):
        change = torque(tilted, q).gravity - torque(FINGER, q).gravity
        change = change + motion.force * (lever(tilted, q.mcp, q.pip) - lever(FINGER, q.mcp, q.pip))
        told = sum(
            t.values * (t.constant + (TILT_RAD if t.gain == "tilt" else 0.0))
            for t in terms
            if t.row == row and t.gain in ("tilt", "")
        )
        assert told == pytest.approx(change, abs=1e-12)


def test_every_tilt_belongs_to_a_point_of_the_grid() -> None:
    """The points' ranges meet, and reach as far as the plausible tilt does."""
    tilt = CATALOGUE["gravity_tilt"]
    for stays in (0.0, 1.0):
        points = [i for i, s in enumerate(tilt.shapes) if s["cell_stays"] == stays]
        ranges = sorted((g.low, g.high) for g in (tilt.gains_at(i)["tilt"] for i in points))
        assert [low for low, _ in ranges[1:]] == pytest.approx([high for _, high in ranges[:-1]])
        assert ranges[0][0] == pytest.approx(-ranges[-1][1])
        assert ranges[-1][1] == pytest.approx(np.radians(25.5), abs=0.1)

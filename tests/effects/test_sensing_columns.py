"""Angle errors: the torque and the cable that a sensor's error asks for in vain, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row

from .moving import FINGER, column, moving

FORCE_N = 1.7


def asked_torques() -> tuple[sp.Matrix, sp.Symbol, sp.Symbol]:
    """Springs, gravity and contact of thesis equations 3.16 to 3.18, MCP and PIP, N m, over both angles."""
    q1, q2, force = sp.symbols("q1 q2 F")
    f, w = FINGER, FINGER.wrist_angle
    l1, l2 = f.proximal_half_length, f.distal_half_length
    weight_pip = -f.distal_mass * f.gravity * l2 * sp.cos(q1 + q2 - w)
    weight_mcp = -f.gravity * l1 * (f.proximal_mass + 2 * f.distal_mass) * sp.cos(q1 - w) + weight_pip
    push_pip = 2 * l2 * force * sp.cos(q1 + q2 - w)
    push_mcp = 2 * l1 * force * sp.cos(w - q1) + push_pip
    mcp = f.mcp_stiffness * q1 + weight_mcp + push_mcp
    pip = f.pip_stiffness * q2 + weight_pip + push_pip
    return sp.Matrix([mcp, pip]), q1, q2


@pytest.mark.parametrize("force", [None, FORCE_N])
@pytest.mark.parametrize(("gain", "angle"), [("sine_mcp", 0), ("sine_pip", 1)])
def test_an_angle_error_is_a_torque_error_by_the_slope(force: float | None, gain: str, angle: int) -> None:
    motion = moving(force=force)
    assert motion.joints is not None
    q = (motion.joints.mcp, motion.joints.pip)
    torques, *symbols = asked_torques()
    push = np.zeros_like(q[0]) if motion.force is None else motion.force
    terms = CATALOGUE["angle_sensor_nonlinearity"].columns(motion, {"harmonic": 2.0})
    for joint, row in enumerate((Row.MCP, Row.PIP)):
        slope = sp.lambdify([*symbols, "F"], sp.diff(torques[joint], symbols[angle]))(*q, push)
        expected = -slope * np.sin(2.0 * q[angle])
        assert column(terms, row, gain) == pytest.approx(expected, rel=1e-5, abs=1e-8)


def test_a_large_error_over_the_falsified_angle_holds_the_double_harmonic() -> None:
    """e(q) of the true angle q, over the read angle r = q + e: to second order e(r) - e(r) e'(r)."""
    size, n = 0.04, 2.0
    true = np.linspace(0.0, np.pi, 4001)  # a whole period of the harmonic
    read = true + size * np.sin(n * true)
    error = np.interp(np.linspace(0.2, 2.9, 2000), read, read - true)
    over = np.linspace(0.2, 2.9, 2000)
    motion = moving()
    harmonics = CATALOGUE["angle_sensor_nonlinearity"].columns(motion, {"harmonic": n, "double": 1.0})
    assert {t.gain for t in harmonics} >= {"sine_mcp", "double_sine_mcp", "double_cosine_pip"}
    assert motion.joints is not None
    double = -column(harmonics, Row.CABLE, "double_sine_mcp")
    assert double == pytest.approx(np.sin(2 * n * motion.joints.mcp), abs=1e-9)
    alone = error - size * np.sin(n * over)
    both = alone + 0.5 * n * size**2 * np.sin(2 * n * over)
    assert np.abs(alone).max() > 10 * np.abs(both).max()

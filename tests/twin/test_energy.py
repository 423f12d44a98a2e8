"""With every loss off, mechanical energy changes by the motor's work and nothing else."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fingerlab.twin.bench import build_bench, draw_truth, place_bench
from fingerlab.twin.integrate import advance, cable_path, finger_mass, fingertip, pose
from fingerlab.twin.plant import BRISTLES, STATE
from fingerlab.twin.protocols import load_preset

SECONDS = 1.0
CURRENT = 0.6
"""A: winds the cable in against springs and load cell, with bounces."""


def lossless(cable: str) -> Any:
    preset = load_preset()
    bench = build_bench(preset, draw_truth(preset, np.random.default_rng(8)), cable)
    p = bench.plant
    for name in (
        "viscous_1",
        "viscous_2",
        "motor_viscous",
        "cable_damping",
        "contact_damping",
        "tip_friction",
    ):
        p[name] = 0.0
    p["coupling"], p["cubic_1"], p["motor_spring"] = 0.02, 0.3, 0.05
    p["arm_slope_1"] = 0.4
    p["cable_stiffness"] = 1500.0  # soft enough for energy to go in and out of the cable
    return bench


def energy(bench: Any, s: Any, half: float) -> float:
    """Mechanical energy less the motor's work, J; positions set back by half a step."""
    p = bench.plant
    q1, q2, theta = s["q1"] - half * s["w1"], s["q2"] - half * s["w2"], s["theta"] - half * s["omega"]
    at = pose(p, q1, q2)
    m11, m12, m22 = finger_mass(p, at)
    total = 0.5 * (m11 * s["w1"] ** 2 + 2 * m12 * s["w1"] * s["w2"] + m22 * s["w2"] ** 2)
    total += 0.5 * p["inertia"] * s["omega"] ** 2 + 0.5 * p["motor_spring"] * theta**2
    total += 0.5 * (p["stiffness_1"] * q1**2 + p["stiffness_2"] * q2**2 + p["coupling"] * (q1 - q2) ** 2)
    total += 0.25 * p["cubic_1"] * q1**4
    l1, l2, alpha = p["proximal_half_length"], p["distal_half_length"], p["tilt"]
    first, second = l1 * math.sin(alpha - q1), l2 * math.sin(alpha - q1 - q2)
    total += 9.81 * (p["proximal_mass"] * first + p["distal_mass"] * (2 * first + second))
    taken = p["cable_sign"] * (cable_path(p, q1, q2, at) - p["path_at_rest"])
    stretch = p["pulley_radius"] * theta - p["slack"] - taken
    total += 0.5 * p["cable_stiffness"] * max(stretch, 0.0) ** 2
    depth = p["cell_y"] - fingertip(p, at)[1]
    total += 0.5 * p["contact_stiffness"] * max(depth, 0.0) ** 2
    return float(total - p["torque_constant"] * CURRENT * theta)


def worst_error(cable: str, steps: int) -> tuple[float, float]:
    """Largest error of the balance and largest share of it that moved to and fro, J."""
    bench = lossless(cable)
    state = np.zeros(1, STATE)[0]
    state["q1"], state["q2"] = place_bench(bench, in_contact=cable == "flexion")
    state["elongation"] = -bench.plant["slack"]
    state["current"] = CURRENT
    memory, step = np.zeros(BRISTLES), 1e-3 / steps
    start = energy(bench, state, 0.5 * step)
    worst = moved = 0.0
    for _ in range(round(SECONDS * 1000)):
        advance(bench.plant, bench.friction, memory, state, CURRENT, steps, step)
        worst = max(worst, abs(energy(bench, state, 0.5 * step) - start))
        moved = max(moved, bench.plant["torque_constant"] * CURRENT * abs(float(state["theta"])))
    return worst, moved


@pytest.mark.parametrize(("cable", "share"), [("extension", 1e-6), ("flexion", 3e-3)])
def test_energy_is_conserved_and_better_so_with_shorter_steps(cable: str, share: float) -> None:
    """Smooth motion keeps it to a millionth; with bounces on a hard load cell, to three thousandths."""
    coarse, moved = worst_error(cable, 10)
    fine, _ = worst_error(cable, 20)
    finest, _ = worst_error(cable, 40)
    assert moved > 0.02  # J: there was something to conserve
    assert coarse < share * moved
    assert fine < 0.5 * coarse
    assert finest < 0.5 * fine

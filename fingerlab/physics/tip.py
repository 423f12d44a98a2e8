"""The fingertip on the load cell: what the joint angles say of its height while it presses.

A tip that presses stands where the load cell's face is. Its height from the measured angles can only change
because the face leans, because tip and load cell give way, or because the angles are wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.physics.friction_states import rubbing_forces, with_grid
from fingerlab.physics.motion import Motion, nothing
from fingerlab.sessions.model import Array

TOUCHING_FORCE_N = 0.2
"""Force from which the tip is held by the load cell, N; assumed: ten times its noise."""


def tip_depth(motion: Motion) -> Array:
    """How far the tip is below the MCP joint, against the direction of the force on it, m, shape (n,)."""
    f, q = motion.finger_and_joints
    return np.asarray(
        2.0 * f.proximal_half_length * np.sin(q.mcp - f.wrist_angle)
        + 2.0 * f.distal_half_length * np.sin(q.mcp + q.pip - f.wrist_angle)
    )


def tip_reach(motion: Motion) -> Array:
    """How far the tip is in front of the MCP joint, along the load cell's face, m, shape (n,)."""
    return motion.remember("tip reach", lambda: _reach(motion))


def _reach(motion: Motion) -> Array:
    f, q = motion.finger_and_joints
    return np.asarray(
        2.0 * f.proximal_half_length * np.cos(f.wrist_angle - q.mcp)
        + 2.0 * f.distal_half_length * np.cos(q.mcp + q.pip - f.wrist_angle)
    )


def dragged_tip(motion: Motion, stiffness: float, grid: Sequence[float] = ()) -> Array:
    """Friction (N, for a coefficient of 1) of a tip that takes on ``stiffness`` (N/m) on its travel, (n,).

    ``grid`` are others that will be asked for.
    """
    held = np.zeros_like(motion.time) if motion.force is None else np.maximum(motion.force, 0.0)
    stiffnesses = with_grid(stiffness, grid)
    keys = [("dragged", one) for one in stiffnesses]
    return motion.remember_each(keys[0], keys, lambda: rubbing_forces(tip_reach(motion), held, stiffnesses))


def pressed(motion: Motion) -> Array:
    """1 where the tip presses on the load cell, 0 where it does not touch it, shape (n,)."""
    if motion.force is None:
        return np.zeros_like(motion.time)
    return np.asarray(np.clip(motion.force / TOUCHING_FORCE_N, 0.0, 1.0))


def while_pressed(motion: Motion, values: Array) -> Array:
    """Values less their mean over the stretch while the tip presses; 0 where it does not, shape (n,).

    Where the load cell's face stands is not known, and may be another place in each run.
    """
    if motion.force is None:
        return nothing(len(values))
    share = motion.remember("pressed", lambda: pressed(motion))
    counted = motion.remember("pressed, counted", lambda: share[motion.lead :] ** 2)
    mean = float(counted @ values[motion.lead :]) / max(float(counted.sum()), 1e-12)
    return np.asarray(share * (values - mean))

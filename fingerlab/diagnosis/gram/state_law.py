"""How well any law of a motor's measured state could tell its torque: the floor where no motion comes again.

A regression on functions of angle, speed, acceleration, load and way since reversal, with runs left out.
Among those of the angle are waves of the orders at which the torque repeats over it most. It knows no physics
and no plausible range; what it cannot tell either, no effect is asked to explain. It takes as many functions
as the runs that were left out bear out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.gram.decimation import Decimated, counted
from fingerlab.diagnosis.settings import (
    STATE_BLOCK,
    STATE_LEAST_GAIN,
    STATE_RIDGE,
    STATE_SPEEDS,
    STATE_TRAVELS_DEG,
)
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.physics.friction_states import slip_states
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array

BASIS = 4
"""So many functions every law has: a constant, acceleration, load and speed."""


def _functions(motion: Motion, orders: Sequence[float]) -> Array:
    """Functions of the state at the wide rate, simple ones first, and the torque last, (functions + 1, n)."""
    waves = [part(order * motion.position) for order in orders for part in (np.sin, np.cos)]
    angle, speed = motion.position, motion.velocity
    load = np.zeros_like(speed) if motion.load is None else motion.load
    ways = slip_states(motion.position, np.radians(STATE_TRAVELS_DEG))
    by_speed = [np.tanh(speed / s) for s in STATE_SPEEDS]
    middle = ways[len(ways) // 2]
    return np.stack(
        [
            np.ones_like(speed), motion.acceleration, load, speed,
            *by_speed, *ways,
            angle, np.cos(angle), np.sin(angle), angle * middle, speed * np.abs(speed),
            np.sign(speed) * np.sqrt(np.abs(speed)), *(np.abs(load) * way for way in ways),
            load * speed, load * angle, speed * middle, *waves, motion.torque,
        ]
    )  # fmt: skip


def state_products(low: Decimated, orders: Sequence[float]) -> list[Array]:
    """Products of the functions over blocks of a stretch, (functions + 1,) * 2 each.

    ``orders``: periods a turn at which the torque may repeat with the angle.
    """
    signals = decimate(_functions(low.wide, orders)[:, counted(low.wide)])
    pieces = max(round(signals.shape[1] / STATE_BLOCK), 1)
    return [block @ block.T for block in np.array_split(signals, pieces, axis=1)]


def left_out_variance(runs: Sequence[Sequence[Array]]) -> float:
    """Mean square of the torque that no law of the state tells where it has not seen it, (N m)^2; 0: unknown.

    Function after function is taken, while what was left out is told better by it.

    Args:
        runs: products over blocks of each; a single run is left out block by block.
    """
    parts = [sum(blocks[1:], blocks[0]) for blocks in runs if blocks]
    if len(parts) == 1:
        parts = list(runs[0])
    if len(parts) < 2:
        return 0.0
    each = np.stack(parts)
    others = each.sum(axis=0) - each
    # A function is taken only if it is there in what every part is judged by.
    there = np.flatnonzero((np.diagonal(others, axis1=1, axis2=2) > 0.0).all(axis=0))[:-1]
    taken = [int(k) for k in there if k < BASIS]
    found = _left_out(each, others, taken)
    rest = [int(k) for k in there if k >= BASIS]
    while rest:
        tried = [_left_out(each, others, [*taken, k]) for k in rest]
        best = int(np.argmin(tried))
        if tried[best] > (1.0 - STATE_LEAST_GAIN) * found:
            break
        found = tried[best]
        taken.append(rest.pop(best))
    return found


def _left_out(parts: Array, others: Array, taken: Sequence[int]) -> float:
    """Mean square of the torque that these functions leave of the parts, each told by the others."""
    here = np.append(taken, parts.shape[1] - 1)
    seen, left = others[:, here[:, None], here], parts[:, here[:, None], here]
    scale = 1.0 / np.sqrt(np.diagonal(seen, axis1=1, axis2=2))
    seen = seen * scale[:, :, None] * scale[:, None, :]
    matrix = seen[:, :-1, :-1] + STATE_RIDGE * np.eye(len(taken))
    values = np.linalg.solve(matrix, seen[:, :-1, -1:])[..., 0] * scale[:, :-1] / scale[:, -1:]
    law = np.concatenate((-values, np.ones((len(parts), 1))), axis=1)
    squares = np.einsum("pi,pij,pj->p", law, left, law)
    return float(np.maximum(squares, 0.0).sum() / max(parts[:, 0, 0].sum(), 1.0))

"""What no law of the motor's state tells of a signal: the floor of any law, where no motion comes again.

It is a regression on functions of angle, speed, acceleration, load and way since reversal, with runs left
out. Among those of the angle are waves of the orders at which the torque of a motor alone repeats over it
most. It knows no physics and no plausible range; what it cannot tell either, no effect is asked to explain.
It takes as many functions as the runs that were left out bear out.
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
    """Functions of the state at the wide rate, simple ones first, (functions, n).

    The load of a finger is the force at its tip.
    """
    waves = [part(order * motion.position) for order in orders for part in (np.sin, np.cos)]
    angle, speed = motion.position, motion.velocity
    load = motion.force if motion.load is None else motion.load
    load = np.zeros_like(speed) if load is None else load
    ways = slip_states(motion.position, np.radians(STATE_TRAVELS_DEG))
    by_speed = [np.tanh(speed / s) for s in STATE_SPEEDS]
    middle = ways[len(ways) // 2]
    return np.stack(
        [
            np.ones_like(speed), motion.acceleration, load, speed,
            *by_speed, *ways,
            angle, np.cos(angle), np.sin(angle), angle * middle, speed * np.abs(speed),
            np.sign(speed) * np.sqrt(np.abs(speed)), *(np.abs(load) * way for way in ways),
            load * speed, load * angle, speed * middle, *waves,
        ]
    )  # fmt: skip


def torque_products(low: Decimated, orders: Sequence[float]) -> list[Array]:
    """Of a motor alone: the functions, and the torque last.

    Args:
        orders: periods a turn at which the torque may repeat with the angle.

    Returns:
        Products over blocks of the stretch, (functions + 1,) * 2 each.
    """
    wide = np.concatenate((_functions(low.wide, orders), low.wide.torque[None]))
    return _by_blocks(decimate(wide[:, counted(low.wide)]))


def signal_products(low: Decimated) -> list[Array]:
    """Of a finger: the same with all its signals behind the functions, (functions + signals,) * 2 each."""
    functions = decimate(_functions(low.wide, ())[:, counted(low.wide)])
    return _by_blocks(np.concatenate((functions, low.columns.T)))


def _by_blocks(signals: Array) -> list[Array]:
    pieces = max(round(signals.shape[1] / STATE_BLOCK), 1)
    return [block @ block.T for block in np.array_split(signals, pieces, axis=1)]


def left_out_covariance(runs: Sequence[Sequence[Array]], signal_count: int = 1) -> Array | None:
    """Mean products of what no law of the state tells of signals where it has not seen them.

    Function after function is taken, while what was left out is told better by it; None: it is not known.

    Args:
        runs: products over blocks of each, the signals last; a single run is left out block by block.
        signal_count: number of the signals, on either side of the products.
    """
    parts = [sum(blocks[1:], blocks[0]) for blocks in runs if blocks]
    if len(parts) == 1:
        parts = list(runs[0])
    if len(parts) < 2:
        return None
    each = np.stack(parts)
    others = each.sum(axis=0) - each
    # A function is taken only if it is there in what every part is judged by.
    there = np.flatnonzero((np.diagonal(others, axis1=1, axis2=2) > 0.0).all(axis=0))
    there = there[there < each.shape[1] - signal_count]
    taken = [int(k) for k in there if k < BASIS]
    found = _left_out(each, others, taken, signal_count)
    rest = [int(k) for k in there if k >= BASIS]
    while rest:
        tried = [_left_out(each, others, [*taken, k], signal_count) for k in rest]
        sizes = [_log_size(one, found) for one in tried]
        best = int(np.argmin(sizes))
        if sizes[best] > np.log1p(-STATE_LEAST_GAIN):
            break
        found = tried[best]
        taken.append(rest.pop(best))
    return found


def _log_size(covariance: Array, against: Array) -> float:
    """Logarithm of the volume that a covariance spans, in that of another one."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(against), 1e-300))
    units = np.outer(scale, scale)
    ridge = STATE_RIDGE * np.eye(len(scale))
    one, other = (np.linalg.slogdet(c * units + ridge)[1] for c in (covariance, against))
    return float(one - other)


def _left_out(parts: Array, others: Array, taken: Sequence[int], signal_count: int) -> Array:
    """Mean products of what these functions leave of the signals in the parts, each told by the others."""
    size = parts.shape[1]
    here, count = np.array([*taken, *range(size - signal_count, size)]), len(taken)
    seen, left = others[:, here[:, None], here], parts[:, here[:, None], here]
    scale = 1.0 / np.sqrt(np.diagonal(seen, axis1=1, axis2=2))
    seen = seen * scale[:, :, None] * scale[:, None, :]
    matrix = seen[:, :count, :count] + STATE_RIDGE * np.eye(count)
    values = np.linalg.solve(matrix, seen[:, :count, count:])
    values = values * scale[:, :count, None] / scale[:, None, count:]
    own = np.broadcast_to(np.eye(signal_count), (len(parts), signal_count, signal_count))
    law = np.concatenate((-values, own), axis=1)
    squares = np.einsum("pia,pij,pjb->ab", law, left, law)
    return np.asarray(squares / max(float(parts[:, 0, 0].sum()), 1.0))

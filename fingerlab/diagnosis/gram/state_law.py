"""What no law of the motor's state tells of a signal: the floor of any law, where no motion comes again.

It is a regression on functions of angle, speed, acceleration, load and way since reversal, with runs left
out. Among those of the angle are waves of the orders at which the torque of a motor alone repeats over it
most. It knows no physics and no plausible range; what it cannot tell either, no effect is asked to explain.
It takes as many functions as the runs that were left out bear out.

What a law of the state leaves need not be noise: a transmission that winds up, play, an end stop or a delay
remember the past, and an inertia that is another in every run has no law in common. A law with memory, and
one of each run's own, tell how much of it is none (:func:`variance_of_noise`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from fingerlab.diagnosis.gram.decimation import Decimated, counted
from fingerlab.diagnosis.settings import (
    LEAST_OWN_SHARE,
    MUCH_THE_SAME,
    SPLITS,
    STATE_BLOCK,
    STATE_DAMPING,
    STATE_LEAST_GAIN,
    STATE_MEMORIES_S,
    STATE_RESONANCES_HZ,
    STATE_RIDGE,
    STATE_SPEEDS,
    STATE_TRAVELS_DEG,
)
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.physics.friction_states import first_order_lags, slip_states
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array

BASIS = 4
"""So many functions every law has: a constant, acceleration, load and speed."""
PAST = 2 * len(STATE_MEMORIES_S) + len(STATE_RESONANCES_HZ) + 6
"""Number of the functions with memory, which come last."""
JERK = BASIS
"""Number of the function that a torque adds which is logged late: what an inertia takes, a little later."""


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
    jerk = np.gradient(motion.acceleration) * motion.sample_rate_hz
    return np.stack(
        [
            np.ones_like(speed), motion.acceleration, load, speed, jerk,
            *by_speed, *ways,
            angle, np.cos(angle), np.sin(angle), angle * middle, speed * np.abs(speed),
            np.sign(speed) * np.sqrt(np.abs(speed)), *(np.abs(load) * way for way in ways),
            load * speed, load * angle, speed * middle, *waves,
        ]
    )  # fmt: skip


def torque_products(
    low: Decimated, orders: Sequence[float], with_memory: bool = False, in_parts: bool = False
) -> list[Array]:
    """Of a motor alone: the functions, and the torque last.

    Args:
        orders: periods a turn at which the torque may repeat with the angle.
        with_memory: whether there are functions of the motion's past among them.
        in_parts: whether the blocks are the parts in which few runs are left out.

    Returns:
        Products over blocks of the stretch, (functions + 1,) * 2 each.
    """
    motion = low.wide
    past = [_functions_of_past(motion)] if with_memory else []
    wide = np.concatenate((_functions(motion, orders), *past, motion.torque[None]))
    signals = decimate(wide[:, counted(motion)])
    return _by_blocks(signals, 2 * SPLITS if in_parts else _block_count(signals))


def _functions_of_past(motion: Motion) -> Array:
    """Functions with memory: lags, a transmission that swings, friction by angle, (functions, n)."""
    rate, acceleration, angle = motion.sample_rate_hz, motion.acceleration, motion.position
    way = slip_states(angle, np.radians(STATE_TRAVELS_DEG))[len(STATE_TRAVELS_DEG) // 2]
    lagged = first_order_lags(acceleration, STATE_MEMORIES_S, rate)
    relaxed = angle - first_order_lags(angle, STATE_MEMORIES_S, rate)
    swung = [_swung(acceleration, 2.0 * np.pi * hz, rate) for hz in STATE_RESONANCES_HZ]
    by_angle = [part(k * angle) * way for k in (1.0, 2.0) for part in (np.sin, np.cos)]
    snap = np.gradient(np.gradient(acceleration)) * rate**2
    return np.stack([snap, *lagged, *relaxed, *swung, *by_angle, acceleration * way**2])


def _swung(values: Array, pace: float, rate: float) -> Array:
    """What a resonance at an angular frequency (rad/s) makes of values at a rate (Hz), (n,)."""
    from scipy.signal import lfilter  # slow to import, and seldom asked

    shrink = np.exp(-STATE_DAMPING * pace / rate)
    turn = np.cos(pace * np.sqrt(1.0 - STATE_DAMPING**2) / rate)
    poles = [1.0, -2.0 * shrink * turn, shrink**2]
    return np.asarray(lfilter([sum(poles)], poles, values))


def signal_products(low: Decimated) -> list[Array]:
    """Of a finger: the same with all its signals behind the functions, (functions + signals,) * 2 each."""
    functions = decimate(_functions(low.wide, ())[:, counted(low.wide)])
    signals = np.concatenate((functions, low.columns.T))
    return _by_blocks(signals, _block_count(signals))


def _by_blocks(signals: Array, count: int) -> list[Array]:
    return [block @ block.T for block in np.array_split(signals, count, axis=1)]


def _block_count(signals: Array) -> int:
    return max(round(signals.shape[1] / STATE_BLOCK), 1)


def left_out_covariance(
    runs: Sequence[Sequence[Array]], signal_count: int = 1, late: bool = False, in_parts: bool = False
) -> Array | None:
    """Mean products of what no law of the state tells of signals where it has not seen them.

    Function after function is taken, while what was left out is told better by it; None: it is not known.

    Args:
        runs: products over blocks of each, the signals last.
        signal_count: number of the signals, on either side of the products.
        late: whether the torque may be logged late, so that the jerk is among the functions.
        in_parts: whether the runs are few. Their halves are left out, and every other quarter; whichever
            tells more is taken, for the halves of a run may have little in common.
    """
    runs = [blocks for blocks in runs if blocks]
    if in_parts:
        halves = [[b for blocks in runs for b in _half(blocks, k)] for k in range(SPLITS)]
        others = [[b for blocks in runs for b in blocks[k::SPLITS]] for k in range(SPLITS)]
        found = [_of_parts(_summed(each), signal_count, late) for each in (halves, others)]
        return min((one for one in found if one is not None), key=lambda c: float(np.trace(c)), default=None)
    # Of a single run, every block for itself.
    return _of_parts(list(runs[0]) if len(runs) == 1 else _summed(runs), signal_count, late)


def _half(blocks: Sequence[Array], k: int) -> Sequence[Array]:
    return blocks[k * len(blocks) // SPLITS : (k + 1) * len(blocks) // SPLITS]


def _summed(parts: Sequence[Sequence[Array]]) -> list[Array]:
    return [sum(blocks[1:], blocks[0]) for blocks in parts if blocks]


def _of_parts(parts: Sequence[Array], signal_count: int, late: bool) -> Array | None:
    """The same of parts that are left out one by one."""
    if len(parts) < 2:
        return None
    each = np.stack(parts)
    others = each.sum(axis=0) - each
    # A function is taken only if it is there in what every part is judged by.
    there = np.flatnonzero((np.diagonal(others, axis1=1, axis2=2) > 0.0).all(axis=0))
    there = there[(there < each.shape[1] - signal_count) & ((there != JERK) | late)]
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


def without_run_means(runs: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """The same products of signals without each run's own means of them, but for the constant."""
    result = []
    for blocks in runs:
        whole = sum(blocks[1:], blocks[0])
        centred = np.eye(len(whole))
        centred[1:, 0] = -whole[1:, 0] / max(float(whole[0, 0]), 1.0)
        result.append([centred @ block @ centred.T for block in blocks])
    return result


def variance_of_noise(runs: Sequence[Sequence[Array]]) -> float:
    """Variance that a law with memory leaves of a motor's torque, or laws of each run's own if that is less.

    Args:
        runs: products over blocks of each, with the functions of the past.

    Returns:
        Of runs, or parts, that no law has seen, (N m)^2; infinite where that is not known.
    """
    shared = left_out_covariance(runs, late=True)
    return min(_left_by_own_laws(runs), np.inf if shared is None else float(shared[0, 0]))


def told_by(runs: Sequence[Sequence[Array]], variance: float) -> Literal["memory", "runs"]:
    """Which law leaves this variance: what a run's own tells as well without the past is no memory."""
    now = [*range(len(runs[0][0]) - 1 - PAST), -1]
    of_state = _left_by_own_laws([[block[np.ix_(now, now)] for block in blocks] for blocks in runs])
    return "runs" if of_state < MUCH_THE_SAME * variance else "memory"


def _left_by_own_laws(runs: Sequence[Sequence[Array]]) -> float:
    """Variance that laws of each run's own leave of what they have not seen, (N m)^2; infinite: not known."""
    found = [(left_out_covariance([blocks], late=True), _samples(blocks)) for blocks in runs]
    known = [(float(one[0, 0]), count) for one, count in found if one is not None]
    total = sum(count for _, count in known)
    if total < LEAST_OWN_SHARE * sum(map(_samples, runs)):
        return np.inf
    return sum(each * count for each, count in known) / total


def torque_variance(runs: Sequence[Sequence[Array]]) -> float:
    """Variance of the torque about its mean, (N m)^2, of products over blocks of each run."""
    products = np.sum([block for blocks in runs for block in blocks], axis=0)
    count = max(float(products[0, 0]), 1.0)
    return float(products[-1, -1]) / count - (float(products[0, -1]) / count) ** 2


def _samples(blocks: Sequence[Array]) -> float:
    return sum(float(block[0, 0]) for block in blocks)


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

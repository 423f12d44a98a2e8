"""Operators with memory, computed without a loop over all samples, for several constants at once.

All of them step by maps that compose: a clamp after a clamp is a clamp, an affine map after an affine
map is affine. The path is cut into blocks that are followed side by side, sample by sample, as maps; then the
state is handed on from block to block (Hillis and Steele, "Data parallel algorithms", 1986).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fingerlab.sessions.model import Array, BoolArray

BLOCK = 32
"""Samples of a block."""
FORGOTTEN = 1e-15
"""Below this share a state of friction is lost in the rounding of what came after it."""


def _blocked(rows: Array) -> Array:
    """Rows (m, n) as (samples of a block, m, blocks), contiguous; the last block repeats the last sample."""
    length = rows.shape[1]
    count = -(-length // BLOCK)
    padded = np.empty((len(rows), count * BLOCK))
    padded[:, :length], padded[:, length:] = rows, rows[:, -1:]
    return np.ascontiguousarray(padded.reshape(len(rows), count, BLOCK).transpose(2, 0, 1))


def _joined(blocks: Array, length: int) -> Array:
    """The inverse: (m, length)."""
    return np.ascontiguousarray(blocks.transpose(1, 2, 0)).reshape(blocks.shape[1], -1)[:, :length]


def _clamp(values: Array, low: Array, high: Array) -> Array:
    result = np.maximum(values, low)
    return np.minimum(result, high, out=result)


def _column(values: Sequence[float] | Array) -> Array:
    return np.asarray(values, dtype=float)[:, None]


def with_grid(value: float, grid: Sequence[float]) -> tuple[float, ...]:
    """``value`` and, behind it, the rest of the grid that it belongs to: all are wanted sooner or later."""
    return (value, *(other for other in grid if other != value)) if value in grid else (value,)


def stop_operators(position: Array, travels: Sequence[float] | Array) -> Array:
    """Elastoplastic friction states in [-1, 1], (m, n), one a travel: what sticks until it has moved so far.

    A state follows the position with slope 1/travel (same unit as ``position``) and saturates at +-1:
    Prandtl's stop operator (Visintin, "Differential Models of Hysteresis", 1994, section III.1). It starts at
    zero.
    """
    return (position - _plays(position, travels)) / _column(travels)


def _plays(position: Array, travels: Sequence[float] | Array) -> Array:
    """Where the sticking ends of the springs stand, (m, n): Prandtl's play operator."""
    travel, path = _column(travels), _blocked(position[None])
    low, high = path - travel, path + travel
    for k in range(1, BLOCK):
        # map_k after map_{k-1}: clamp the earlier interval into the later one.
        new_low, new_high = np.maximum(low[k - 1], low[k]), np.maximum(high[k - 1], low[k])
        np.minimum(new_low, high[k], out=low[k])
        np.minimum(new_high, high[k], out=high[k])
    start = _handed_on(np.zeros_like(low[-1]), low[-1], high[-1], position[0])
    return _joined(_clamp(start, low, high), len(position))


def rubbing_forces(
    position: Array,
    limit: Array,
    stiffnesses: Sequence[float] | Array,
    backward: float = 1.0,
    lead: Array | None = None,
) -> Array:
    """Forces of springs that stick until they would exceed +-``limit``, (m, n), one a stiffness; from zero.

    The limit may change from sample to sample: a tip that sticks keeps its sideways force while it is pressed
    harder, and loses what its friction can no longer hold when it is let go.

    Args:
        position: m, shape (n,). limit: N, not negative, shape (n,). stiffnesses: N/m.
        backward: times the limit is the one below zero.
        lead: m, shape (n,): velocity times the damping of what sticks over its stiffness, s; None: undamped.
            With it what sticks holds as if it had moved further (sigma_1 of the LuGre model, Canudas de Wit
            et al. 1995), and no more than the limit.
    """
    shift = _blocked(_column(stiffnesses) * np.diff(position, prepend=position[:1]))
    high = np.repeat(_blocked(limit[None]), shift.shape[1], axis=1)
    low = -backward * high
    for k in range(1, BLOCK):
        # A shift and a clamp after a shift and a clamp are again one of each.
        new_low = np.maximum(low[k - 1] + shift[k], low[k])
        new_high = np.maximum(high[k - 1] + shift[k], low[k])
        np.minimum(new_low, high[k], out=low[k])
        np.minimum(new_high, high[k], out=high[k])
        shift[k] += shift[k - 1]
    start = _handed_on(shift[-1], low[-1], high[-1], 0.0)
    forces = _joined(_clamp(start + shift, low, high), len(position))
    if lead is None:
        return forces
    return _clamp(forces + _column(stiffnesses) * lead, -backward * limit, limit)


def _handed_on(shift: Array, low: Array, high: Array, first: float) -> Array:
    """The states with which the blocks begin, (m, blocks), from the maps of the whole blocks, (m, blocks)."""
    step, count = 1, shift.shape[1]
    while step < count:
        new_low = _clamp(low[:, :-step] + shift[:, step:], low[:, step:], high[:, step:])
        new_high = _clamp(high[:, :-step] + shift[:, step:], low[:, step:], high[:, step:])
        shift = np.concatenate((shift[:, :step], shift[:, step:] + shift[:, :-step]), axis=1)
        low = np.concatenate((low[:, :step], new_low), axis=1)
        high = np.concatenate((high[:, :step], new_high), axis=1)
        if np.array_equal(new_low, new_high):
            break  # what came earlier no longer matters anywhere
        step *= 2
    start = np.full((len(shift), count), first)
    start[:, 1:] = _clamp(first + shift, low, high)[:, :-1]
    return start


SLIP_RATIO, SLIP_LEAST = 2.0, 0.525
SLIP_SHARES = (0.171, 0.266, 0.359, 0.204)
"""Spring-sliders in parallel whose sum builds up as 1 - exp(-x) within 2 %: travels SLIP_LEAST times powers
of SLIP_RATIO, and their shares, the integrals of the density x exp(-x) around each."""

Stops = Callable[[Array, Array], Array]
"""Gives the states of sliders, (m, n), from a position, (n,), and their travels, (m,)."""


def slip_states(position: Array, travels: Sequence[float] | Array, stops: Stops | None = None) -> Array:
    """Friction states in [-1, 1], (m, n), that relax towards sliding by exp(-x / travel) on a reversal.

    Spring-sliders in parallel (Maxwell slip; Al-Bender, Lampaert and Swevers 2005). Large moves look like
    Dahl's law; unlike it, a small shake (a sensor's noise, an encoder's flicker) leaves the state alone.
    Sliders that several travels have in common are followed once; ``stops`` may give them otherwise than
    :func:`stop_operators`.
    """
    reach = 0.5 * SLIP_LEAST * np.outer(travels, SLIP_RATIO ** np.arange(len(SLIP_SHARES)))
    sliders, places = np.unique(reach, return_inverse=True)
    mixed = np.zeros((len(reach), len(sliders)))
    np.put_along_axis(mixed, places.reshape(reach.shape), np.asarray([SLIP_SHARES]), axis=1)
    if stops is not None:
        return np.asarray(mixed @ stops(position, sliders))
    mixed /= sliders  # of springs: the force is the way over the travel
    return np.asarray(mixed.sum(axis=1)[:, None] * position - mixed @ _plays(position, sliders))


def slip_state(position: Array, travel: float, stops: Stops | None = None) -> Array:
    """The state of :func:`slip_states` for one travel, (n,)."""
    return slip_states(position, [travel], stops)[0]


KNOTS = 2.0 ** (np.arange(-11, 1) / 4)
"""Ends of the straight pieces of a virgin curve that ends, of its length: one spring-slider each."""
STEEP_KNOTS = 2.0 ** (np.arange(-9, 1) / 2)
"""The same of a curve that begins steeply, and bends most where it begins."""


def friction_state(
    position: Array, travel: float, sharpness: float = 0.0, stops: Stops | None = None, start: float = 1.0
) -> Array:
    """Friction state in [-1, 1], shape (n,), of sliders whose virgin curve is 1 - (1 - (x / d)^a / p)^p.

    ``sharpness`` is 1/p, d half of ``travel``, so that all of them are as stiff at first. 1: one contact,
    that holds like a spring and then slides. 2/3: a pressed ball, whose rim slips before its middle (Mindlin
    1949). 1/2: parts that let go evenly one after the other (Iwan 1966). 0: exp(-x / d), as
    :func:`slip_state`. On a reversal the curve is gone through at twice the size (Masing 1926).

    ``start`` is a, of a curve that ends: below 1 it begins steeply, as that of contacts of which many let go
    at once; of contacts as strong as each other whose travels are spread evenly it is about 0.8.
    """
    if sharpness <= 0.0:
        return slip_state(position, travel, stops)
    shares, reaches = _sliders(0.5 * travel, sharpness, start)
    return np.asarray(shares @ (stops or stop_operators)(position, reaches))


def _sliders(travel: float, sharpness: float, start: float = 1.0) -> tuple[Array, Array]:
    """Share of the friction and travel of every slider of such a curve; ``sharpness`` above 0, up to 1."""
    power = 1.0 / sharpness
    if power <= 1.0 and start == 1.0:
        return np.ones(1), np.array([travel])
    places = KNOTS if start == 1.0 else STEEP_KNOTS
    knots = np.append(0.0, places)
    level = 1.0 - (1.0 - knots**start) ** power
    slopes = np.append(np.diff(level) / np.diff(knots), 0.0)
    return -np.diff(slopes) * places, power ** (1.0 / start) * travel * places


def dahl_states(position: Array, travels: Sequence[float] | Array) -> Array:
    """Dahl's friction states in [-1, 1], (m, n), one a travel, exact between samples; they start at zero.

    dz/dx = (1 - z sign(v)) / travel (Dahl 1968, exponent 1), so that over a step dx the state
    relaxes towards sign(dx) by exp(-|dx| / travel).
    """
    return _relaxed_along(position, np.ones(1), travels)


def lagging_state(position: Array, level: Array, travel: float) -> Array:
    """Friction, (n,), that follows a changing level (n,) over a travel: dz/dx = (level sign(v) - z) / travel.

    What the LuGre model (Canudas de Wit et al. 1995) makes of a friction that falls with the speed, to the
    first order in the fall: at a reversal the bristles have to be bent before any speed makes them let go.
    """
    return np.asarray(_relaxed_along(position, level, [travel])[0])


def _relaxed_along(position: Array, level: Array, travels: Sequence[float] | Array) -> Array:
    """States that relax towards ``level`` in the direction of travel, (m, n), one a travel, from zero."""
    change = np.diff(position, prepend=position[:1])
    kept = np.exp(-np.abs(change) / _column(travels))
    decay, drive = _blocked(kept), _blocked(level * np.sign(change) * (1.0 - kept))
    return _joined(_relaxed(decay, drive), len(position))


def first_order_lags(values: Array, time_constants: Sequence[float] | Array, sample_rate_hz: float) -> Array:
    """Values through 1/(1 + time_constant s), (m, n), one a time constant (s); at rest on the first value.

    Exact for values that change evenly between samples: held from sample to sample, they would be half a
    sample early or late.
    """
    samples = sample_rate_hz * _column(time_constants)
    keep = np.exp(-1.0 / samples)
    even = samples * (1.0 - keep)
    drive = (1.0 - even) * values
    drive[:, 1:] += (even - keep) * values[:-1]
    drive[:, 0] = values[0]
    blocks = _blocked(drive)
    return _joined(_relaxed(np.repeat(keep[None], BLOCK, axis=0), blocks), len(values))


def way_while(position: Array, holds: BoolArray) -> Array:
    """How far a position has moved since a condition began to hold, (n,); zero where it does not."""
    began = np.maximum.accumulate(np.where(holds, 0, np.arange(len(position))))
    return np.asarray(position - position[began])


def _relaxed(decay: Array, drive: Array) -> Array:
    """State that each sample multiplies by ``decay`` and adds ``drive`` to, from zero, in blocks.

    ``decay`` (samples of a block, m, blocks or 1), ``drive`` (samples of a block, m, blocks); both are used
    up.
    """
    for k in range(1, BLOCK):
        drive[k] += decay[k] * drive[k - 1]
        decay[k] *= decay[k - 1]
    whole, end = np.broadcast_to(decay[-1], drive[-1].shape), drive[-1]
    step, count = 1, end.shape[1]
    while step < count and whole.max() > FORGOTTEN:
        end = np.concatenate((end[:, :step], whole[:, step:] * end[:, :-step] + end[:, step:]), axis=1)
        whole = np.concatenate((whole[:, :step], whole[:, step:] * whole[:, :-step]), axis=1)
        step *= 2
    start = np.zeros_like(end)
    start[:, 1:] = end[:, :-1]
    drive += decay * start
    return drive

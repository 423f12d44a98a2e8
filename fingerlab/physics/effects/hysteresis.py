"""Operators with memory, computed without a sample-by-sample loop.

All of them step by maps that compose: a clamp after a clamp is a clamp, an affine map after an affine
map is affine. All prefixes of a chain of n such maps come out of log2(n) array passes (Hillis and Steele,
"Data parallel algorithms", 1986).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fingerlab.sessions.model import Array

FORGOTTEN = 1e-15
"""Below this share a state of friction is lost in the rounding of what came after it."""


def stop_operator(position: Array, travel: float) -> Array:
    """Elastoplastic friction state in [-1, 1], shape (n,): what sticks until it has moved ``travel``.

    The state follows the position with slope 1/``travel`` (same unit as ``position``) and saturates at
    +-1: Prandtl's stop operator (Visintin, "Differential Models of Hysteresis", 1994, section III.1).
    It starts at zero.
    """
    low, high = position - travel, position + travel
    step = 1
    while step < len(position):
        # map_k after map_{k-step}: clamp the earlier interval into the later one.
        new_low = np.minimum(np.maximum(low[:-step], low[step:]), high[step:])
        new_high = np.minimum(np.maximum(high[:-step], low[step:]), high[step:])
        low = np.concatenate((low[:step], new_low))
        high = np.concatenate((high[:step], new_high))
        if np.array_equal(new_low, new_high):
            break  # what came earlier no longer matters anywhere
        step *= 2
    play = np.clip(position[0], low, high)
    return np.asarray((position - play) / travel)


def rubbing_force(position: Array, limit: Array, stiffness: float) -> Array:
    """Force of a spring that sticks until it would exceed +-``limit``, shape (n,); it starts at zero.

    The limit may change from sample to sample: a tip that sticks keeps its sideways force while it is pressed
    harder, and loses what its friction can no longer hold when it is let go.

    Args:
        position: m, shape (n,). limit: N, not negative, shape (n,). stiffness: N/m.
    """
    shift, low, high = stiffness * np.diff(position, prepend=position[:1]), -limit, limit.copy()
    step = 1
    while step < len(position):
        # A shift and a clamp after a shift and a clamp are again one of each.
        new_low = np.clip(low[:-step] + shift[step:], low[step:], high[step:])
        new_high = np.clip(high[:-step] + shift[step:], low[step:], high[step:])
        shift = np.concatenate((shift[:step], shift[step:] + shift[:-step]))
        low = np.concatenate((low[:step], new_low))
        high = np.concatenate((high[:step], new_high))
        if np.array_equal(new_low, new_high):
            break  # what came earlier no longer matters anywhere
        step *= 2
    return np.asarray(np.clip(shift, low, high))


SLIP_RATIO, SLIP_LEAST = 2.0, 0.525
SLIP_SHARES = (0.171, 0.266, 0.359, 0.204)
"""Spring-sliders in parallel whose sum builds up as 1 - exp(-x) within 2 %: travels SLIP_LEAST times powers
of SLIP_RATIO, and their shares, the integrals of the density x exp(-x) around each."""


def slip_state(
    position: Array, travel: float, stop: Callable[[Array, float], Array] = stop_operator
) -> Array:
    """Friction state in [-1, 1], shape (n,), that relaxes towards sliding by exp(-x / travel) on a reversal.

    Spring-sliders in parallel (Maxwell slip; Al-Bender, Lampaert and Swevers 2005). Large moves look like
    Dahl's law; unlike it, a small shake (a sensor's noise, an encoder's flicker) leaves the state alone.

    Args:
        stop: gives the state of one slider; who asks for several travels can keep those that they share.
    """
    result = np.zeros_like(position)
    for k, share in enumerate(SLIP_SHARES):
        result += share * stop(position, 0.5 * SLIP_LEAST * travel * SLIP_RATIO**k)
    return result


KNOTS = 2.0 ** (np.arange(-11, 1) / 4)
"""Ends of the straight pieces of a virgin curve that ends, of its length: one spring-slider each. In this row
a curve longer by a quarter of an octave shares all sliders but one, so that who tries several keeps them."""


def friction_state(
    position: Array,
    travel: float,
    sharpness: float = 0.0,
    stop: Callable[[Array, float], Array] = stop_operator,
) -> Array:
    """Friction state in [-1, 1], shape (n,), of sliders whose virgin curve is 1 - (1 - x / (p d))^p.

    ``sharpness`` is 1/p, d half of ``travel``, so that all of them are as stiff at first. 1: one contact,
    that holds like a spring and then slides. 2/3: a pressed ball, whose rim slips before its middle (Mindlin
    1949). 1/2: parts that let go evenly one after the other (Iwan 1966). 0: exp(-x / d), as
    :func:`slip_state`. On a reversal the curve is gone through at twice the size (Masing 1926).
    """
    if sharpness <= 0.0:
        return slip_state(position, travel, stop)
    result = np.zeros_like(position)
    for share, reach in sliders(0.5 * travel, sharpness):
        result += share * stop(position, reach)
    return result


def sliders(travel: float, sharpness: float) -> list[tuple[float, float]]:
    """Share of the friction and travel of every slider of such a curve; ``sharpness`` above 0, up to 1."""
    power = 1.0 / sharpness
    if power <= 1.0:
        return [(1.0, travel)]
    knots = np.append(0.0, KNOTS)
    level = 1.0 - (1.0 - knots) ** power
    slopes = np.append(np.diff(level) / np.diff(knots), 0.0)
    shares = -np.diff(slopes) * KNOTS
    return [(float(s), float(power * travel * k)) for s, k in zip(shares, KNOTS, strict=True)]


def dahl_state(position: Array, travel: float) -> Array:
    """Dahl's friction state in [-1, 1], shape (n,), exact between samples; starts at zero.

    dz/dx = (1 - z sign(v)) / travel (Dahl 1968, exponent 1), so that over a step dx the state
    relaxes towards sign(dx) by exp(-|dx| / travel).
    """
    change = np.diff(position, prepend=position[:1])
    decay = np.exp(-np.abs(change) / travel)
    drive = np.sign(change) * (1.0 - decay)
    step = 1
    while step < len(position):
        new_drive = decay[step:] * drive[:-step] + drive[step:]
        new_decay = decay[step:] * decay[:-step]
        drive = np.concatenate((drive[:step], new_drive))
        decay = np.concatenate((decay[:step], new_decay))
        if new_decay.max() < FORGOTTEN:
            break
        step *= 2
    return drive


def first_order_lag(values: Array, time_constant: float, sample_rate_hz: float) -> Array:
    """Values through 1/(1 + time_constant s), shape (n,), at rest on the first value; time_constant in s."""
    keep = float(np.exp(-1.0 / (sample_rate_hz * time_constant)))
    drive = (1.0 - keep) * values
    drive[0] = values[0]
    step = 1
    while step < len(values) and keep**step > 1e-18:
        drive[step:] = drive[step:] + keep**step * drive[:-step]
        step *= 2
    return np.asarray(drive)

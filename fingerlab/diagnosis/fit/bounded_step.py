"""Steps: to the minimum of a quadratic within bounds, with its curvature inverted; towards a fixed point."""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.settings import PIVOTING_ROUNDS
from fingerlab.sessions.model import Array

LEAST_FACTOR = 0.1
"""Of a change so much is gone at least (assumed: chance may look like a change that goes to and fro, and
would hold it where it stands)."""


def bounded_step(values: Array, gradient: Array, information: Array, low: Array, high: Array) -> Array:
    """Minimiser of the quadratic model inside the bounds (active set with release, as in BVLS)."""
    scale = 1.0 / np.sqrt(information.diagonal())
    matrix = information * (scale[:, None] * scale)
    matrix.flat[:: len(values) + 1] += 1e-9
    slope = gradient * scale
    floor, ceiling = (low - values) / scale, (high - values) / scale
    quick = _pivoted(matrix, slope, floor, ceiling)
    if quick is not None:
        return quick * scale
    step = np.zeros(len(values))
    # What stands at a bound and is pushed outwards starts fixed; it is let go below if that was wrong.
    fixed = ((floor > -1e-12) & (slope > 0)) | ((ceiling < 1e-12) & (slope < 0))
    most, known, reached = 6 * len(values), dict[bytes, int](), list[Array]()
    for done in range(most):
        # Where the curvature is that of no minimum it goes in circles: the rest of its turns are known.
        state = step.tobytes() + fixed.tobytes()
        if state in known:
            first = known[state]
            step = reached[first + (most - first) % (done - first)]
            break
        known[state] = done
        reached.append(step)
        free = np.flatnonzero(~fixed)
        target = step.copy()
        if len(free):
            rest = slope[free] + matrix[free][:, fixed] @ step[fixed]
            target[free] = np.linalg.solve(matrix[free][:, free], -rest)
        out = ~fixed & ((target < floor - 1e-12) | (target > ceiling + 1e-12))
        if out.any():
            # Go as far as the first bound on the way, and stay there.
            change = target - step
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                room = np.where(change > 0, (ceiling - step) / change, (floor - step) / change)
            room[~out] = np.inf
            first = int(np.argmin(room))
            step = step + max(0.0, float(room[first])) * change
            step[first] = ceiling[first] if change[first] > 0 else floor[first]
            fixed[first] = True
            continue
        step = target
        pull = slope + matrix @ step
        wrong = fixed & (((step <= floor) & (pull < -1e-6)) | ((step >= ceiling) & (pull > 1e-6)))
        if not wrong.any():
            break
        fixed[int(np.argmax(np.where(wrong, np.abs(pull), -1.0)))] = False
    return step * scale


def _pivoted(matrix: Array, slope: Array, floor: Array, ceiling: Array) -> Array | None:
    """The same minimiser by exchanging all wrong bounds at once; None where that does not settle.

    Block principal pivoting (Judice and Pires 1994): nearly always two or three solves. Where their number
    does not fall, only the last of the wrong bounds is exchanged, which cannot go in circles. What stands at
    a bound starts there: between two steps of a fit, or two models that are alike, that hardly changes.
    """
    at_floor = floor > -1e-12
    at_ceiling = (ceiling < 1e-12) & ~at_floor
    lowest, highest = floor - 1e-12, ceiling + 1e-12
    fewest, known = len(slope) + 1, set[tuple[bytes, bytes, int]]()
    for _ in range(PIVOTING_ROUNDS):
        state = at_floor.tobytes(), at_ceiling.tobytes(), fewest
        if state in known:  # in circles all the same: the curvature is that of no minimum
            return None
        known.add(state)
        free = ~(at_floor | at_ceiling)
        places = free.nonzero()[0]
        if len(places) == len(slope):
            step = np.linalg.solve(matrix, -slope)
        else:
            step = np.where(at_floor, floor, 0.0)
            step[at_ceiling] = ceiling[at_ceiling]
            if len(places):
                rest = slope + matrix @ step
                among = matrix.take(places[:, None] * len(slope) + places)
                step[places] = np.linalg.solve(among, -rest[places])
        pull = slope + matrix @ step
        now_floor = (at_floor & (pull > -1e-6)) | (free & (step < lowest))
        now_ceiling = (at_ceiling & (pull < 1e-6)) | (free & (step > highest))
        wrong = ((now_floor != at_floor) | (now_ceiling != at_ceiling)).nonzero()[0]
        if len(wrong) == 0:
            return np.asarray(step)
        if len(wrong) < fewest:
            fewest = len(wrong)
            at_floor, at_ceiling = now_floor, now_ceiling
        else:
            last = wrong[-1]
            at_floor[last], at_ceiling[last] = now_floor[last], now_ceiling[last]
    return None


def scaled_inverse(matrix: Array) -> Array:
    """Pseudo-inverse of a symmetric matrix, (p, p), whose rows have units of their own."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = np.linalg.pinv(matrix * np.outer(scale, scale), hermitian=True)
    return np.asarray(scaled * np.outer(scale, scale))


def aitken_factor(before: tuple[float, Array] | None, change: Array) -> float:
    """Share of a fixed-point iteration's next change that is gone: Aitken's relaxation for vectors.

    Where changes go to and fro, one that goes about half as far ends it; where they go on, it is gone whole.
    Source: Irons and Tuck (1969), "A version of the Aitken accelerator for computer iteration".

    Args:
        before: factor and change of the iteration before; None: there was none. change: (n,).
    """
    if before is None:
        return 1.0
    factor, last = before
    turned = change - last
    size = float(turned @ turned)
    if size <= 0.0:
        return 1.0
    return float(np.clip(-factor * float(last @ turned) / size, LEAST_FACTOR, 1.0))

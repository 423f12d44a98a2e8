"""How much of a group's products is noise, and how much of them may be.

What does not repeat from cycle to cycle was set apart in the reading; here it is told for one sample, and cut
back where it would exceed what the recordings hold.
"""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.groups import Group
from fingerlab.sessions.model import Array

MOST_NOISE = 0.995
"""Noise may make up at most this share of any combination of features."""
RIDGE = 1e-9
"""Share of its own size below which a combination of features is rounding."""


def noise_of_a_sample(group: Group) -> Array:
    """What noise adds to the products of signals at one sample, (signals, signals)."""
    return group.noise / max(group.noise_samples, 1.0)


def limit_noise(group: Group) -> None:
    """Cut the group's noise back to what its own recordings hold, in every combination of signals.

    The noise is read from the runs with a cycle; in a combination that those runs happen to excite more
    than the others it would exceed the whole, and a fit could run away along it.
    """
    if group.noise_samples <= 0:
        return
    whole = group.whole
    noise = _limited(noise_of_a_sample(group), whole.products / whole.samples)
    group.noise = noise * group.noise_samples
    if whole.loose is not None:
        # Few taut moments hold little of it; what is not in them says nothing of how noisy the others are.
        group.taut_noise = _limited(noise, whole.taut() / max(whole.taut_samples, 1))


def _limited(noise: Array, whole: Array) -> Array:
    """``noise`` cut back to a share of ``whole`` in every direction; both (n, n), of one sample."""
    size = np.diag(whole)
    live = np.flatnonzero(size > 0)
    scale = 1.0 / np.sqrt(size[live])
    among = np.ix_(live, live)
    units = np.outer(scale, scale)
    # In units of the whole (its Cholesky factor) the noise is a share between 0 and 1 in every direction.
    factor = _factor(whole[among] * units)
    half = np.linalg.solve(factor, noise[among] * units)
    shares, directions = np.linalg.eigh(np.linalg.solve(factor, half.T))
    # Put together from its parts: what is cut off may be so much that a difference would be rounding.
    reach = factor @ directions
    limited = np.zeros_like(noise)
    limited[among] = (reach * np.clip(shares, 0.0, MOST_NOISE)) @ reach.T / units
    return limited


def _factor(products: Array) -> Array:
    """Cholesky factor of products with ones on the diagonal, lifted to be definite, (n, n)."""
    ridge = RIDGE * np.eye(len(products))
    try:
        return np.asarray(np.linalg.cholesky(products + ridge))
    except np.linalg.LinAlgError:
        # Products of the taut moments are those of all less those of the slack ones: where nearly all is
        # slack, what is left of a signal may be rounding, which is no product of anything.
        sizes, directions = np.linalg.eigh(products)
        return np.asarray(np.linalg.cholesky((directions * np.maximum(sizes, 0.0)) @ directions.T + ridge))

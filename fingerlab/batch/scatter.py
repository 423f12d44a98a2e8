"""By how much sessions scatter: every scatter between them, with every share of their intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fingerlab.batch.settings import LEAST_SCATTER, SCATTER, SCATTERS, SHARED
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Errors:
    """What the errors of the sessions may be: every scatter with every share of the intervals.

    Attributes:
        variances: of each session, (g, n). scatters: between sessions, (g,). common: variance of what all
            sessions have in common, which moves their level, (g,). weights: logarithms of their
            probabilities beforehand, (g,).
    """

    variances: Array
    scatters: Array
    common: Array
    weights: Array


def possible_errors(values: Array, errors: Array, size: float) -> Errors:
    """The errors over which evidence is summed.

    Args:
        values, errors: of the sessions, (n,); 0 where an error is not known. size: a strength that would
            matter.
    """
    own = float(np.median(errors[errors > 0])) if np.any(errors > 0) else 0.0
    least = LEAST_SCATTER * (own or float(np.std(values)) or size)
    most = max(10.0 * SCATTER * size, 3.0 * float(np.ptp(values)), 10.0 * least)
    grid = np.geomspace(least, most, SCATTERS)
    edges = np.concatenate(([0.0], np.sqrt(grid[1:] * grid[:-1]), [np.inf]))
    below = 2.0 / math.pi * np.arctan(edges / (SCATTER * size))  # half-Cauchy
    weights = np.log(np.maximum(np.diff(below), 1e-300))
    shared = SHARED if own else {1.0: 1.0}
    variances = np.concatenate([(f * errors) ** 2 + grid[:, None] ** 2 for f in shared])
    return Errors(
        variances,
        np.tile(grid, len(shared)),
        np.repeat([(1.0 - f**2) * own**2 for f in shared], len(grid)),
        np.concatenate([weights + math.log(share) for share in shared.values()]),
    )

"""What of the misfit on a run is no failure of the model's law: what the run has of its own, and what the
other runs leave open.

A run that was left out is predicted with constants that the others tell only so well. Its score is that of
the predictive density: the misfit at the best values, less what values that the others allow as well would
explain, and the price of having to find them.
"""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.fitting import LeftOut
from fingerlab.diagnosis.weighing import Weighted
from fingerlab.sessions.model import Array


def explained(own: Array, h: Array, sums: Weighted) -> float:
    """What of a misfit the run's own share of the features explains, less what that costs: as a Gaussian.

    Args:
        own: what one standard deviation of each part adds to the features, (k, parts).
        h: the features' coefficients, (k,). sums: weighted products of the features over the run.
    """
    if not own.shape[1]:
        return 0.0
    pull = own.T @ sums.matrix @ h
    stiffness = own.T @ sums.curvature @ own + np.eye(own.shape[1])
    return float(pull @ np.linalg.solve(stiffness, pull))


def allowance(own: Array, h: Array, sums: Weighted, jacobian: Array, left: LeftOut) -> float:
    """The same for a run that was left out, with what the constants may be otherwise, in twice log density.

    Args:
        jacobian: derivatives of the coefficients, (k, p). left: what the other runs tell.
    """
    free = np.flatnonzero(left.free)
    size = len(free)
    basis = np.concatenate((jacobian[:, free], own), axis=1)
    stiffness = np.eye(basis.shape[1])
    stiffness[:size, :size] = left.information[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.diag(stiffness))  # the unknowns have units of their own
    basis = basis * scale
    stiffness = stiffness * np.outer(scale, scale)
    after = stiffness + basis.T @ sums.curvature @ basis
    pull = basis.T @ sums.matrix @ h
    found = float(np.linalg.slogdet(after[:size, :size])[1] - np.linalg.slogdet(stiffness[:size, :size])[1])
    return float(pull @ np.linalg.solve(after, pull)) - found

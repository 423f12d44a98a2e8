"""Moments at which the motor stands: what an equation can say there, and what it cannot.

Two things are open at rest that are not in motion. An encoder that does not move shows its own step instead
of noise that averages out. And friction that sticks may hold any torque up to that at which it slides; where
in between depends on the last few hundredths of a degree, which no sensor of the rig tells. Both are a
covariance that the equations get on top of their noise, at those moments alone.
"""

from __future__ import annotations

import numpy as np

from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array

HELD_SHARE = 1.0 / 3.0
"""Mean square of a friction anywhere between its extremes, as a share of its square when it slides."""


def encoder_spread(variance: float) -> Array:
    """Covariance (5, 5) of the equations from a standing encoder; ``variance`` in m^2 of cable."""
    spread = np.zeros((5, 5))
    spread[Row.CABLE, Row.CABLE] = variance
    return spread


def change_of_weight(weights: Array, spread: Array) -> Array:
    """By how much an additional covariance changes the inverse covariance ``weights``; all (5, 5)."""
    # inverse(inverse(W) + S) = W - W S (1 + W S)^-1 W, which needs no inverse of W
    return np.asarray(-weights @ spread @ np.linalg.solve(np.eye(len(weights)) + weights @ spread, weights))


def log_widening(weights: Array, spread: Array) -> float:
    """By how much an additional covariance raises the logarithm of the covariance's determinant."""
    return float(np.linalg.slogdet(np.eye(len(weights)) + weights @ spread)[1])

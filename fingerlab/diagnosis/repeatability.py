"""How far an equation can be trusted: weights from the bench's own repeatability, and their limits."""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.groups import Group
from fingerlab.diagnosis.model import Model
from fingerlab.diagnosis.residuals import noise_covariance, row_covariance
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array

TIP_FRICTION_SPREAD = 0.3
"""Share of its friction at the fingertip that a tip which slides holds back or adds at will, one standard
deviation; assumed. It is as good as noise to all else: only the tip's own law could tell it."""
LEAST_TENSION_SPREAD_N = 1e-3
LEAST_LENGTH_SPREAD_M = 5e-7
LEAST_TORQUE_SPREAD = 1e-6
"""No equation is trusted beyond these spreads (N, m, N m): about a tenth of the sensors' resolution."""
LEAST_DEPTH_SPREAD_M = 3e-5
"""Nor is where a tip stands that presses, m; assumed: it is rough, and rolls, and half an angle step moves it
by as much."""


def first_weights() -> Array:
    """Weights before anything is known of the noise: 20 mN, 2 um, 1 mN m, 30 um; only their order matters."""
    return np.diag([1 / 0.02**2, 1 / 0.02**2, 1 / 2e-6**2, 1 / 1e-3**2, 1 / LEAST_DEPTH_SPREAD_M**2])


def noise_weights(model: Model, values: Array, group: Group) -> Array:
    """Inverse covariance of what a model's equations leave between cycles, (5, 5).

    Args:
        values: of the model's unknowns, (p,).
    """
    covariance = noise_covariance(model, values, group)
    if group.in_contact:
        covariance = covariance + TIP_FRICTION_SPREAD**2 * _rubbing(model, values, group)
    return _inverse(covariance, group.on_bench)


def _rubbing(model: Model, values: Array, group: Group) -> Array:
    """Mean products of what the tip's friction does to the equations, (5, 5).

    A tip that sticks rubs, too, and is not known better than one that slides: a usual friction at least.
    """
    values = values.copy()
    if model.tip_law == "sticks":
        k = model.index["lateral_rub"]
        values[k] = max(values[k], model.unknowns[k].gain.typical)
    mine = [
        (model.layout.features[i].parameter or "").startswith(("lateral_rub", "lateral_slip"))
        for i in model.active
    ]
    products = group.whole.of(model.pick)
    return row_covariance(model, values, group, products, group.samples, np.array(mine))


def _inverse(covariance: Array, on_bench: bool) -> Array:
    """Inverse of the noise covariance over the equations that exist, zero elsewhere; shape (5, 5)."""
    result = np.zeros((5, 5))
    if on_bench:
        result[Row.BENCH, Row.BENCH] = 1.0 / max(covariance[Row.BENCH, Row.BENCH], LEAST_TORQUE_SPREAD**2)
        return result
    spreads = [LEAST_TENSION_SPREAD_N, LEAST_TENSION_SPREAD_N, LEAST_LENGTH_SPREAD_M, LEAST_DEPTH_SPREAD_M]
    rows = np.ix_([Row.MCP, Row.PIP, Row.CABLE, Row.TIP], [Row.MCP, Row.PIP, Row.CABLE, Row.TIP])
    block = covariance[rows] + np.diag(spreads) ** 2
    scale = np.sqrt(np.diag(block))
    result[rows] = np.linalg.inv(block / np.outer(scale, scale)) / np.outer(scale, scale)
    return result

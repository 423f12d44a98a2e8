"""A run that was left out is scored by its predictive density: against scipy's normal distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fingerlab.diagnosis.fit.data import Weighted
from fingerlab.diagnosis.fit.random_effects import LeftOut
from fingerlab.diagnosis.fit.random_effects import predictive_correction as allowance
from fingerlab.sessions.model import Array

FEATURES, UNKNOWNS = 6, 4
UNITS = np.array([1e-6, 1.0, 1e3, 1e-2])
"""Unknowns differ by orders of magnitude: kg m2, N/m, N."""
NOTHING_OF_ITS_OWN = np.zeros((FEATURES, 0))


def positive(rng: np.random.Generator, size: int) -> Array:
    root = rng.normal(size=(size, 2 * size))
    return np.asarray(root @ root.T)


def twice_the_log_density(h: Array, weights: Array, *spreads: Array) -> float:
    """Minus twice the log density of residuals ``h`` against that of no residual and known constants."""
    noise = np.linalg.inv(weights)
    wide = noise + sum(spreads, np.zeros_like(noise))
    zero = np.zeros(len(h))
    at_rest = multivariate_normal(zero, noise).logpdf(zero)
    return float(2.0 * (at_rest - multivariate_normal(zero, wide).logpdf(h)))


@pytest.mark.parametrize("seed", range(5))
def test_misfit_less_allowance_is_the_predictive_density(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights, jacobian = positive(rng, FEATURES), rng.normal(size=(FEATURES, UNKNOWNS)) / UNITS
    information = positive(rng, UNKNOWNS) / np.outer(UNITS, UNITS)
    h = rng.normal(size=FEATURES)
    left = LeftOut(np.zeros(UNKNOWNS), information, np.ones(UNKNOWNS, dtype=bool))
    score = h @ weights @ h - allowance(NOTHING_OF_ITS_OWN, h, Weighted(weights, weights), jacobian, left)
    spread = jacobian @ np.linalg.inv(information) @ jacobian.T
    assert score == pytest.approx(twice_the_log_density(h, weights, spread), rel=1e-6)


def test_what_a_bound_holds_is_allowed_nothing() -> None:
    rng = np.random.default_rng(7)
    weights, jacobian = positive(rng, FEATURES), rng.normal(size=(FEATURES, UNKNOWNS))
    information, h = positive(rng, UNKNOWNS), rng.normal(size=FEATURES)
    free = np.array([True, False, True, False])
    left = LeftOut(np.zeros(UNKNOWNS), information, free)
    score = h @ weights @ h - allowance(NOTHING_OF_ITS_OWN, h, Weighted(weights, weights), jacobian, left)
    spread = jacobian[:, free] @ np.linalg.inv(information[np.ix_(free, free)]) @ jacobian[:, free].T
    assert score == pytest.approx(twice_the_log_density(h, weights, spread), rel=1e-9)


def test_a_constant_that_the_others_do_not_tell_excuses_a_large_misfit_at_a_small_price() -> None:
    """By hand: residual 50, noise 1, constant known to 100: 50^2 / (1 + 100^2) + log(1 + 100^2) = 9.46."""
    one = np.ones((1, 1))
    left = LeftOut(np.zeros(1), one / 100.0**2, np.ones(1, dtype=bool))
    score = 2500.0 - allowance(np.zeros((1, 0)), np.array([50.0]), Weighted(one, one), one, left)
    assert score == pytest.approx(2500.0 / 10001.0 + np.log(10001.0), rel=1e-9)
    # Known to a thousandth of the noise, it excuses nothing.
    sure = LeftOut(np.zeros(1), one * 1e6, np.ones(1, dtype=bool))
    assert allowance(np.zeros((1, 0)), np.array([50.0]), Weighted(one, one), one, sure) == pytest.approx(
        2500.0 - 2500.0 / (1.0 + 1e-6) - np.log(1.0 + 1e-6), rel=1e-6
    )

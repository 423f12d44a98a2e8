"""A run that was left out is scored by its predictive density: against scipy's normal distribution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fingerlab.diagnosis.fit.random_effects import LeftOut
from fingerlab.diagnosis.fit.solver import predictive_misfit
from fingerlab.sessions.model import Array

UNKNOWNS = 4
UNITS = np.array([1e-6, 1.0, 1e3, 1e-2])
"""Unknowns differ by orders of magnitude: kg m2, N/m, N."""
EVERYWHERE = np.full(UNKNOWNS, np.inf)


def twice_the_log_density(residual: Array, noise: Array, spread: Array) -> float:
    """Minus twice the log density of residuals against that of no residual and known constants."""
    zero = np.zeros(len(residual))
    at_rest = multivariate_normal(zero, noise).logpdf(zero)
    return float(2.0 * (at_rest - multivariate_normal(zero, noise + spread).logpdf(residual)))


def of_run(jacobian: Array, residual: Array) -> tuple[float, Array, Array]:
    """Misfit, half its slope and its curvature of a run with unit noise, at the constants' zero."""
    return float(residual @ residual), jacobian.T @ residual, jacobian.T @ jacobian


def left_out(gradient: Array, information: Array) -> LeftOut:
    """What others tell whose cost has this slope and curvature at zero."""
    step = -np.linalg.solve(information, gradient)
    free = np.ones(len(gradient), dtype=bool)
    return LeftOut(step, information, free, gradient, -float(gradient @ step))


@pytest.mark.parametrize("seed", range(5))
def test_misfit_with_what_it_adds_is_the_predictive_density(seed: int) -> None:
    """Of a linear model: the others tell a normal distribution of the constants, the run adds its noise."""
    rng = np.random.default_rng(seed)
    others, mine = (rng.normal(size=(9, UNKNOWNS)) / UNITS for _ in range(2))
    seen, unseen = rng.normal(size=9), rng.normal(size=9)
    _, gradient, information = of_run(others, seen)
    misfit, pull, bend = of_run(mine, unseen)
    left = left_out(gradient, information)
    score = misfit + predictive_misfit(left, pull, bend, -EVERYWHERE, EVERYWHERE)
    spread = mine @ np.linalg.inv(information) @ mine.T
    foretold = unseen + mine @ left.values
    assert score == pytest.approx(twice_the_log_density(foretold, np.eye(9), spread), rel=1e-6)


def test_a_constant_at_its_bound_is_not_asked_what_else_it_might_be() -> None:
    rng = np.random.default_rng(7)
    mine, unseen = rng.normal(size=(9, UNKNOWNS)), rng.normal(size=9)
    information = np.eye(UNKNOWNS)
    free = np.array([True, False, True, False])
    low, high = np.where(free, -np.inf, 0.0), np.where(free, np.inf, 0.0)
    misfit, pull, bend = of_run(mine, unseen)
    left = replace(left_out(np.zeros(UNKNOWNS), information), free=free)
    score = misfit + predictive_misfit(left, pull, bend, low, high)
    spread = mine[:, free] @ mine[:, free].T
    assert score == pytest.approx(twice_the_log_density(unseen, np.eye(9), spread), rel=1e-6)


def test_a_constant_that_the_others_do_not_tell_excuses_a_large_misfit_at_a_small_price() -> None:
    """By hand: residual 50, noise 1, constant known to 100: 50^2 / (1 + 100^2) + log(1 + 100^2) = 9.46."""
    misfit, pull, bend = of_run(np.ones((1, 1)), np.array([50.0]))
    everywhere = np.array([np.inf])
    vague = left_out(np.zeros(1), np.array([[1.0 / 100.0**2]]))
    score = misfit + predictive_misfit(vague, pull, bend, -everywhere, everywhere)
    assert score == pytest.approx(2500.0 / 10001.0 + np.log(10001.0), rel=1e-6)
    # Known to a thousandth of the noise, it excuses nothing.
    sure = left_out(np.zeros(1), np.array([[1e6]]))
    score = misfit + predictive_misfit(sure, pull, bend, -everywhere, everywhere)
    assert score == pytest.approx(2500.0 / (1.0 + 1e-6) + np.log(1.0 + 1e-6), rel=1e-6)

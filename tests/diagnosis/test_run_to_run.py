"""What a run has of its own: by hand for one column, and only where runs are repeated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from fingerlab.diagnosis.equations.model import Choice, build
from fingerlab.diagnosis.fit.data import Weighted, random_effect_columns
from fingerlab.diagnosis.fit.random_effects import RandomEffects
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.score.scorer import Scorer, explained
from fingerlab.diagnosis.settings import RUN_VARIATION, SET_DOWN_N
from fingerlab.effects import CATALOGUE
from tests.reduced import reduce_sessions

from . import closed_form as made


def one_column(weight: float) -> Weighted:
    return Weighted(np.array([[weight]]), np.array([[weight]]))


@pytest.mark.parametrize("off", [0.01, 0.05, 1.0])
def test_the_share_that_a_run_has_of_its_own_minimises_misfit_and_cost(off: float) -> None:
    """min over x of w (off - s x)^2 + x^2, searched point by point within three standard deviations."""
    weight, spread = 1e4, 0.02
    x = np.linspace(-3.0, 3.0, 60001)
    least = float(np.min(weight * (off - spread * x) ** 2 + x**2))
    (found,) = explained(np.array([[spread]]), np.array([off]), one_column(weight)[None])
    assert weight * off**2 - found == pytest.approx(least, rel=1e-4)


@pytest.mark.parametrize("off", [(0.01, 0.0), (0.2, -0.05), (1.0, 1.5)])
def test_what_a_run_has_of_its_own_goes_no_further_than_runs_differ_by(off: tuple[float, float]) -> None:
    """What two parts leave, its slope and curvature: the least within their bounds by L-BFGS-B."""
    bend = np.array([[1e4, 4e3], [4e3, 5e3]])
    parts = 0.05 * np.diag(off)
    across = (bend @ parts)[None]
    own = RandomEffects(parts, np.array([0]), across, across, precision=2.0, bound=3.0)

    def left(told: np.ndarray) -> float:
        def misfit(x: np.ndarray) -> float:
            rest = told + parts @ x
            return float(rest @ bend @ rest + 2.0 * x @ x)

        found = minimize(misfit, np.zeros(2), method="L-BFGS-B", bounds=[(-3.0, 3.0)] * 2, tol=1e-15)
        return float(found.fun)

    told = np.array(off)
    assert told @ bend @ told - own.explained(told) == pytest.approx(left(told), rel=1e-5)
    slope, curvature = (
        2.0 * (bend - own.schur_complement.matrix[0]) @ told,
        bend - own.schur_complement.matrix[0],
    )
    beyond = own.beyond(told)
    assert (beyond is not None) == (max(off) > 0.1)
    if beyond is not None:
        slope, curvature = slope + 2.0 * beyond.slope[0], curvature + beyond.along(np.eye(2)).matrix[0]
    step = 1e-2 * told + 1e-4
    change = left(told + step) - left(told - step)
    assert change == pytest.approx(2.0 * slope @ step, rel=1e-3)
    bent = left(told + step) + left(told - step) - 2.0 * left(told)
    assert bent == pytest.approx(2.0 * step @ curvature @ step, rel=2e-2)


@pytest.mark.parametrize("parts", [1, 3, 6])
def test_many_runs_are_bounded_at_once_as_each_would_be_alone(parts: int) -> None:
    """Forty runs, their parts correlated so that a wrong bound pushes others: by BVLS, run by run."""
    draw = np.random.default_rng(parts)
    mixed = draw.normal(size=(40, parts, parts))
    bends = 30.0 * (mixed @ mixed.transpose(0, 2, 1)) + 0.1 * np.eye(parts)
    told, unit = draw.normal(size=parts), np.eye(parts)
    own = RandomEffects(unit, np.arange(40), bends, bends, precision=1.0, bound=0.5)

    def left(bend: np.ndarray) -> float:
        factor = np.linalg.cholesky(bend).T
        matrix, aim = np.vstack((factor, unit)), np.concatenate((-factor @ told, np.zeros(parts)))
        return 2.0 * float(lsq_linear(matrix, aim, (-0.5, 0.5), method="bvls", tol=1e-14).cost)

    found = float(np.einsum("i,nij,j->", told, bends, told)) - own.explained(told)
    assert own.beyond(told) is not None
    assert found == pytest.approx(sum(map(left, bends)), rel=1e-6)


@pytest.fixture(scope="module")
def reduced() -> Reduced:
    """Contact is recorded under two conditions: in two runs and in one."""
    return reduce_sessions([made.session(made.Bench(), 2)], [])


@pytest.mark.parametrize("law", ["slides", "sticks"])
def test_a_tip_has_a_share_of_its_own_where_it_sticks_and_runs_are_repeated(
    reduced: Reduced, law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = build(reduced.layout, reduced.groups, [], law)
    values = model.start()
    group = next(g for g in reduced.groups if g.in_contact)
    told = model.features(values, group)
    assert max(len(group.of_condition(c)) for c in group.conditions) < 3
    assert random_effect_columns(model, values, told, group).shape == (len(told), 0)
    monkeypatch.setattr(type(group), "of_condition", lambda *_: [0, 1, 2])
    own = random_effect_columns(model, values, told, group)
    if law == "slides":
        assert own.shape == (len(told), 0)
        return
    pushed = values.copy()
    pushed[model.index["lateral_constant"]] += SET_DOWN_N
    assert own[:, 0] == pytest.approx(model.features(pushed, group) - told)
    assert np.count_nonzero(own) == 2  # in the MCP's equation and in the PIP's


def test_friction_of_each_run_s_own_costs_a_fit_what_it_costs_the_best_of_its_sizes() -> None:
    """Without noise: the least over every run's friction of its misfit and of how unusual that is."""
    reduced = reduce_sessions([made.session(made.Bench(), 2)], [CATALOGUE["viscous_friction"]])
    for group in reduced.groups:
        group.noise, group.noise_samples = np.zeros_like(group.noise), 1.0
    scorer = Scorer(reduced)
    trial = scorer.fit([Choice(CATALOGUE["viscous_friction"])])
    places = [trial.model.index[f"viscous_friction.viscous_{joint}"] for joint in ("mcp", "pip")]
    values = trial.fit.values.copy()
    values[places] = 3e-5  # what the joints of this bench would hardly do, and not beyond what runs differ by
    usual, fitter = (Fitter(trial.model, scorer.data, trial.weights) for _ in range(2))
    fitter.set_friction_weights(values, trusted=True)

    def least(i: int, k: int) -> float:
        group = reduced.groups[i]

        def misfit(unusual: np.ndarray) -> float:
            own = values.copy()
            own[places] *= 1.0 + RUN_VARIATION * unusual
            told = trial.model.features(own, group)
            return float(told @ usual.part(i, (k,)).matrix @ told + unusual @ unusual)

        return float(minimize(misfit, np.zeros(2), tol=1e-10).fun)

    folds = [(i, k) for i, group in enumerate(reduced.groups) for k in range(len(group.folds))]
    alike = [trial.model.features(values, reduced.groups[i]) for i, _ in folds]
    together = sum(
        float(told @ usual.part(i, (k,)).matrix @ told) for told, (i, k) in zip(alike, folds, strict=True)
    )
    expected = together - sum(least(i, k) for i, k in folds)
    assert expected > 1.0
    assert usual.cost(values) - fitter.cost(values) == pytest.approx(expected, rel=1e-3)

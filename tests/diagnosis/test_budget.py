"""What an error is made of: parts that sum to it, and each of the size that the bench was given."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from fingerlab.diagnosis.answer.budget import error_budget
from fingerlab.diagnosis.answer.errors import equation_errors
from fingerlab.diagnosis.answer.results import Budget, EquationError, PathStep
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import FULL_ITERATIONS
from fingerlab.effects import effect
from tests.reduced import reduce_sessions

from . import closed_form as made

VISCOUS, COMPLIANCE = (2e-3, 1e-3), 3e-4
WHOLE = made.Missing(viscous=VISCOUS, compliance=COMPLIANCE)


def told(missing: made.Missing, names: Sequence[str]) -> tuple[dict[str, Budget], dict[str, EquationError]]:
    """The budget along the path of these effects, and the errors of the nominal model."""
    effects = [effect(name) for name in names]
    scorer = Scorer(reduce_sessions([made.session(made.Bench(missing=missing), 4, 2, 7.0)], effects))
    choices = [Choice(one) for one in effects]
    end = scorer.fit_reweighted(choices)
    path = [
        scorer.score_held_out(scorer.fit(choices[:k], end, FULL_ITERATIONS, end.weights), residuals=True)
        for k in range(len(choices) + 1)
    ]
    errors = equation_errors(scorer.reduced, path[0])
    steps = [
        PathStep(None, path[0].score),
        *(PathStep(n, m.score) for n, m in zip(names, path[1:], strict=True)),
    ]
    return error_budget(path[0], errors, steps, path, scorer), errors


@pytest.fixture(scope="module")
def both() -> tuple[dict[str, Budget], dict[str, EquationError]]:
    return told(WHOLE, ("viscous_friction", "cable_stretch"))


def test_parts_sum_to_the_squared_error(both: tuple[dict[str, Budget], dict[str, EquationError]]) -> None:
    budgets, errors = both
    assert set(budgets) == set(errors)
    for name, budget in budgets.items():
        assert budget.mean_square == pytest.approx(errors[name].rmse ** 2, rel=1e-12)
        assert sum(part.mean_square for part in budget.parts) == pytest.approx(budget.mean_square, rel=1e-12)
        assert all(part.mean_square >= 0.0 for part in budget.parts if part.kind != "effect")
        plain = budget.to_json()
        assert sum(part["share"] for part in plain["parts"]) == pytest.approx(1.0, rel=1e-12)


def test_in_any_order_the_effects_together_are_the_same(
    both: tuple[dict[str, Budget], dict[str, EquationError]],
) -> None:
    """Shapley's averages share out what the path's falls do; a fall in path order is one of the orders."""
    for budget in both[0].values():
        parts = [part for part in budget.parts if part.kind == "effect"]
        averages = [part.average for part in parts]
        assert sum(a for a in averages if a is not None) == pytest.approx(
            sum(part.mean_square for part in parts), rel=1e-9
        )
        for part in parts:
            assert part.low is not None
            assert part.high is not None
            assert part.low - 1e-15 <= part.mean_square <= part.high + 1e-15


def test_a_part_is_what_the_error_falls_by_on_a_bench_without_the_effect() -> None:
    """To 2 % of the squared error: the same bench, made without the friction."""
    budgets, errors = told(made.Missing(viscous=VISCOUS), ("viscous_friction",))
    left = told(made.Missing(), ())[1]
    for name in ("joint_torque", "motor_torque"):
        fall = errors[name].rmse ** 2 - left[name].rmse ** 2
        assert fall > 0.5 * budgets[name].mean_square
        assert budgets[name].parts[0].mean_square == pytest.approx(fall, abs=0.02 * budgets[name].mean_square)


def test_what_no_effect_tells_is_the_unknown() -> None:
    budget = told(made.Missing(strange=4e-3), ())[0]["joint_torque"]
    parts = {part.kind: part.mean_square for part in budget.parts}
    assert parts["unknown"] > 0.75 * budget.mean_square
    assert 0.0 < parts["floor"] < 0.1 * budget.mean_square

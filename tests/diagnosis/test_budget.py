"""What an error is made of: parts that sum to it, and each of the size that the bench was given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from fingerlab.diagnosis.answer.budget import error_budget, still_gone
from fingerlab.diagnosis.answer.error_parts import Budget, BudgetPart, EquationError
from fingerlab.diagnosis.answer.errors import equation_errors, equation_floors, with_floors
from fingerlab.diagnosis.answer.results import PathStep
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import FULL_ITERATIONS
from fingerlab.effects import effect
from fingerlab.report.budget_words import budget_lines, main_family, mending_sentence, worth_mending
from tests.reduced import reduce_sessions
from tests.ui import invented

from . import closed_form as made

VISCOUS, COMPLIANCE = (2e-3, 1e-3), 3e-4
WHOLE = made.Missing(viscous=VISCOUS, compliance=COMPLIANCE)


def told(
    missing: made.Missing, names: Sequence[str], noisier: float = 1.0
) -> tuple[dict[str, Budget], dict[str, EquationError]]:
    """The budget along the path of these effects, and the errors of the nominal model.

    The floors are the last model's, times ``noisier``.
    """
    effects = [effect(name) for name in names]
    scorer = Scorer(reduce_sessions([made.session(made.Bench(missing=missing), 4, 2, 7.0)], effects))
    choices = [Choice(one) for one in effects]
    end = scorer.fit_reweighted(choices)
    path = [
        scorer.score_held_out(scorer.fit(choices[:k], end, FULL_ITERATIONS, end.weights), residuals=True)
        for k in range(len(choices) + 1)
    ]
    floors = {name: noisier * floor for name, floor in equation_floors(scorer.reduced, path[-1]).items()}
    errors = with_floors(equation_errors(scorer.reduced, path[0]), floors)
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
        (floor,) = (part.mean_square for part in budget.parts if part.kind == "floor")
        left = budget.mean_square - sum(part.mean_square for part in budget.parts if part.kind == "effect")
        assert floor == pytest.approx(min(errors[name].floor ** 2, left), rel=1e-12)  # one floor in an answer
        assert all(0.0 <= part.mean_square <= budget.mean_square for part in budget.parts)
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
            assert part.low >= 0.0
            assert part.high <= budget.mean_square
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


@pytest.mark.parametrize(
    ("levels", "kept"),
    [
        ([100.0, 20.0, 60.0], [100.0, 60.0, 60.0]),  # what the second brings back the first never took
        ([100.0, 250.0, 30.0], [100.0, 100.0, 30.0]),
        ([100.0, 174.0], [100.0, 100.0]),
        ([100.0], [100.0]),
    ],
)
def test_what_comes_back_never_went(levels: list[float], kept: list[float]) -> None:
    assert still_gone(levels) == kept


def test_an_error_below_the_floor_is_all_floor() -> None:
    """An effect that makes an error larger has no part of it, and there is nothing to mend."""
    budget = told(made.Missing(), ("viscous_friction",), noisier=10.0)[0]["joint_torque"]
    shares = {part.kind: part.mean_square / budget.mean_square for part in budget.parts}
    assert shares.pop("floor") == pytest.approx(1.0, rel=1e-12)
    assert set(shares.values()) == {0.0}
    assert not worth_mending(budget)
    assert main_family({"endpoint_force": budget, "joint_torque": to_mend()}) == "joint_torque"
    said = mending_sentence(replace(invented.nominal_diagnosis("s.h5"), budget={"joint_torque": budget}))
    assert said.startswith("There is nothing to mend: the error of the joint torque, ")


def to_mend() -> Budget:
    return Budget("N m", 1e-6, (BudgetPart("unknown", 6e-7), BudgetPart("floor", 4e-7)))


def test_advice_points_at_something() -> None:
    """A run only where one is proposed; a ruler only for what it tells; nothing below a hundredth."""
    unknown, floor = budget_lines(to_mend())
    assert (unknown.tenths, unknown.how) == (600, "No effect of the catalogue tells it.")
    assert budget_lines(to_mend(), proposed=True)[0].how.endswith(
        "The proposed run shows whether one is missing."
    )
    parts = (
        BudgetPart("parameters", 3e-7, parameter="lateral_slip_2"),
        BudgetPart("parameters", 3e-7, parameter="distal_mass"),
        BudgetPart("calibration", 1e-9, parameter="force_gain"),
        BudgetPart("calibration", 1e-7, parameter="force_gain"),
    )
    said = [one.how for one in budget_lines(Budget("N m", 1e-6, parts))]
    assert said == [
        "Record more runs: what weighs most is friction of the tip that slides, soft contact.",
        "Record more runs, or measure by hand what weighs most: distal mass.",
        "",
        "Calibrate anew what weighs most: load cell's gain.",
    ]
    assert floor.how.startswith("No model goes below it")

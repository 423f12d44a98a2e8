"""What an error is made of and what would mend it, in words, and as a table that adds up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

from fingerlab.core.text import decimals_for, fixed, percent, screen_unit, with_minus
from fingerlab.diagnosis.answer.budget import Budget, BudgetPart
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.effects import find_effect
from fingerlab.report.diagnosis_words import FAMILY_TITLES, effect_title, in_sentence, judged_on
from fingerlab.report.parameter_words import parameter_title
from fingerlab.report.score_words import apportioned

TITLES = {
    "unknown": "Not in the catalogue",
    "parameters": "Constants of the bench",
    "calibration": "Sensors and their calibration",
    "between_runs": "Differs from run to run",
    "floor": "Floor",
}
"""Of the parts that are no effect."""

SHORT_TITLES = {
    **TITLES,
    "parameters": "Constants",
    "calibration": "Calibration",
    "between_runs": "Run to run",
}

PART_HELP = {
    "effect": "What the error falls by where this effect joins the model, in the order of the error path.",
    "unknown": "What the last model of the path still misses, above the floor.",
    "parameters": "What the last model misses on runs left out and not on runs that it has seen, for its own "
    "constants and the bench's.",
    "calibration": "The same, for gains and zeros of the sensors.",
    "between_runs": "Friction that wanders and a tip that is set down anew, a value for each run.",
    "floor": "What does not repeat from cycle to cycle.",
}

MENDS = {
    "unknown": "No effect of the catalogue tells it: record the proposed run, or write an effect yourself.",
    "parameters": "Record more runs, or measure by hand what weighs most: {}.",
    "calibration": "Calibrate anew what weighs most: {}.",
    "between_runs": "Warm the bench up and set the finger down alike before every run.",
    "floor": "No model goes below it; quieter sensors do, and means over many cycles.",
}

WORTH_NAMING = 0.01
"""Of a squared error; what brings less is not named among what is worth mending."""
MOST_NAMED = 4


@dataclass(frozen=True)
class BudgetRow:
    """One part over all families.

    Attributes:
        title: of the part. shares: of the squared error of every family, in per cent, as text; the column
            sums to 100.0. help: what the part is.
    """

    title: str
    shares: tuple[str, ...]
    help: str


@dataclass(frozen=True)
class BudgetTable:
    """``families``: titles of the columns. ``errors``: rms with unit, the last row."""

    families: tuple[str, ...]
    rows: tuple[BudgetRow, ...]
    errors: tuple[str, ...]


@dataclass(frozen=True)
class Mend:
    """What a part brings where it is mended.

    Attributes:
        part: title. share: of the squared error. before, after: error (rms) with unit. how: a sentence.
        orders: the share in other orders of the effects; empty: there is one order.
    """

    part: str
    share: str
    before: str
    after: str
    how: str
    orders: str


def part_title(part: BudgetPart, short: bool = False) -> str:
    """``Cable stretch``, ``Floor``."""
    if part.kind != "effect":
        return (SHORT_TITLES if short else TITLES)[part.kind]
    instead = f" for {in_sentence(effect_title(part.removed))}" if part.removed else ""
    return f"{effect_title(part.effect)}{instead}"


def mend_words(part: BudgetPart) -> str:
    """What to do about a part, a sentence; empty where nobody knows."""
    if part.kind == "effect":
        one = find_effect(part.effect)
        return "" if one is None else one.mend
    title = parameter_title(part.parameter, [part.parameter]) if part.parameter else "every constant"
    return MENDS[part.kind].format(in_sentence(title))


def main_family(budgets: Mapping[str, Budget]) -> str:
    """The family that is asked for first: the endpoint force, else the joints' torque, else any."""
    wanted = ("endpoint_force", "joint_torque", "motor_torque")
    return next((name for name in wanted if name in budgets), next(iter(budgets)))


def budget_table(budgets: Mapping[str, Budget]) -> BudgetTable | None:
    """Every part of every family; None where none is known."""
    if not budgets:
        return None
    columns = [tenths(one) for one in budgets.values()]
    parts = next(iter(budgets.values())).parts
    rows = tuple(
        BudgetRow(
            part_title(part), tuple(with_minus(fixed(0.1 * c[k], 1)) for c in columns), PART_HELP[part.kind]
        )
        for k, part in enumerate(parts)
    )
    titles = tuple(FAMILY_TITLES.get(name, name) for name in budgets)
    return BudgetTable(titles, rows, tuple(_error(one, sqrt(one.mean_square)) for one in budgets.values()))


def tenths(budget: Budget) -> list[int]:
    """Every part's share of the squared error in tenths of a per cent; they sum to 1000."""
    whole = max(budget.mean_square, 1e-300)
    return apportioned([1000.0 * part.mean_square / whole for part in budget.parts], 1.0)


def mends(budget: Budget) -> list[Mend]:
    """What is worth mending, first things first."""
    found = []
    for part in budget.worth_mending()[:MOST_NAMED]:
        share = part.mean_square / budget.mean_square
        if share >= WORTH_NAMING:
            found.append(
                Mend(
                    part_title(part),
                    percent(share, counted=True),
                    _error(budget, sqrt(budget.mean_square)),
                    _error(budget, budget.without(part)),
                    mend_words(part),
                    _orders(part, budget.mean_square),
                )
            )
    return found


def _orders(part: BudgetPart, whole: float) -> str:
    if part.low is None or part.high is None or part.average is None:
        return ""
    low, high, average = (with_minus(f"{100 * v / whole:.0f}") for v in (part.low, part.high, part.average))
    return f"{low} to {high} % by the order, {average} % on average"


def _error(budget: Budget, value: float) -> str:
    """An error with its unit; all of one budget have the same decimals."""
    whole = sqrt(budget.mean_square)
    unit = screen_unit(budget.unit, whole)
    return f"{fixed(unit.factor * value, decimals_for(0.03 * unit.factor * whole))} {unit.symbol}"


def mending_sentence(diagnosis: Diagnosis) -> str:
    """What to mend first, and what it brings; empty where the budget is not known."""
    if not diagnosis.budget:
        return ""
    family = main_family(diagnosis.budget)
    title = in_sentence(FAMILY_TITLES.get(family, family))
    found = mends(diagnosis.budget[family])
    if not found:
        return f"Of the error of the {title}, all but the floor is too small to be worth mending."
    first = found[0]
    return (
        f"Worth mending first: {in_sentence(first.part)}, {first.share} of the squared error of the {title} "
        f"on {judged_on(diagnosis)}. Without it the error would be {first.after} instead of {first.before}. "
        f"{first.how}".rstrip()
    )


def mend_rows(diagnosis: Diagnosis) -> Sequence[tuple[str, ...]]:
    """Part, share, error without it, and what to do: for a table, of the family that is asked for first."""
    found = mends(diagnosis.budget[main_family(diagnosis.budget)]) if diagnosis.budget else []
    shares = [f"{one.share} ({one.orders})" if one.orders else one.share for one in found]
    return [(one.part, share, one.after, one.how) for one, share in zip(found, shares, strict=True)]

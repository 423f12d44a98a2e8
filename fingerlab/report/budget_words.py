"""What an error is made of, where it is largest, what would mend it: in words, as a table that adds up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

from fingerlab.core.text import (
    ScreenUnit,
    decimals_for,
    fixed,
    largest_of,
    percent,
    score_text,
    screen_unit,
    with_minus,
)
from fingerlab.diagnosis.answer.error_parts import Budget, BudgetPart, Comparison
from fingerlab.diagnosis.answer.residual_profiles import COORDINATES, JOINTS, Profile
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.equations.parameters import ARMS
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.effects import find_effect
from fingerlab.report.diagnosis_words import FAMILY_TITLES, PHASE_WORDS, effect_title, in_sentence, judged_on
from fingerlab.report.parameter_words import parameter_title
from fingerlab.report.recording_words import run_proposed
from fingerlab.report.score_words import apportioned
from fingerlab.rig.file import FITTED_CONSTANTS

TITLES = {
    "unknown": "Left unexplained",
    "parameters": "Constants of the bench",
    "calibration": "Sensors and their calibration",
    "between_runs": "Differences from run to run",
    "floor": "Floor",
}
"""Of the parts that are no effect."""

PART_HELP = {
    "effect": "What the error falls by where this effect joins the model, in the order of the error path.",
    "unknown": "What the last model of the path still misses, above the floor.",
    "parameters": "What the last model misses on runs left out and not on runs that it has seen, for its own "
    "constants and the bench's.",
    "calibration": "The same, for gains and zeros of the sensors.",
    "between_runs": "What else has a value of its own in each run: friction that wanders, what is set down.",
    "floor": "How well the bench repeats itself: from cycle to cycle, and between runs told the same.",
}

MENDS = {
    "unknown": "No effect of the catalogue tells it.",
    "parameters": "Record more runs: what weighs most is {}.",
    "calibration": "Calibrate anew what weighs most: {}.",
    "between_runs": "Warm the bench up, and set down alike before every run what it moves.",
    "floor": "No model goes below it; quieter sensors do, and means over many cycles.",
}

PROPOSED = " The proposed run shows whether one is missing."
BY_HAND = frozenset({*FITTED_CONSTANTS, "rotor_inertia", *ARMS})
"""Constants that a scale, a ruler and a weight tell."""
MEASURED = "Record more runs, or measure by hand what weighs most: {}."

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
class BudgetLine:
    """One part of one family's squared error.

    Attributes:
        kind: as in ``results.BUDGET_KINDS``. title: in words.
        tenths: its share in tenths of a per cent; those of a budget sum to 1000.
        fall: mean square, of the family's unit.
        orders: the share in other orders of the effects, in per cent; empty: there is one order.
        after: error (rms) without this part, with unit. how: what mends it, a sentence. help: what it is.
    """

    kind: str
    title: str
    tenths: int
    fall: float
    orders: str
    after: str
    how: str
    help: str


def part_title(part: BudgetPart) -> str:
    """``Cable stretch``, ``Floor``."""
    if part.kind != "effect":
        return TITLES[part.kind]
    instead = f" for {in_sentence(effect_title(part.removed))}" if part.removed else ""
    return f"{part.title or effect_title(part.effect)}{instead}"


def mend_words(part: BudgetPart, proposed: bool = False) -> str:
    """What to do about a part, a sentence; empty where nobody knows.

    Args:
        proposed: the answer proposes a run.
    """
    if part.kind == "effect":
        one = find_effect(part.effect)
        return "" if one is None else one.mend
    if part.kind == "unknown":
        return MENDS[part.kind] + (PROPOSED if proposed else "")
    if part.kind in ("parameters", "calibration") and not part.parameter:
        return "Record more runs."
    title = parameter_title(part.parameter, [part.parameter]) if part.parameter else ""
    by_hand = part.parameter.partition("@")[0] in BY_HAND
    said = MEASURED if part.kind == "parameters" and by_hand else MENDS[part.kind]
    return said.format(in_sentence(title.replace(", off by", "")))


def main_family(budgets: Mapping[str, Budget]) -> str:
    """The family that is asked for first: the endpoint force, else the joints' torque, else any.

    One that holds nothing to mend is asked for only where no other does.
    """
    wanted = ("endpoint_force", "joint_torque", "motor_torque", "motor_force")
    order = [*(name for name in wanted if name in budgets), *(n for n in budgets if n not in wanted)]
    return next((name for name in order if worth_mending(budgets[name])), order[0])


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


def budget_lines(budget: Budget, proposed: bool = False) -> tuple[BudgetLine, ...]:
    """Every part, in the budget's order; with what mends it where that is worth it.

    Args:
        proposed: the answer proposes a run.
    """
    return tuple(
        BudgetLine(
            part.kind,
            part_title(part),
            count,
            part.mean_square,
            _orders(part, budget.mean_square),
            _error(budget, budget.without(part)),
            mend_words(part, proposed) if count >= 1000 * WORTH_NAMING else "",
            PART_HELP[part.kind],
        )
        for part, count in zip(budget.parts, tenths(budget), strict=True)
    )


def worth_mending(budget: Budget, proposed: bool = False) -> list[BudgetLine]:
    """What is worth mending, first things first: not the floor, and nothing that brings next to nothing."""
    least = max(WORTH_NAMING * budget.mean_square, 1e-300)
    lines = [one for one in budget_lines(budget, proposed) if one.kind != "floor" and one.fall >= least]
    return sorted(lines, key=lambda one: -one.fall)[:MOST_NAMED]


def _orders(part: BudgetPart, whole: float) -> str:
    if part.low is None or part.high is None or part.average is None:
        return ""
    low, high, average = (with_minus(f"{100 * v / whole:.0f}") for v in (part.low, part.high, part.average))
    return f"{low} to {high}, mean {average}"


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
    budget = diagnosis.budget[family]
    found = worth_mending(budget, run_proposed(diagnosis))
    if not found and tenths(budget)[-1] == 1000:
        whole = _error(budget, sqrt(budget.mean_square))
        return f"There is nothing to mend: the error of the {title}, {whole}, is no more than its floor."
    if not found:
        return f"Of the error of the {title}, all but the floor is too small to be worth mending."
    first = found[0]
    share = f"{in_sentence(first.title)}, {_share(first)} of the squared error of the {title} on "
    share += judged_on(diagnosis).rstrip(",")
    without = f"Without it the error would be {first.after}"
    # What the verdict takes for too small to be told is not called worth mending.
    if not (diagnosis.verdict == Verdict.NOTHING_MISSING and first.kind == "unknown"):
        whole = _error(budget, sqrt(budget.mean_square))
        return f"Worth mending first: {share}. {without} instead of {whole}. {first.how}".rstrip()
    return f"{_held_for_nothing(budget, title)} Largest part: {share}. {without}."


def _held_for_nothing(budget: Budget, title: str) -> str:
    """What remains beside the floor, where the verdict is that nothing is missing."""
    floor = sum(part.mean_square for part in budget.parts if part.kind == "floor")
    whole = _error(budget, sqrt(budget.mean_square))
    return (
        f"What remains is too small to be shown to be an effect: the error of the {title} is {whole}, its "
        f"floor {_error(budget, sqrt(max(floor, 0.0)))}."
    )


def _share(one: BudgetLine) -> str:
    return percent(one.tenths / 1000.0, counted=True)


def mend_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Part, share, error without it, and what to do: for a table, of the family that is asked for first."""
    if not diagnosis.budget:
        return []
    budget = diagnosis.budget[main_family(diagnosis.budget)]
    found = worth_mending(budget, run_proposed(diagnosis))
    shares = [f"{_share(one)} (in other orders {one.orders})" if one.orders else _share(one) for one in found]
    return [(one.title, share, one.after, one.how) for one, share in zip(found, shares, strict=True)]


CLEARLY = 1.2
"""From so many floors on a bin says that something is missed."""


def axis_title(found: Profile) -> str:
    """The coordinate with its joint: ``MCP joint speed``."""
    title = found.coordinate.title
    joint = JOINTS.get(found.equation, "pip").upper()
    return f"{joint} {title[:1].lower()}{title[1:]}" if "{}" in "".join(found.coordinate.sources) else title


def coordinates_of(comparisons: Sequence[Comparison], equation: str) -> tuple[str, ...]:
    """Ids of the coordinates over which a residual is drawn: a motor alone has no cable with a tension."""
    phases = {one.phase for one in comparisons if one.equation == equation}
    return tuple(name for name in COORDINATES if name != "tension" or phases != {"motor_bench"})


def coordinate_unit(found: Profile) -> ScreenUnit:
    """Unit of the coordinate on the screen."""
    return screen_unit(found.coordinate.unit, largest_of(map(float, found.edges)))


def residual_unit(found: Profile) -> ScreenUnit:
    """Unit of the residual on the screen."""
    return screen_unit(found.unit, largest_of([*map(float, found.rms), found.floor]))


def bin_words(found: Profile, bin_: int) -> str:
    """Which part of the coordinate a bin is: ``PIP joint speed −60 to −40 °/s``, ``run 011, in contact``."""
    if found.runs:
        session, run, phase = found.runs[bin_]
        several = len({one[0] for one in found.runs}) > 1
        return f"run {run}{f' of {session}' if several else ''}, {PHASE_WORDS.get(phase, phase)}"
    unit = coordinate_unit(found)
    width = (found.edges[1] - found.edges[0]) * unit.factor
    low, high = (
        fixed(float(edge) * unit.factor, decimals_for(0.1 * width)) for edge in found.edges[bin_ : bin_ + 2]
    )
    title = axis_title(found)
    lowered = title if title[:2].isupper() else f"{title[:1].lower()}{title[1:]}"
    return f"{lowered} {low} to {unit.after(high)}"


def miss_words(found: Profile, bin_: int) -> str:
    """By how much the model misses in a bin: ``2.5 mN m, 3.1 floors``."""
    rms = float(found.rms[bin_])
    if rms != rms:
        return "too few samples to say"
    unit = residual_unit(found)
    step = max(0.3 * found.floor, 0.005 * rms)  # half a per cent is told of what is far beyond the floor
    amount = unit.after(fixed(rms * unit.factor, decimals_for(step * unit.factor)))
    return f"{amount}, {score_text(rms / found.floor)} floors" if found.floor > 0 else amount


def worst_words(found: Profile) -> str:
    """The worst bin in a sentence, or that none stands out."""
    if found.rms[found.worst] <= CLEARLY * found.floor:
        return "Nowhere clearly beyond the floor."
    return f"Worst at {bin_words(found, found.worst)}: {miss_words(found, found.worst)}."

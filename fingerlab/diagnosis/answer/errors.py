"""Errors of a model by family of equations, by motion and by run, and what of a run's time is not judged.

Nothing is read again: all comes from the products of signals that the fit had.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.answer.error_parts import (
    FAMILY_OF,
    ROW_EQUATIONS,
    EquationError,
    ExcludedByMotion,
    ExcludedTime,
    RunShare,
    ScorePart,
)
from fingerlab.diagnosis.answer.results import HeldOutRuns
from fingerlab.diagnosis.equations.coefficients import NO_SHIFT
from fingerlab.diagnosis.equations.features import FORCE
from fingerlab.diagnosis.equations.parameters import TORQUE_ZERO
from fingerlab.diagnosis.fit.noise import floor_covariance, misfit_floor, tip_friction_covariance
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import EquationWeights, RunTotals, by_run
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import NARROW_RATE_HZ
from fingerlab.diagnosis.signals.conditions import GroupKey, folds_of_runs, group_key
from fingerlab.diagnosis.signals.filters import BRIDGED, CUT_OUT, EFFECTIVE_SHARE, SPIKE
from fingerlab.diagnosis.signals.scales import as_recorded
from fingerlab.effects.base import Row
from fingerlab.rig.file import changed_words
from fingerlab.sessions.model import CABLE_NAMES, Array, Run

FAMILY_UNITS = {"joint_torque": "N m", "cable_kinematics": "m", "motor_torque": "N m", "endpoint_force": "N"}


def equation_errors(reduced: Reduced, fitted: FittedModel) -> dict[str, EquationError]:
    """RMSE, R2 and floor of each family on held-out runs.

    Args:
        fitted: scored with :meth:`Scorer.score_held_out`.
    """
    sums: dict[str, Array] = {}
    for group in reduced.groups:
        of = fitted.model, fitted.fit.values, group, fitted.weights[group.key]
        squares = fitted.residuals[group.key], tip_friction_covariance(*of)
        for family, values in _families(reduced, fitted, group, squares).items():
            sums[family] = sums.get(family, np.zeros(4)) + group.samples * np.array([*values, 1.0])
    result, floors = {}, equation_floors(reduced, fitted)
    for family, unit in FAMILY_UNITS.items():
        if family in sums:
            error, rubbing, spread, count = sums[family]
            size = reduced.layout.scales.of(unit)
            result[family] = EquationError(
                unit,
                size * float(np.sqrt(error / count)),
                float(1.0 - error / max(spread, 1e-30)),
                floors[family],
                size * float(np.sqrt(max(rubbing, 0.0) / count)),
            )
    return result


def equation_floors(reduced: Reduced, fitted: FittedModel, cycles_alone: bool = False) -> dict[str, float]:
    """Floor of each family by a model, rms, SI.

    An answer tells one floor of each, by the last model of its path, as its scores are in the floors of that:
    noise of the current counts by the arms and the friction that a model finds.

    Args:
        cycles_alone: what differs from cycle to cycle, without what runs differ by.
    """
    sums: dict[str, Array] = {}
    for group in reduced.groups:
        of = fitted.model, fitted.fit.values, group, fitted.weights[group.key]
        noise = misfit_floor(*of) if cycles_alone else floor_covariance(*of, means=reduced.constants is None)
        for family, (square, _) in _families(reduced, fitted, group, [noise]).items():
            sums[family] = sums.get(family, np.zeros(2)) + group.samples * np.array([square, 1.0])
    size = reduced.layout.scales.of
    return {
        family: size(FAMILY_UNITS[family]) * float(np.sqrt(square / count))
        for family, (square, count) in sums.items()
    }


def with_floors(errors: Mapping[str, EquationError], floors: Mapping[str, float]) -> dict[str, EquationError]:
    """The errors with these floors (rms, SI), by family."""
    return {family: replace(error, floor=floors[family]) for family, error in errors.items()}


def _families(
    reduced: Reduced, fitted: FittedModel, group: Group, squares: Sequence[Array]
) -> dict[str, tuple[float, ...]]:
    """For each family: mean squares by these products of the equations, and variance of what was measured."""
    result = {}
    for family, (weights, measured) in squares_by_family(reduced, fitted, group).items():
        result[family] = (*(float((weights * one).sum()) for one in squares), measured)
    return result


def squares_by_family(reduced: Reduced, fitted: FittedModel, group: Group) -> dict[str, tuple[Array, float]]:
    """By what products of the equations' residuals make the square of each family's, and its variance.

    (5, 5) over ``Row``, and N^2, m^2 or (N m)^2: a joint's torque is a tension times its arm, the motor's
    the mean of both tensions, the force the PIP joint's torque over its lever.
    """
    if group.on_bench:
        return {"motor_torque": (_squares({Row.BENCH: 1.0}), _variance(reduced, group, Row.BENCH, None))}
    radius = reduced.radius
    routing = CABLE_NAMES[group.cable_sign]
    values = fitted.values
    a, b = values[f"arm_mcp@{routing}"], values[f"arm_pip@{routing}"]
    pull = _variance(reduced, group, Row.MCP, NO_SHIFT)
    wound = _variance(reduced, group, Row.CABLE, NO_SHIFT)
    motor = np.zeros((5, 5))
    motor[np.ix_([Row.MCP, Row.PIP], [Row.MCP, Row.PIP])] = 0.25 * radius**2
    result = {
        "joint_torque": (_squares({Row.MCP: 0.5 * a**2, Row.PIP: 0.5 * b**2}), 0.5 * (a**2 + b**2) * pull),
        "cable_kinematics": (_squares({Row.CABLE: 1.0}), wound),
        "motor_torque": (motor, radius**2 * pull),
    }
    lever, force = _contact(reduced, group)
    if lever > 0:
        result["endpoint_force"] = (_squares({Row.PIP: (b / lever) ** 2}), force)
    return result


def _squares(of: Mapping[Row, float]) -> Array:
    result = np.zeros((5, 5))
    for row, weight in of.items():
        result[row, row] = weight
    return result


def _find(reduced: Reduced, **wanted: object) -> int:
    """Index of the model's own feature with these attributes.

    Raises:
        LookupError: there is none.
    """
    for i, feature in enumerate(reduced.layout.features):
        if feature.owner is None and all(getattr(feature, k) == v for k, v in wanted.items()):
            return i
    raise LookupError(f"no feature has {wanted}")


def _variance(reduced: Reduced, group: Group, row: Row, shift: int | None) -> float:
    """Variance of the measured channel of an equation: N^2, m^2 or (N m)^2."""
    offset = "bench_offset" if reduced.on_bench else TORQUE_ZERO  # beside a finger it is the current's zero
    names = {Row.MCP: "loss_mcp", Row.CABLE: "offset", Row.BENCH: offset}
    measured = _find(reduced, row=row, constant=-1.0, shift=shift, scale="direct")
    products = _products(reduced, group, [measured, _find(reduced, row=row, parameter=names[row])])
    count = max(float(products[1, 1]), 1.0)
    return float(products[0, 0] / count - (products[0, 1] / count) ** 2)


def _products(reduced: Reduced, group: Group, features: list[int]) -> Array:
    """Products of some features over all samples, (k, k)."""
    signals = reduced.layout.signals[features]
    return group.whole.products[np.ix_(signals, signals)]


def _contact(reduced: Reduced, group: Group) -> tuple[float, float]:
    """Lever (m) of the force about the PIP joint and the force's variance (N^2); zero without contact."""
    if not group.in_contact:
        return 0.0, 0.0
    places = [reduced.layout.features.index(FORCE)]
    places += [_find(reduced, row=Row.PIP, parameter=name) for name in ("force_gain", "loss_pip")]
    products = _products(reduced, group, places)
    force, torque, one = range(3)
    if products[force, force] <= 0:
        return 0.0, 0.0
    count = max(float(products[one, one]), 1.0)
    lever = float(products[torque, force] / products[force, force])
    return lever, float(products[force, force] / count - (products[force, one] / count) ** 2)


def held_out_runs(runs: Sequence[Run], reduced: Reduced, fitted: FittedModel) -> tuple[HeldOutRuns, ...]:
    """The model's score on the runs of every condition, in the order of the groups; () if it has none.

    Args:
        runs: that are analysed.
    """
    if not fitted.held_out:
        return ()
    members = _members(runs)
    conditions = [(g.key, c) for g in reduced.groups for c in g.conditions]
    found = []
    for place, (misfit, count) in zip(conditions, fitted.misfits, strict=True):
        mine = [runs[number] for number in members[place]]
        found.append(
            HeldOutRuns(
                runs=tuple(run.name for run in mine),
                phase=mine[0].phase,
                cable=mine[0].cable,
                trajectory=as_recorded(mine[0]).trajectory,
                score=float(np.sqrt(1.0 + max(float(misfit), 0.0) / max(float(count), 1.0))),
                change=changed_words(as_recorded(mine[0]).attributes),
            )
        )
    return tuple(found)


def run_shares(
    runs: Sequence[tuple[str, Run]], reduced: Reduced, fitted: FittedModel
) -> tuple[tuple[RunShare, ...], tuple[ScorePart, ...]]:
    """What every family of equations of every run adds to the squared score, and every equation by motion.

    The misfit of a fold goes to its equations as the weighted products of their residuals do; what they miss
    together, half to each. Runs that were held out together share it by their samples. Both are empty where
    the score is not one of held-out runs.

    Args:
        runs: that are analysed, with the session of each.
    """
    if not fitted.held_out or not fitted.folds:
        return (), ()
    total, every = max(fitted.count, 1.0), max(sum(g.samples for g in reduced.groups), 1)
    # A misfit below what noise gives counts as none, in the score as here.
    scale = (1.0 if float(fitted.misfits[:, 0].sum()) > 0 else 0.0) / total
    shares, parts = list[RunShare](), list[ScorePart]()
    for group in reduced.groups:
        of_group = list[RunShare]()
        of_rows = _shares_of_rows(fitted, group)
        left = scale * fitted.folds[group.key].misfits
        for fold, rows, misfit in zip(group.folds, of_rows, left, strict=True):
            floor = EFFECTIVE_SHARE * group.equations / len(rows) / total
            for one in fold.totals:
                session, run = runs[one.number]
                count, loose = float(one.counts[0]), float(one.counts[1])
                part = misfit * count / max(fold.samples, 1)
                for family in dict.fromkeys(FAMILY_OF[ROW_EQUATIONS[row]] for row in rows):
                    mine = [row for row in rows if FAMILY_OF[ROW_EQUATIONS[row]] == family]
                    squared = part * sum(rows[row] for row in mine)
                    aside = loose / max(count, 1.0) if Row.CABLE in mine else 0.0
                    share = squared + floor * count * len(mine)
                    of_group.append(
                        RunShare(
                            session, run.name, run.phase, run.cable, family,
                            count / every, aside, squared, share,
                        )
                    )  # fmt: skip
        shares += _of_whole_runs(of_group) if group.in_parts else of_group
        parts += _parts_of_motions([run for _, run in runs], group, of_rows, left, every)
    return _none_below_zero(shares), tuple(parts)


def _of_whole_runs(shares: Sequence[RunShare]) -> Iterator[RunShare]:
    """Shares of blocks of runs, which were held out one after the other, added up to those of the runs."""
    for place in dict.fromkeys((one.session, one.run, one.equation) for one in shares):
        mine = [one for one in shares if (one.session, one.run, one.equation) == place]
        of_samples = sum(one.samples for one in mine)
        yield replace(
            mine[0],
            samples=of_samples,
            left_aside=sum(one.left_aside * one.samples for one in mine) / max(of_samples, 1e-300),
            squared=sum(one.squared for one in mine),
            share=sum(one.share for one in mine),
        )


def _none_below_zero(shares: Sequence[RunShare]) -> tuple[RunShare, ...]:
    """The shares with none below zero, as where a run left less than noise would; their sum stays."""
    whole = sum(one.share for one in shares)
    kept = whole / sum(max(one.share, 0.0) for one in shares)
    return tuple(replace(one, share=kept * max(one.share, 0.0)) for one in shares)


def _parts_of_motions(
    runs: Sequence[Run], group: Group, of_rows: Sequence[Mapping[Row, float]], left: Array, every: int
) -> Iterator[ScorePart]:
    """The same by motions and equations: a motion's runs, the folds of its condition.

    Args:
        of_rows: each fold's shares of the equations. left: what each adds, (folds,). every: samples of all.
    """
    for condition in group.conditions:
        places = group.of_condition(condition)
        folds = [group.folds[k] for k in places]
        samples = sum(fold.samples for fold in folds)
        aside = sum(fold.slack_samples for fold in folds) / max(samples, 1)
        mine = [runs[n] for n in sorted({one.number for fold in folds for one in fold.totals})]
        for row in of_rows[places[0]]:
            yield ScorePart(
                tuple(run.name for run in mine), mine[0].phase, mine[0].cable, ROW_EQUATIONS[row],
                samples / every, aside if row == Row.CABLE else 0.0,
                float(sum(of_rows[k][row] * left[k] for k in places)),
            )  # fmt: skip


def excluded_times(
    reduction: Reduction, reduced: Reduced, fitted: FittedModel
) -> tuple[tuple[ExcludedTime, ...], tuple[ExcludedByMotion, ...]]:
    """What of each run's time some equation, or none at all, is not judged by, and why; and by motions."""
    every = reduction.analysed
    of_runs, of_motions = list[ExcludedTime](), list[ExcludedByMotion]()
    for group in reduced.groups:
        for condition in group.conditions:
            folds = [group.folds[k] for k in group.of_condition(condition)]
            totals = by_run([one for fold in folds for one in fold.totals])
            mine = [
                each
                for one in totals
                for each in _excluded_times_of(reduction, one, bool(fitted.model.stiction))
            ]
            of_runs += mine
            runs = [every[one.number] for one in totals]
            names = tuple(run.name for run in runs)
            lasts = sum(_lasts(reduction, one.number) for one in totals)
            for equation, reason in dict.fromkeys((one.equation, one.reason) for one in mine):
                seconds = sum(one.seconds for one in mine if one.reason == reason)
                of_motions.append(
                    ExcludedByMotion(
                        names, runs[0].phase, runs[0].cable, equation, reason, seconds / lasts, seconds
                    )
                )
    return tuple(of_runs), tuple(of_motions)


def _excluded_times_of(reduction: Reduction, totals: RunTotals, stiction: bool) -> list[ExcludedTime]:
    """The same of one run; ``stiction``: friction of the model may hold any torque at rest."""
    number, (samples, slack, rest) = totals.number, totals.counts
    (session, name), run = reduction.runs[number], reduction.analysed[number]
    repairs = reduction.repairs[number]
    bridged, cut = repairs.get(BRIDGED, 0), repairs.get(CUT_OUT, 0)
    spikes = sum(count for (how, _), count in repairs.items() if how == SPIKE)
    length = _whole_length(reduction, number)
    whole = NARROW_RATE_HZ * length / run.sample_rate_hz
    shares = (
        ("", "ramp", 1.0 - float(samples) / whole - cut / length),
        ("cable_kinematics", "slack", float(slack) / whole),
        ("", "standstill", float(rest) / whole if stiction else 0.0),
        ("", "spikes", spikes / length),
        ("", "gap", (bridged + cut) / length),
    )
    lasts = _lasts(reduction, number)
    return [
        ExcludedTime(session, name, run.phase, run.cable, equation, reason, share, share * lasts)
        for equation, reason, share in shares
        if share > 0
    ]


def _whole_length(reduction: Reduction, number: int) -> int:
    """Samples of a run, with those that were lost."""
    repairs = reduction.repairs[number]
    return max(reduction.analysed[number].length + repairs.get(BRIDGED, 0) + repairs.get(CUT_OUT, 0), 1)


def _lasts(reduction: Reduction, number: int) -> float:
    """How long they took, s."""
    return _whole_length(reduction, number) / as_recorded(reduction.analysed[number]).sample_rate_hz


def _shares_of_rows(fitted: FittedModel, group: Group) -> list[dict[Row, float]]:
    """Share of each fold's misfit that each of its equations has; together 1."""
    noise = misfit_floor(fitted.model, fitted.fit.values, group, fitted.weights[group.key])
    weights = fitted.weights[group.key]
    by_moments = EquationWeights.of(weights)
    # Where the tip is, an equation says in contact alone.
    rows = [row for row in Row if weights[row, row] > 0 and (row != Row.TIP or group.in_contact)]
    found = []
    for fold, residuals in zip(group.folds, fitted.folds[group.key].residuals, strict=True):
        mean = residuals / max(fold.samples, 1)
        own = by_moments.on_average(fold.slack_samples / max(fold.samples, 1))
        missed = np.maximum(np.einsum("ij,ij->i", own, mean - noise), 0.0)
        whole = float(missed[rows].sum())
        found.append({row: float(missed[row]) / whole if whole > 0 else 1.0 / len(rows) for row in rows})
    return found


def _members(runs: Sequence[Run]) -> dict[tuple[GroupKey, int], list[int]]:
    """Numbers of the runs of each condition of each group, as the reading deals them."""
    folds, places = folds_of_runs(runs)
    members: dict[tuple[GroupKey, int], list[int]] = {}
    for number, (run, place) in enumerate(zip(runs, places, strict=True)):
        key = group_key(run)
        members.setdefault((key, folds[key][place].condition), []).append(number)
    return members

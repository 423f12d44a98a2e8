"""What is settled of a bench by models of it: a late torque, and constants that every run has of its own.

Both are looked for under the bare model, whatever effects are given, before an effect is; constants once more
by what the best model misses, where the runs' motions do not come again.

Runs that were told the same motion miss a model's law by the same amount, whatever the law lacks. By what
their means differ all the same is no matter of physics: it is the bench's. So the spreads of the zeros are
those of greatest likelihood (empirical Bayes, Searle, Casella and McCulloch, "Variance Components", 1992) of
the differences between repeated runs alone; a clean bench has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.diagnosis.equations.features import FORCE, Layout
from fingerlab.diagnosis.equations.model import Choice, Model
from fingerlab.diagnosis.equations.parameters import TORQUE_LAG
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.fit.noise import untold_variance
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import (
    KINDS,
    OF_CABLE,
    OF_TORQUE,
    SOURCES,
    EquationWeights,
    RunConstants,
    of_constants,
    share_of_equations,
    with_constants,
)
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.settings import (
    AS_WELL_TOLD,
    CONSTANTS_ROUNDS,
    DECIDING_LOG_ODDS,
    HALF_LEFT,
    LAG_AT_EDGE,
    LAG_SHARE,
    LEAST_CONSTANTS,
    LEAST_SHARE_OF_CONSTANTS,
    NEARLY_RIGHT,
    ONE_WAY,
    ONE_WAY_POINTS,
    RUN_CONSTANT_RANGE,
    SPREAD_STEPS,
    SPRING_RANGE,
    SPRING_SPREAD,
    STANDING_LOAD,
    STILL_LEFT,
)
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.diagnosis.signals.load_cell_zero import SeenZeros
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array, Run


def settle_constants(reduction: Reduction, scorer: Scorer) -> Scorer:
    """The scorer, with a late torque and constants that every run has of its own, if any were found.

    They are looked for once, under the bare model, whatever effects are given.
    """
    if scorer.reduced.on_bench and not (reduction.settled or reduction.late_torque):
        told = scorer.with_late_told()
        reduction.late_torque = torque_is_late(reduction, told)
        scorer = told if reduction.late_torque else scorer
    if reduction.late_torque:
        scorer = scorer.with_late_torque()
    if reduction.constants is None and not reduction.settled:
        free = Scorer(replace(scorer.reduced, fixed={})) if scorer.reduced.fixed else scorer
        bare, rig = free.bare, reduction.sessions[0].rig
        reduction.settle(
            zeros_beside_state_law(reduction, scorer.reduced)
            or find_constants(
                scorer.reduced,
                bare.model,
                bare.fit.values,
                bare.weights,
                rig,
                reduction.motions,
                seen=reduction.zeros_in_the_air,
            )
        )
    return scorer if reduction.constants is None else scorer.with_constants(reduction.constants)


def torque_is_late(reduction: Reduction, scorer: Scorer) -> bool:
    """Whether the torque of a motor alone is logged so far from its position that it has to be known.

    Only where that explains nearly all that the bare model misses, and more than viscous friction would: the
    lag of a machine that rubs is not told from its friction. A torque that comes early looks like nothing
    that rubs.
    """
    late, bare = scorer.with_late_torque(), scorer.score_held_out(scorer.bare)
    lagging = late.score_held_out(late.fit_reweighted([], bare))
    place = lagging.model.index[TORQUE_LAG]
    lag, most = float(lagging.fit.values[place]), float(lagging.model.high[place])
    if not lagging.misfit < (1.0 - LAG_SHARE) * bare.misfit:
        return False
    if lag < 0.0:
        return True
    if lag >= LAG_AT_EDGE * most:
        return False
    # Also where it is not asked for, or left out of the catalogue.
    rubs = next(e for e in CATALOGUE.values() if e.like_late_torque)
    beside = Scorer(replace(reduction.refined([rubs]), late_is_no_noise=True))
    rubbing = beside.score_held_out(beside.fit_reweighted([Choice(rubs)], bare))
    return rubbing.misfit - lagging.misfit > 2.0 * DECIDING_LOG_ODDS


def zeros_beside_state_law(reduction: Reduction, reduced: Reduced) -> RunConstants | None:
    """Zeros of a motor's torque that differ by run, where no motion comes again; None: not enough to matter.

    Only if a law of the state (``gram.state_law``) that has a constant in every run leaves half of what one
    leaves that has the same in all. A model that was fitted without would bend to them.
    """
    bounded = [group for group in reduced.groups if group.bounded]
    if not bounded or zero_is_confounded(reduction.analysed):
        return None
    shared, own = (untold_variance(reduced, bounded, zeros_move) for zeros_move in (False, True))
    if not own < HALF_LEFT * shared:
        return None
    rig, spreads = reduction.sessions[0].rig, np.zeros(len(SOURCES))
    spreads[OF_TORQUE] = float(np.sqrt(shared - own))
    shares = {g.key: share_of_equations(g.cable_sign, not g.on_bench, 1.0, {}, rig) for g in bounded}
    return RunConstants(spreads, shares, by_averages=True)


def lag_beside(reduction: Reduction, models: Sequence[FittedModel]) -> FittedModel | None:
    """The best of some models of a motor alone beside a lag of its torque, held out; None: it is at its edge.

    Beside a ripple, which turns round faster than inertia or friction, half a sample counts.
    """
    found = []
    for model in models:
        effects = at_found_shapes(model)
        reduced = reduction.refined(effects)
        scorer = Scorer(replace(reduced, layout=replace(reduced.layout, late_torque=True)))
        fitted = scorer.score_held_out(scorer.fit_reweighted([Choice(e) for e in effects], model))
        place = fitted.model.index[TORQUE_LAG]
        if abs(fitted.fit.values[place]) < LAG_AT_EDGE * abs(fitted.model.high[place]):
            found.append(fitted)
    return min(found, key=lambda one: one.misfit, default=None)


def zero_is_confounded(runs: Sequence[Run]) -> bool:
    """Whether a zero of the torque in each run of a motor alone would pass for what rubs or for a known load.

    Of runs that go one way each, some this way and some that, friction is a constant; of runs under a load
    that stands, another in each, so is what the load's gain lacks.
    """
    ways, loads = [], []
    for run in runs:
        every = slice(None, None, max(run.length // ONE_WAY_POINTS, 1))
        position = run.channel("motor_position")[every]
        moves = np.diff(position[np.isfinite(position)])
        travel = float(np.abs(moves).sum())
        ways.append(float(moves.sum()) / travel if travel > 0 else 0.0)
        if run.has("load_torque"):
            loads.append(run.channel("load_torque")[every])
    one_way = min(map(abs, ways)) > ONE_WAY and min(ways) < 0 < max(ways)
    between = float(np.ptp([np.nanmean(one) for one in loads])) if loads else 0.0
    within = max((float(np.nanstd(one)) for one in loads), default=0.0)
    return one_way or (len(loads) == len(runs) and between > 0 and within < STANDING_LOAD * between)


def likeliest_constants(
    reduction: Reduction, scorer: Scorer, last: FittedModel
) -> tuple[RunConstants | None, FittedModel]:
    """Constants of the runs by what a model misses on their averages, and the model beside them, held out.

    A model that was fitted without them has bent to them, and misses less than they are. Beside them it is
    fitted anew, and they are looked for again (expectation and maximisation in turn), until they stand.
    None: there are none that would matter.
    """
    found, rig, fitted = None, reduction.sessions[0].rig, last
    for _ in range(CONSTANTS_ROUNDS):
        of_model = fitted.model, fitted.fit.values, fitted.weights
        again = find_constants(
            scorer.reduced, *of_model, rig, reduction.motions, alone=True, seen=reduction.zeros_in_the_air
        )
        if again is None or (found is not None and np.array_equal(found.spreads, again.spreads)):
            break
        found, beside = again, scorer.with_constants(again)
        fitted = beside.score_held_out(beside.fit_reweighted(last.choices, fitted))
    return found, fitted


def is_borne_out(before: FittedModel, end: FittedModel, complete: bool) -> bool:
    """Whether a bench's own errors, once taken off, leave far less of the best model's misfit.

    Half, where the path ends near the floor, or ``complete``: nothing more is found to be missing.
    """
    near = complete or not lacks_fit(end, NEARLY_RIGHT)
    return end.misfit < (HALF_LEFT if near else STILL_LEFT) * before.misfit


@dataclass(frozen=True)
class Contrasts:
    """Differences between repeated runs: what each says of constants in the equations.

    ``pull`` (n, 5) is the gradient of the log density at no constant, ``information`` (n, 5, 5) minus its
    curvature, both over ``Row``; ``shares`` (n, 5, 5) what one unit of each source adds to the equations.
    ``values`` are the independent values of the runs behind them. ``seen`` is what the load cell shows of its
    zeros in the air, where no law has a say; None: nothing.
    """

    pull: Array
    information: Array
    shares: Array
    values: float
    seen: SeenZeros | None = None

    def at_most(self) -> float:
        """What no spreads can exceed: all that constants in every run would explain."""
        shown = 0.0 if self.seen is None else 0.5 * self.seen.square / self.seen.resolved**2
        return shown + self._explained_at_most()

    def _explained_at_most(self) -> float:
        pull, information = self._of_sources(NOMINAL)
        inverse = np.linalg.pinv(information, hermitian=True, rcond=1e-9)
        return float(0.5 * np.einsum("ri,rij,rj->", pull, inverse, pull))

    def log_density(self, spreads: Array, springs: Array) -> float:
        """Of the differences, against that with no constants of the runs; ``spreads`` (5,).

        Args:
            springs: by how many times each joint's spring is as stiff as the rig file says, (2,).
        """
        pull, information = self._of_sources(springs)
        pull = pull * spreads
        matrix = np.eye(len(spreads)) + information * np.outer(spreads, spreads)
        explained = np.einsum("ri,ri->", pull, np.linalg.solve(matrix, pull[:, :, None])[:, :, 0])
        shown = 0.0 if self.seen is None else self.seen.log_density(float(spreads[OF_FORCE]))
        return shown + float(0.5 * explained - 0.5 * np.linalg.slogdet(matrix)[1].sum())

    def with_free_springs(self, spreads: Array) -> float:
        """The same with the stiffness of the springs as likely as may be: a zero acts through its spring."""
        from scipy.optimize import minimize  # by those alone whose zeros move: it takes a while to load

        def cost(springs: Array) -> float:
            far = (springs - 1.0) / SPRING_SPREAD
            return 0.5 * float(far @ far) - self.log_density(spreads, springs)

        return -float(minimize(cost, NOMINAL, bounds=[SPRING_RANGE] * 2).fun)

    def _of_sources(self, springs: Array) -> tuple[Array, Array]:
        """Pull (n, 5) and information (n, 5, 5) over ``SOURCES``."""
        shares = self.shares.copy()
        for joint, row in enumerate((Row.MCP, Row.PIP)):
            shares[:, row, joint] *= springs[joint]
        pull = np.einsum("re,res->rs", self.pull, shares)
        return pull, shares.transpose(0, 2, 1) @ self.information @ shares


OF_FORCE = SOURCES.index("endpoint_force")
NOMINAL = np.ones(2)
"""Both joints' springs as stiff as the rig file says."""


def find_constants(
    reduced: Reduced, model: Model, values: Array, weights: Weights, rig: Rig, motions: Sequence[int | None],
    alone: bool = False, seen: SeenZeros | None = None,
) -> RunConstants | None:  # fmt: skip
    """The constants that runs of these sessions have of their own; None: none that would matter.

    Args:
        model, values, weights: the bare model, its unknowns, (p,), and the weights that it was fitted under.
        motions: which runs were told just the same, see ``conditions.repeated_motions``.
        alone: of groups in which no motion comes again, and of all where constants were found already and may
            not be all, take what the model misses on the average of every run for its constants; it has to
            explain all but those.
        seen: how far the load cell's zeros are apart in the air; None: nobody knows.
    """
    known = dict(zip(model.index, map(float, values), strict=True))
    shares = {
        g.key: share_of_equations(
            g.cable_sign, not g.on_bench, reduced.radius, known, rig, _levers(reduced.layout, g)
        )
        for g in reduced.groups
    }
    found = [_contrasts(model, values, g, weights[g.key], shares[g.key], motions) for g in reduced.groups]
    lone = [alone and (reduced.constants is not None or not len(one.pull)) for one in found]
    found = [
        _averages(model, values, g, weights[g.key], shares[g.key]) if averaged else one
        for g, one, averaged in zip(reduced.groups, found, lone, strict=True)
    ]
    pressing = any(g.in_contact for g in reduced.groups)
    if not any(len(one.pull) for one in found) and not (pressing and seen is not None):
        return None
    columns = zip(*((one.pull, one.information, one.shares) for one in found), strict=True)
    pull, information, each = map(np.concatenate, columns)
    spreads = likeliest_spreads(Contrasts(pull, information, each, sum(one.values for one in found), seen))
    return RunConstants(spreads, shares, any(lone)) if spreads.any() else None


def _levers(layout: Layout, group: Group) -> tuple[float, float]:
    """Levers (m) of the force at the tip about MCP and PIP, on its average; 0 in free motion."""
    if not group.in_contact:
        return 0.0, 0.0
    sums = sum(t.values[0] for t in group.run_totals)
    force = next(i for i in layout.base if layout.features[i] == FORCE)
    parts = {f.row: i for i, f in layout.base_features if f.parameter == "force_gain"}
    pressed = float(sums[layout.signals[force]])
    if not pressed > 0.0:
        return 0.0, 0.0
    mcp, pip = (float(sums[layout.signals[parts[row]]]) / pressed for row in (Row.MCP, Row.PIP))
    return mcp, pip


def _contrasts(
    model: Model, values: Array, group: Group, weights: Array, share: Array, motions: Sequence[int | None]
) -> Contrasts:
    """Of a group's runs: orthonormal differences between those of each motion (Helmert's)."""
    h, own = model.features(values, group), EquationWeights.of(weights)
    pulls, count = [np.zeros((0, len(Row)))], 0.0
    information = [np.zeros((0, len(Row), len(Row)))]
    every = [t for fold in group.folds for t in fold.totals]
    for motion in sorted({m for t in every if (m := motions[t.number]) is not None}):
        totals = [t for t in every if motions[t.number] == motion]
        lengths = np.array([t.counts[0] for t in totals])
        if len(totals) < 2 or not lengths.all():
            continue
        # Runs of one motion are about equally long; as if they were just so.
        each = lengths.mean() / lengths
        pull = np.einsum("rke,k->re", with_constants(totals, model.pick, own), -h)
        mean = (of_constants(totals, own) * each[:, None, None]).mean(axis=0)
        basis = _helmert(len(totals))
        pulls.append(basis @ (pull * each[:, None]))
        information.append(np.repeat(mean[None], len(basis), axis=0))
        count += EFFECTIVE_SHARE * group.equations * float(lengths.sum())
    pull = np.concatenate(pulls)
    return Contrasts(pull, np.concatenate(information), np.repeat(share[None], len(pull), axis=0), count)


def _averages(model: Model, values: Array, group: Group, weights: Array, share: Array) -> Contrasts:
    """What every run of a group misses on its average."""
    h, own = model.features(values, group), EquationWeights.of(weights)
    totals = [t for fold in group.folds for t in fold.totals]
    pull = np.einsum("rke,k->re", with_constants(totals, model.pick, own), -h)
    count = EFFECTIVE_SHARE * group.equations * float(sum(t.counts[0] for t in totals))
    return Contrasts(pull, of_constants(totals, own), np.repeat(share[None], len(pull), axis=0), count)


def _helmert(count: int) -> Array:
    """Orthonormal contrasts of so many numbers, (count - 1, count)."""
    rows = np.zeros((count - 1, count))
    for k in range(1, count):
        rows[k - 1, :k], rows[k - 1, k] = 1.0, -float(k)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def likeliest_spreads(contrasts: Contrasts) -> Array:
    """Spreads of greatest likelihood, (5,), each kind of channel with one; zero where it hardly matters.

    One kind after the other on a grid. A kind stays only if the others cannot take its place, with springs
    that may be of another stiffness than the rig file says: an angle's zero looks a little like the motor's
    then. Where the cable's way tells of the joints' zeros or the motor's as well, either may have moved.
    """
    grid = np.concatenate(([0.0], np.geomspace(*RUN_CONSTANT_RANGE, SPREAD_STEPS)))

    def of(each: Sequence[float]) -> Array:
        spreads = np.zeros(len(SOURCES))
        for kind, spread in zip(KINDS, each, strict=True):
            spreads[list(kind)] = spread
        return spreads

    def density(each: Sequence[float]) -> float:
        return contrasts.log_density(of(each), NOMINAL)

    def climbed(start: Sequence[float], free: Sequence[int]) -> tuple[float, list[float]]:
        each = [s if k in free else 0.0 for k, s in enumerate(start)]
        best = density(each)
        while True:
            before = best
            for k in free:
                tried = [density([*each[:k], s, *each[k + 1 :]]) for s in grid]
                best, each[k] = max(tried), float(grid[int(np.argmax(tried))])
            if best <= before + 1e-6 * abs(before):
                return best, each

    least = LEAST_CONSTANTS * contrasts.values
    if contrasts.at_most() < least:
        return np.zeros(len(SOURCES))
    free = list(range(len(KINDS)))
    best, each = max(climbed([s] * len(KINDS), free) for s in (0.0, float(grid[len(grid) // 2])))
    if best < least:
        return np.zeros(len(SOURCES))
    while len(free) > 1:
        others = {k: [j for j in free if j != k] for k in free}
        fewer = {k: climbed(each, others[k]) for k in free}
        left = {k: contrasts.with_free_springs(of(fewer[k][1])) for k in free}
        needless = max(free, key=lambda k: left[k])
        if best - left[needless] >= max(least, LEAST_SHARE_OF_CONSTANTS * best):
            break
        (best, each), free = fewer[needless], others[needless]
    for k, kept in (OF_CABLE, OF_CABLE[::-1]):
        if kept in free and k not in free:
            instead, its = climbed(each, [k, *(j for j in free if j != kept)])
            if its[k] and best - instead < AS_WELL_TOLD:
                each[k] = its[k]
    return of(each)

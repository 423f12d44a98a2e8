"""The laws that a number may follow over sessions, weighed by their evidence in closed form.

A number of session i is level + change * x_i + error. x is the law: a step, a straight line, something that
settles, a bench that warms up, one session that went wrong, or nothing. The error is normal, its variance the
sum of the session's own (its interval) and of a scatter between sessions that is the same for all and not
known. Level and change have normal priors, so that for one law, one scatter and one size of the prior the
evidence is that of Bayesian linear regression (Bishop, Pattern Recognition and Machine Learning, 2006,
eq. 3.86); it is summed over scatters, sizes, places of a step and time constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.batch.settings import (
    BARELY,
    BEYOND,
    CERTAIN_AT_ENDS,
    KINDS,
    LEAST_SCATTER,
    LEAST_SESSIONS,
    LEVEL,
    PAUSE_H,
    PROBABLE,
    SCATTER,
    SCATTERS,
    SETTLING_SHARES,
    SHARED,
    SIZES,
    STEPS,
    WARMING_MIN,
    WITHIN,
)
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Errors:
    """What the errors of the sessions may be: every scatter with every share of the intervals.

    Attributes:
        variances: of each session, (g, n). scatters: between sessions, (g,). common: variance of what all
            sessions have in common, which moves their level, (g,). weights: logarithms of their
            probabilities beforehand, (g,).
    """

    variances: Array
    scatters: Array
    common: Array
    weights: Array


def possible_errors(values: Array, errors: Array, size: float) -> Errors:
    """The errors over which evidence is summed.

    Args:
        values, errors: of the sessions, (n,); 0 where an error is not known. size: a strength that would
            matter.
    """
    own = float(np.median(errors[errors > 0])) if np.any(errors > 0) else 0.0
    least = LEAST_SCATTER * (own or float(np.std(values)) or size)
    most = max(10.0 * SCATTER * size, 3.0 * float(np.ptp(values)), 10.0 * least)
    grid = np.geomspace(least, most, SCATTERS)
    edges = np.concatenate(([0.0], np.sqrt(grid[1:] * grid[:-1]), [np.inf]))
    below = 2.0 / math.pi * np.arctan(edges / (SCATTER * size))  # half-Cauchy
    weights = np.log(np.maximum(np.diff(below), 1e-300))
    shared = SHARED if own else {1.0: 1.0}
    variances = np.concatenate([(f * errors) ** 2 + grid[:, None] ** 2 for f in shared])
    return Errors(
        variances,
        np.tile(grid, len(shared)),
        np.repeat([(1.0 - f**2) * own**2 for f in shared], len(grid)),
        np.concatenate([weights + math.log(share) for share in shared.values()]),
    )


NEGLIGIBLE = 1e-5
"""Share of the likeliest part's weight below which a part counts nothing in an interval."""
LEAST_LEVEL = 1e-6
"""What counts as nothing of an effect, in strengths that would matter: no number divides by zero."""
MINUTES_A_DAY, HOURS_A_DAY = 1440.0, 24.0


@dataclass(frozen=True)
class Prior:
    """What is known of a number before it is followed.

    Attributes:
        nominal: its value where nothing else is said. size: a strength that would matter, in the same unit.
        absent: whether zero means that there is nothing of it, as of the strength of an effect.
        change: probability of any change beforehand.
    """

    nominal: float
    size: float
    absent: bool = False
    change: float = 0.5


@dataclass(frozen=True)
class Estimate:
    """A value with its 90 % interval, in the unit of the numbers."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Course:
    """What became of a number over the sessions that have it.

    Attributes:
        chances: probability of "steady" and of each kind of ``settings.KINDS``; together 1.
        places: probability of each session, (n,), that a step is right before it, if there is a step.
        odd: probability of each session, (n,), that it alone went wrong, if one did.
        first, last: the level at the first and the last session, by the likeliest kind. size: last less
            first; of warming up, warm less cold; of a session that went wrong, by how much.
        scatter: between sessions, beyond what each one's interval tells.
        learned: Bayes factor of any change against none.
    """

    chances: Mapping[str, float]
    places: Array
    odd: Array
    first: Estimate
    last: Estimate
    size: Estimate
    scatter: Estimate
    learned: float

    @property
    def kind(self) -> str:
        """The likeliest, the kinds of a step taken together: "steady" or one of ``settings.KINDS``."""
        return likeliest(self.chances)[0]

    @property
    def verdict(self) -> str:
        """What may be said: :attr:`kind`, or "open", where no kind is likelier than all others together, or
        where it is likeliest steady and the sessions hardly speak for it."""
        kinds = likeliest(self.chances)
        if kinds == ("steady",):
            return "steady" if self.learned < 1.0 / BARELY else "open"
        return kinds[0] if self.certain >= (CERTAIN_AT_ENDS if self.at_end else PROBABLE) else "open"

    @property
    def at_end(self) -> bool:
        """Whether the first or the last session alone is otherwise, by a step or as one that went wrong."""
        if self.kind == "odd":
            return int(np.argmax(self.odd)) in (0, len(self.odd) - 1)
        return self.kind in STEPS and self.place in (1, len(self.places) - 1)

    @property
    def moment(self) -> bool:
        """Whether what may be said is that it changed at one moment."""
        return self.verdict in STEPS

    @property
    def certain(self) -> float:
        """Probability of the likeliest, the kinds of a step taken together."""
        return sum(self.chances[kind] for kind in likeliest(self.chances))

    @property
    def step(self) -> float:
        """Probability that it changed at one moment."""
        return sum(self.chances.get(kind, 0.0) for kind in STEPS)

    @property
    def place(self) -> int:
        """Number of sessions before the likeliest step."""
        return int(np.argmax(self.places))


def likeliest(chances: Mapping[str, float]) -> tuple[str, ...]:
    """The likeliest kind, the kinds of a step taken together; of these all, the likeliest first."""
    steps = tuple(sorted((kind for kind in STEPS if kind in chances), key=lambda kind: -chances[kind]))
    other = max((kind for kind in chances if kind not in STEPS), key=lambda kind: chances[kind])
    return steps if sum(chances[kind] for kind in steps) > chances[other] else (other,)


@dataclass(frozen=True)
class _CourseLaw:
    """Courses of one kind: ``shapes`` (m, n), each as likely or by ``weights`` (m,), with a level or none."""

    kind: str
    share: float
    shapes: Array
    levelled: bool = True
    places: tuple[int, ...] = ()
    weights: Array | None = None


@dataclass
class _Parts:
    """A law's parts: log weights and the regression of each, (m, scatters, sizes)."""

    law: _CourseLaw
    weight: Array
    mean: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)))
    cover: tuple[Array, Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0), np.zeros(0)))


def course(
    days: Array, values: Array, errors: Array, prior: Prior, used: Array | None = None
) -> Course | None:
    """Weigh what became of a number; None of fewer than three sessions, or all of one time.

    Args:
        days: of recording, (n,), rising. values: (n,). errors: standard error of each, (n,); NaN: unknown.
        used: seconds recorded so far, (n,); None: not known.
    """
    if len(values) < LEAST_SESSIONS or days[-1] <= days[0]:
        return None
    away = float(np.max(np.abs(values - prior.nominal)))
    size = max(prior.size, away / BEYOND, 1e-300)
    may_be = possible_errors(values, np.nan_to_num(errors, nan=0.0), size)
    laws = _laws(days, used, len(values), prior)
    if len(values) > MANY:
        may_be = _likely(laws, values, prior, size, may_be)
    parts = [_regressed(law, values, prior, size, may_be) for law in laws]
    top = max(float(one.weight.max()) for one in parts)
    whole = sum(float(np.exp(one.weight - top).sum()) for one in parts)
    each = [(one, np.exp(one.weight - top) / whole) for one in parts]
    chances = dict.fromkeys(("steady", *KINDS), 0.0)
    for one, weight in each:
        chances[one.law.kind] += float(weight.sum())
    places, odd = (_of_places(each, kinds, len(values)) for kinds in (STEPS, ("odd",)))
    kinds = likeliest(chances)
    chosen = [(one, weight) for one, weight in each if one.law.kind in kinds]
    nominal = prior.nominal
    first, last, by = (
        _mixture(chosen, ends, nominal, may_be.common)
        for ends in (_first, _last, _odd_size if kinds == ("odd",) else _size)
    )  # fmt: skip
    spread = sum(weight.sum(axis=(0, 2)) for _, weight in each)
    changed = 1.0 - chances["steady"]
    odds = changed / max(chances["steady"], 1e-300)
    learned = odds * (1.0 - prior.change) / prior.change
    return Course(chances, places, odd, first, last, by, _of_grid(may_be.scatters, spread), learned)


MANY = 60
"""Sessions from which on only errors that some places of a step leave likely are gone through with all."""


def _likely(laws: Sequence[_CourseLaw], values: Array, prior: Prior, size: float, errors: Errors) -> Errors:
    """The errors that count, looked for with every so many of a law's courses."""
    weight = np.full(len(errors.weights), -np.inf)
    for law in laws:
        thin = slice(None, None, max(len(law.shapes) // MANY, 1))
        each = None if law.weights is None else law.weights[thin]
        few = replace(law, shapes=law.shapes[thin], places=law.places[thin], weights=each)
        part = _regressed(few, values, prior, size, errors).weight
        weight = np.maximum(weight, part.max(axis=(0, 2)))
    kept = weight > weight.max() + math.log(NEGLIGIBLE)
    return Errors(errors.variances[kept], errors.scatters[kept], errors.common[kept], errors.weights[kept])


def _laws(days: Array, used: Array | None, n: int, prior: Prior) -> list[_CourseLaw]:
    """All laws that these sessions can have, their shares together 1."""
    index = np.arange(n)
    steps = tuple(k for k in range(1, n) if days[k] > days[k - 1])
    after = np.array([index >= k for k in steps], float).reshape(-1, n)
    pauses = days[list(steps)] - days[[k - 1 for k in steps]] > PAUSE_H / HOURS_A_DAY
    likely = np.where(pauses, 1.0, WITHIN)
    shapes: dict[str, Array] = {
        "step": after,
        "new": after if prior.absent else after[:0],
        "gone": 1.0 - after if prior.absent else after[:0],
        "wear": _straight(days, used),
        "settling": _settling(days, used),
        "warm_up": warming(days),
        "odd": np.eye(n),
    }
    shares = {kind: share for kind, share in KINDS.items() if len(shapes[kind])}
    if not prior.absent and "step" in shares:
        shares["step"] = sum(KINDS[kind] for kind in STEPS)
    whole = sum(shares.values())
    laws = []
    for kind, share in shares.items():
        share *= prior.change / whole
        places = steps if kind in STEPS else tuple(range(n)) if kind == "odd" else ()
        if kind == "odd" and prior.absent:
            share *= 0.5
            laws.append(_CourseLaw(kind, share, shapes[kind], levelled=False, places=places))
        weights = likely / likely.sum() if kind in STEPS else None
        laws.append(_CourseLaw(kind, share, shapes[kind], kind not in ("new", "gone"), places, weights))
    still = 0.5 * (1.0 - prior.change) if prior.absent else 1.0 - prior.change
    nothing = np.zeros((1, n))
    laws.append(_CourseLaw("steady", still, nothing))
    if prior.absent:
        laws.append(_CourseLaw("steady", still, nothing, levelled=False))
    return laws


def _straight(days: Array, used: Array | None) -> Array:
    """Wear by days, by sessions and by what was recorded, each from 0 to 1."""
    paces = [days - days[0], np.arange(len(days), dtype=float)]
    if used is not None and np.all(np.isfinite(used)):
        paces.append(used - used[0])
    return np.array([pace / pace[-1] for pace in paces if pace[-1] > 0]).reshape(-1, len(days))


def _settling(days: Array, used: Array | None) -> Array:
    """Running in by sessions and by what was recorded, each from 0 to 1."""
    if days[-1] - days[0] < PAUSE_H / HOURS_A_DAY:  # one sitting, in which it warms up
        return np.zeros((0, len(days)))
    paces = _straight(days, used)[1:]
    gone = 1.0 - np.exp(-paces[:, None, :] / np.array(SETTLING_SHARES)[:, None])
    return np.asarray((gone / gone[:, :, -1:]).reshape(-1, len(days)))


def warming(days: Array) -> Array:
    """How warm a bench is that warms up in each sitting, 0 to 1, (time constants, n); none of one each."""
    begins = np.concatenate(([True], np.diff(days) > PAUSE_H / HOURS_A_DAY))
    since = days - days[begins][np.cumsum(begins) - 1]
    if not np.any(since > 0):
        return np.zeros((0, len(days)))
    return 1.0 - np.exp(-since * MINUTES_A_DAY / np.array(WARMING_MIN)[:, None])


def _regressed(law: _CourseLaw, values: Array, prior: Prior, size: float, errors: Errors) -> _Parts:
    """Evidence, mean and covariance of level and change, for every course, scatter and size of the prior."""
    precise = 1.0 / errors.variances
    rest = values - prior.nominal if law.levelled else values
    a, p, t = precise.sum(axis=1), precise @ rest, precise @ rest**2
    level = 1.0 / ((LEVEL * size) ** 2 if law.levelled else errors.common + (LEAST_LEVEL * size) ** 2)
    level = np.broadcast_to(level, a.shape)
    flat = errors.weights + 0.5 * np.sum(np.log(precise / (2.0 * np.pi)), axis=1) - 0.5 * t
    a = a + level
    if law.kind == "steady":
        weight = math.log(law.share) + flat + 0.5 * np.log(level / a) + 0.5 * p**2 / a
        shape, zero = (1, len(a), 1), np.zeros((1, len(a), 1))
        return _Parts(law, weight.reshape(shape), ((p / a).reshape(shape), zero),
                      ((1.0 / a).reshape(shape), zero, zero))  # fmt: skip
    x = law.shapes
    b, q = (_summed(law, of)[:, :, None] for of in (precise, precise * rest))
    d = b if law.places else (precise @ (x**2).T).T[:, :, None]
    v = 1.0 / (np.array(SIZES) * size) ** 2
    a, p, level, d = a[None, :, None], p[None, :, None], level[None, :, None], d + v
    det = a * d - b**2
    mean = (d * p - b * q) / det, (a * q - b * p) / det
    each = np.full(len(x), 1.0 / len(x)) if law.weights is None else law.weights
    weight = np.log(law.share / len(SIZES) * each)[:, None, None] + flat[None, :, None]
    weight = weight + 0.5 * np.log(level * v / det) + 0.5 * (p * mean[0] + q * mean[1])
    return _Parts(law, weight, mean, (d / det, -b / det, a / det))


def _summed(law: _CourseLaw, weights: Array) -> Array:
    """Sums of weights (g, n) times each course, (m, g); of those that are 0 and 1 without a product."""
    places = list(law.places)
    if law.kind == "odd":
        return np.asarray(weights.T[places])
    if places:
        after = np.cumsum(weights[:, ::-1], axis=1)[:, ::-1]
        return np.asarray((after[:, :1] - after[:, places] if law.kind == "gone" else after[:, places]).T)
    return np.asarray((weights @ law.shapes.T).T)


def _of_places(each: Sequence[tuple[_Parts, Array]], kinds: Sequence[str], n: int) -> Array:
    """Probability of each session among those where one of these kinds may be, (n,)."""
    found = np.zeros(n)
    for one, weight in each:
        if one.law.kind in kinds:
            np.add.at(found, list(one.law.places), weight.sum(axis=(1, 2)))
    whole = float(found.sum())
    return found / whole if whole > 0 else found


Ends = Callable[[_CourseLaw], tuple[float, Array]]
"""What of the level and of each course, (m,), makes a number."""


def _first(law: _CourseLaw) -> tuple[float, Array]:
    return float(law.levelled), law.shapes[:, 0] * (law.kind != "odd")


def _last(law: _CourseLaw) -> tuple[float, Array]:
    return float(law.levelled), law.shapes[:, -1] * (law.kind != "odd")


def _size(law: _CourseLaw) -> tuple[float, Array]:
    if law.kind == "warm_up":
        return 0.0, law.shapes.max(axis=1)
    return 0.0, law.shapes[:, -1] - law.shapes[:, 0]


def _odd_size(law: _CourseLaw) -> tuple[float, Array]:
    return 0.0, np.ones(len(law.shapes))


def _mixture(each: Sequence[tuple[_Parts, Array]], ends: Ends, nominal: float, common: Array) -> Estimate:
    """Median and 90 % interval of a number over all parts, whose distributions are normal."""
    means, spreads, weights = [], [], []
    for one, weight in each:
        level, by = ends(one.law)
        at = np.broadcast_to(by[:, None, None], weight.shape)
        mean = level * nominal + level * one.mean[0] + at * one.mean[1]
        # A level is as uncertain as what its sessions have in common; so is a step from or to nothing, where
        # a fit at its bound does not show it. A step from level to level is not.
        moved = level if one.law.levelled else at != 0.0
        cover = level**2 * one.cover[0] + moved * common[None, :, None]
        cover = cover + 2.0 * level * at * one.cover[1] + at**2 * one.cover[2]
        keep = weight > NEGLIGIBLE * weight.max()
        means.append(np.broadcast_to(mean, weight.shape)[keep])
        spreads.append(np.sqrt(np.maximum(np.broadcast_to(cover, weight.shape)[keep], 0.0)))
        weights.append(weight[keep])
    return quantiles(np.concatenate(means), np.concatenate(spreads), np.concatenate(weights))


HALVINGS, NOTHING = 40, 1e-8
"""Steps to a quantile, and what of the largest number is not told from zero by them."""


def quantiles(means: Array, spreads: Array, weights: Array) -> Estimate:
    """Median and 90 % interval of a mixture of normal distributions, each argument (n,)."""
    from scipy.special import ndtr

    weights = weights / weights.sum()
    reach = 5.0 * spreads
    wanted = np.array([0.5, 0.05, 0.95])
    low, high = (np.full(3, edge) for edge in (float((means - reach).min()), float((means + reach).max())))
    safe = np.where(spreads > 0, spreads, 1e-300)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = ndtr((middle[:, None] - means) / safe) @ weights
        low, high = np.where(below < wanted, middle, low), np.where(below < wanted, high, middle)
    found = 0.5 * (low + high)
    scale = float(np.max(np.abs(means) + spreads))
    value, least, most = map(float, np.where(np.abs(found) < NOTHING * scale, 0.0, found))
    return Estimate(value, least, most)


def _of_grid(grid: Array, weights: Array) -> Estimate:
    order = np.argsort(grid)
    below = np.cumsum(weights[order]) / weights.sum()
    at = [float(grid[order][min(int(np.searchsorted(below, p)), len(grid) - 1)]) for p in (0.5, 0.05, 0.95)]
    return Estimate(*at)

"""``python -m tests.hidden.sweep.calibrate``: from trials of the population to the table of probabilities.

Nothing is simulated. The table is read by the diagnosis, the page tells how far it holds: each trial is
judged by a table that was fitted to others.
"""

from __future__ import annotations

import json
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.optimize import minimize

from fingerlab.diagnosis.score.calibration import (
    CalibrationTable,
    Odds,
    ProbabilityMap,
    SessionFeature,
    Verdict,
    answer_distances,
    calibrated,
    calibration,
    groups_of,
)
from fingerlab.effects import find_effect
from fingerlab.sessions.model import Array
from tests.hidden.sweep.surroundings import KINDS
from tests.hidden.sweep.table import BINS, kept_by_hand, markdown_table

COVERED = 0.95
BORROWED = 40.0
"""Trials' worth of the next wider group that every group's distances are completed by: of 20 trials of one
effect the 19th bounds 95 %, and a single trial moves it. With 40 the sets of two tables, each fitted to
trials that the other was not, are as wide as each other; with 10 and 20 they were not."""
NOTHING, UNKNOWN = Verdict.NOTHING_MISSING, Verdict.NOT_IN_CATALOGUE
OUTCOMES = {NOTHING: "Nothing missing", UNKNOWN: "Outside the catalogue"}
POPULATION = (
    "simulated benches of two engines: size over three decades, tolerances, noise, rates, length and number "
    "of runs, four protocols, a third of them dirty; a fifth with nothing missing"
)


@dataclass(frozen=True)
class KnownTrial:
    """A trial as the calibration sees it: what was true, the odds, and the session.

    ``weight``: how much it counts, one on average (:func:`weighed`).
    """

    seed: int
    source: str
    truth: tuple[str, ...]
    odds: Odds
    session: dict[str, float]
    phases: str
    dirty: bool
    verdict: str
    weight: float = 1.0

    @property
    def kind(self) -> str:
        """Family of the truth, or the answer that is no effect."""
        return family(self.truth[0]) if len(self.truth) == 1 else "Two effects"

    @property
    def drawn_as(self) -> str:
        """What the population drew: a key of ``DRAWN``."""
        if len(self.truth) > 1:
            return "pairs"
        return {NOTHING: "nothing", UNKNOWN: "outside"}.get(self.truth[0], "one")

    @cached_property
    def places(self) -> list[int]:
        """Where the truth stands among the answers; an effect that was not even tried stands nowhere."""
        answers = self.odds.answers
        return [answers.index(name) for name in self.truth if name in answers]


DRAWN = {"one": 1.0 - sum(KINDS.values()), **KINDS}
"""Share of the benches that are drawn of each kind."""


def weighed(trials: Sequence[KnownTrial]) -> list[KnownTrial]:
    """The trials with weights under which every kind of bench counts as often as it is drawn.

    By chance some hundreds of trials hold half again as many benches of one kind as others do, and what is
    told of all of them would follow (post-stratification).
    """
    counted = Counter(one.drawn_as for one in trials)
    drawn = sum(DRAWN[kind] for kind in counted)
    return [
        replace(one, weight=DRAWN[one.drawn_as] / drawn * len(trials) / counted[one.drawn_as])
        for one in trials
    ]


def family(answer: str) -> str:
    """The group in which a truth is counted."""
    effect = find_effect(answer)
    return OUTCOMES[answer] if effect is None else effect.family


def read(results: Path) -> tuple[list[KnownTrial], int]:
    """The trials of a population with their weights, and how many more failed.

    An effect of the contact is none of a bench whose chosen runs never touch the load cell: it was not asked.
    """
    found, failed = [], 0
    for line in results.read_text(encoding="utf-8").splitlines():
        entry = json.loads(line)
        trial = entry["trial"]
        if not trial["varied"]:
            continue
        if "odds" not in entry:
            failed += 1
            continue
        odds = entry["odds"]
        truth = tuple(one for one in trial["effects"] if _acts(one, entry["phases"])) or (NOTHING,)
        found.append(
            KnownTrial(
                trial["seed"], trial["source"], (UNKNOWN,) if trial["left_out"] else truth,
                Odds(
                    tuple(odds["effects"]), np.array(odds["found"]), np.array(odds["hidden"]),
                    odds["nothing"], odds["unknown"], ruled_out=tuple(odds.get("ruled_out", ())),
                ),
                entry["session"], entry["phases"], bool(entry["surroundings"]["dirt"]), entry["verdict"],
            )
        )  # fmt: skip
    return weighed(sorted(found, key=lambda one: one.seed)), failed


def _acts(name: str, phases: str) -> bool:
    """Whether an effect acts in some of the runs, whose phases are told together."""
    effect = find_effect(name)
    return effect is None or not effect.phases or any(phase in phases for phase in effect.phases)


FREE: dict[str, tuple[Callable[[float], float], float, float]] = {
    "verdict": (math.exp, math.log(0.5), 1.0),
    "nothing_offset": (float, 0.0, 1.5),
    "unknown_offset": (float, 0.0, 1.5),
    "uninformative_verdict": (float, -4.5, 1.0),
    "uninformative_verdict_slope": (float, 1.5, 1.0),
    "effect": (math.exp, math.log(0.7), 0.7),
    "sharpness_uninformative": (lambda x: 0.3 / (1.0 + math.exp(-x)), 0.0, 1.0),
    "uninformative_effect": (float, -4.0, 1.0),
    "uninformative_effect_slope": (float, 1.5, 1.0),
    "hidden": (float, 0.0, 1.5),
}
"""Values of the map that are fitted: from the whole line to each; there the prior's middle and spread."""


def fit_map(trials: Sequence[KnownTrial]) -> ProbabilityMap:
    """The map under which what was true is likeliest, with a weak prior on its values."""
    counts = np.array([1.0, 1.0, 1.0])
    for one in trials:
        counts[{NOTHING: 1, UNKNOWN: 2}.get(one.truth[0], 0)] += one.weight
    placed = [one for one in trials if one.places]
    weights = np.array([one.weight for one in placed])
    start = ProbabilityMap(base_rates=tuple((counts / counts.sum()).tolist()))

    def made(free: Array) -> ProbabilityMap:
        told = zip(FREE.items(), free, strict=True)
        return replace(start, **{name: to(float(x)) for (name, (to, *_)), x in told})

    def cost(free: Array) -> float:
        by = made(free)
        likely = [
            by.probabilities(one.odds, one.session.get("left", 1.0))[one.places].sum() for one in placed
        ]
        prior = sum(((x - m) / s) ** 2 for x, (_, m, s) in zip(free, FREE.values(), strict=True))
        return float(-weights @ np.log(np.maximum(likely, 1e-6)) + 0.5 * prior)

    begin = np.array([middle for _, middle, _ in FREE.values()])
    return made(minimize(cost, begin, method="L-BFGS-B", options={"maxiter": 60}).x)


FEATURES = {
    "runs": ("number of runs", ""),
    "seconds": ("length of a run", "s"),
    "rate": ("samples a second", "Hz"),
    "floor": ("noise of the worst equation against its signal", ""),
    "score": ("error of the model as given", "floors"),
    "left": ("error that is left in the end", "floors"),
}


def fit_features(trials: Sequence[KnownTrial]) -> tuple[dict[str, SessionFeature], tuple[float, ...]]:
    """How the sessions lie, and how far out the furthest feature of each is."""
    found = {}
    for name, (title, unit) in FEATURES.items():
        values = np.log([one.session[name] for one in trials if name in one.session])
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        found[name] = SessionFeature(
            title, unit, float(middle), float(max(0.5 * (high - low), 0.05)), math.exp(low), math.exp(high)
        )
    far = [
        max(
            abs(math.log(v) - found[n].middle) / found[n].spread for n, v in one.session.items() if n in found
        )
        for one in trials
    ]
    return found, tuple(np.quantile(far, np.linspace(0.0, 1.0, 41)).tolist())


def fit_thresholds(trials: Sequence[KnownTrial], table: CalibrationTable) -> dict[str, float]:
    """Log odds down to which an answer is in the set, by the names of ``groups_of``.

    Every group's distances are completed by those of the next wider one, which count as ``BORROWED`` trials.
    """
    own: dict[str, list[tuple[float, float]]] = defaultdict(list)
    chains = set()
    for one in trials:
        if not one.places:
            continue
        behind = float(distances(one, table)[one.places].min())
        for chain in (groups_of(one.verdict, true) for true in one.truth):
            chains |= {chain[k:] for k in range(len(chain))}
        for name in {group for true in one.truth for group in groups_of(one.verdict, true)}:
            own[name].append((behind, one.weight))
    return {"any": 3.0, **{chain[0]: bound(*_completed(own, chain).T) for chain in sorted(chains)}}


def _completed(own: Mapping[str, Sequence[tuple[float, float]]], chain: Sequence[str]) -> Array:
    """Distances and weights of a group and of the wider ones in which it lies, (n, 2)."""
    found = np.array(own[chain[0]])
    if len(chain) == 1:
        return found
    wider = _completed(own, chain[1:]).copy()
    wider[:, 1] *= BORROWED / max(wider[:, 1].sum(), BORROWED)
    return np.concatenate((found, wider))


def bound(values: Array, weights: Array) -> float:
    """Split conformal: not exceeded by a new value in 95 % of such draws.

    Args:
        values: (n,). weights: how many trials each counts for, (n,).
    """
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    place = int(np.searchsorted(reached, (reached[-1] + 1.0) * COVERED - 1e-9))
    return float(values[order[min(place, len(values) - 1)]])


def distances(one: KnownTrial, table: CalibrationTable) -> Array:
    return answer_distances(calibrated(one.odds, one.verdict, one.session, one.phases, table)[0])


def fit_table(trials: Sequence[KnownTrial], version: str) -> CalibrationTable:
    """Map, features and thresholds of the trials; error and coverage are not known yet."""
    features, typicality_quantiles = fit_features(trials)
    counted: dict[str, float] = defaultdict(float)
    for one in trials:
        counted[one.phases] += 1.0 / len(trials)
    table = CalibrationTable(
        version, len(trials), 0, POPULATION, fit_map(trials), {"any": 3.0}, features, typicality_quantiles,
        dict(sorted(counted.items())), 0.0, 0.0,
    )  # fmt: skip
    return replace(table, thresholds=fit_thresholds(trials, table))


@dataclass(frozen=True)
class Answered:
    """What a table says of a trial: the first answer with its probability, and the set."""

    trial: KnownTrial
    first: str
    probability: float
    set: tuple[str, ...]
    typicality: float

    @property
    def weight(self) -> float:
        return self.trial.weight

    @property
    def right(self) -> bool:
        return self.first in self.trial.truth

    @property
    def covered(self) -> bool:
        return bool(set(self.set) & set(self.trial.truth))


def answer(one: KnownTrial, table: CalibrationTable | None) -> Answered:
    """By a table; None: as the odds stand, without one."""
    odds = one.odds
    if table is None:
        told = np.array([*(odds.found + odds.hidden), odds.nothing, odds.unknown])
        kept = tuple(n for n, d in zip(odds.answers, answer_distances(told), strict=True) if d <= 3.0)
        typical = 1.0
    else:
        told, said = calibrated(odds, one.verdict, one.session, one.phases, table)
        kept, typical = said.cannot_be_ruled_out, said.typicality
    best = int(np.argmax(told))
    return Answered(one, odds.answers[best], float(told[best]), kept, typical)


def answers(trials: Sequence[KnownTrial], table: CalibrationTable | None) -> list[Answered]:
    return [answer(one, table) for one in trials]


def calibration_error(said: Sequence[Answered]) -> float:
    """Expected calibration error over ``BINS``: mean distance of what was told and what share was right."""
    total = 0.0
    for low, high in BINS:
        inside = [a for a in said if low <= a.probability < high]
        if inside:
            missed = _mean(inside, lambda a: a.probability) - _mean(inside, lambda a: a.right)
            total += abs(missed) * sum(a.weight for a in inside)
    return total / max(sum(a.weight for a in said), 1e-9)


def _mean(said: Sequence[Answered], value: Callable[[Answered], float]) -> float:
    """Weighted mean; nan of none."""
    if not said:
        return math.nan
    return float(np.average([value(a) for a in said], weights=[a.weight for a in said]))


def _percent(said: Sequence[Answered], holds: Callable[[Answered], bool]) -> str:
    return f"{100 * _mean(said, holds):.0f} % of {len(said)}" if said else "-"


FOLDS = 4


def judged_by_others(trials: Sequence[KnownTrial], version: str) -> list[Answered]:
    """What is said of each trial by a table that was fitted to the trials of the other folds, by seed."""
    said = []
    for fold in range(FOLDS):
        table = fit_table([t for t in trials if t.seed % FOLDS != fold], version)
        said += [answer(t, table) for t in trials if t.seed % FOLDS == fold]
    return said


def page(
    trials: Sequence[KnownTrial],
    failed: int,
    said: Sequence[Answered],
    table: CalibrationTable,
    command: str,
    before: str,
) -> str:
    """The committed page.

    Args:
        failed: trials that no diagnosis could be made of. said: of each trial by a table not fitted to it.
    """
    columns = {
        "without calibration": answers(trials, None),
        "calibrated": list(said),
        "twin": [a for a in said if a.trial.source == "twin"],
        "second engine": [a for a in said if a.trial.source == "engine"],
        "clean": [a for a in said if not a.trial.dirty],
        "dirty": [a for a in said if a.trial.dirty],
    }
    lines = [
        "# Probabilities and sets that hold their word", "",
        f"Made by `{command}` from trials of `python -m tests.hidden.sweep --kind population`.",
        f"Table {table.version} is fitted to {table.fitted} trials; {failed} more could not be diagnosed.",
        "What stands here of a trial was said by a table that was fitted to the",
        f"other {FOLDS - 1} of {FOLDS} folds by seed: nothing is judged that was fitted to.",
        f"The trials are {POPULATION}.",
        WEIGHED, "",
        *kept_by_hand(before), "",
        *markdown_table(_summary(columns)), "",
        "## What was told, and how much of it was right", "",
        *markdown_table(_reliability(columns["without calibration"], said)), "",
        "## Sets by what was true", "", *markdown_table(_by_kind(said, table)), "",
        "## The map", "",
        *markdown_table([["value", ""], *([k, _plain(v)] for k, v in asdict(table.map).items())]), "",
        "## What is usual", "",
        *markdown_table(
            [["of a session", "nine in ten between"]]
            + [[f.title, f"{f.low:.3g} and {f.high:.3g} {f.unit}".strip()] for f in table.features.values()]
        ),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


WEIGHED = (
    "Shares are weighted so that benches with nothing missing, one effect, two, and one that the catalogue "
    "is without count as often as they are drawn: "
    + ", ".join(f"{100 * DRAWN[kind]:.0f}" for kind in ("nothing", "one", "pairs", "outside"))
    + " %."
)
JUDGED = "## On seeds that nothing was fitted to"


def judged(trials: Sequence[KnownTrial], failed: int, table: CalibrationTable, command: str) -> str:
    """The section of the page that tells how a table does on trials that it has never seen."""
    said = answers(trials, table)
    seeds = sorted(t.seed for t in trials)
    columns = {
        "all": said,
        "twin": [a for a in said if a.trial.source == "twin"],
        "second engine": [a for a in said if a.trial.source == "engine"],
        "clean": [a for a in said if not a.trial.dirty],
        "dirty": [a for a in said if a.trial.dirty],
    }
    lines = [
        JUDGED, "",
        f"Made by `{command} --judge` from {len(trials)} further trials, seeds {seeds[0]} to {seeds[-1]};",
        f"{failed} more could not be diagnosed. What is told of each is told by table {table.version} as it",
        f"stands in the program. {WEIGHED}", "",
        *markdown_table(_summary(columns)), "",
        *markdown_table(_reliability(answers(trials, None), said)), "",
        *markdown_table(_by_kind(said, table)),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _plain(value: Any) -> str:
    return ", ".join(f"{v:.3f}" for v in value) if isinstance(value, tuple) else f"{value:.3f}"


def _summary(columns: dict[str, list[Answered]]) -> list[list[str]]:
    figures: dict[str, Callable[[list[Answered]], str]] = {
        "trials": lambda a: str(len(a)),
        "first answer right": lambda a: _percent(a, lambda x: x.right),
        "expected calibration error": lambda a: f"{calibration_error(a):.3f}",
        "log loss of the first answer": lambda a: f"{_log_loss(a):.3f}",
        "truth in the set": lambda a: _percent(a, lambda x: x.covered),
        "one answer in the set": lambda a: _percent(a, lambda x: len(x.set) == 1),
        "answers in the set, median; mean": lambda a: (
            f"{np.median([len(x.set) for x in a]):g}; {_mean(a, lambda x: len(x.set)):.1f}" if a else "-"
        ),
        "verdict of a missing effect: effects in the set, median; one alone": _effects_in_sets,
        "nothing missing: told otherwise": lambda a: _percent(
            [x for x in a if x.trial.kind == OUTCOMES[NOTHING]], lambda x: x.trial.verdict != NOTHING
        ),
        "sessions called unusual": lambda a: _percent(a, lambda x: x.typicality < 0.05),
    }
    rows = [["", *columns]]
    return rows + [[name, *(tell(group) for group in columns.values())] for name, tell in figures.items()]


def _effects_in_sets(said: list[Answered]) -> str:
    missing = [a for a in said if a.trial.verdict == "missing_effect"]

    def effects(a: Answered) -> int:
        return sum(find_effect(name) is not None for name in a.set)

    middle = np.median([effects(a) for a in missing]) if missing else math.nan
    return f"{middle:g}; {_percent(missing, lambda a: effects(a) <= 1)}" if missing else "-"


def _log_loss(said: Sequence[Answered]) -> float:
    return -_mean(said, lambda a: math.log(max(a.probability if a.right else 1.0 - a.probability, 1e-6)))


def _reliability(raw: Sequence[Answered], after: Sequence[Answered]) -> list[list[str]]:
    rows = [["told between", "without calibration: told, right of", "calibrated: told, right of"]]
    for low, high in BINS:
        cells = []
        for said in (raw, after):
            inside = [a for a in said if low <= a.probability < high]
            told = f"{100 * _mean(inside, lambda a: a.probability):.1f} %, " if inside else ""
            cells.append(f"{told}{_percent(inside, lambda a: a.right)}")
        rows.append([f"{100 * low:g} and {min(100 * high, 100):g} %", *cells])
    return rows


def _by_kind(after: Sequence[Answered], table: CalibrationTable) -> list[list[str]]:
    rows = [["truth", "trials", "first right", "in the set", "size, median", "one alone"]]
    for name in sorted({a.trial.kind for a in after}):
        group = [a for a in after if a.trial.kind == name]
        rows.append(
            [
                name, str(len(group)),
                _percent(group, lambda a: a.right), _percent(group, lambda a: a.covered),
                f"{np.median([len(a.set) for a in group]):g}", _percent(group, lambda a: len(a.set) == 1),
            ]
        )  # fmt: skip
    return rows


@click.command()
@click.argument("results", type=click.Path(exists=True, path_type=Path))
@click.option("--table", type=click.Path(path_type=Path), help="Table, such as resources/calibration.json.")
@click.option("--page", "target", type=click.Path(path_type=Path), help="Page, such as docs/calibration.md.")
@click.option(
    "--judge",
    is_flag=True,
    help="Fit nothing: judge the program's table on these trials, and let it tell so.",
)
@click.option("--version", default="1", show_default=True)
@click.option("--command", default="python -m tests.hidden.sweep.calibrate", hidden=True)
def main(
    results: Path, table: Path | None, target: Path | None, judge: bool, version: str, command: str
) -> None:
    """Fit the map from odds to probabilities and the sets, and judge both on other trials."""
    trials, failed = read(results)
    if judge:
        known = calibration()
        text = judged(trials, failed, known, command)
        click.echo(text)
        if table is not None:
            said = answers(trials, known)
            write_table(table, with_figures(known, said))
        if target is not None:
            page_before = target.read_text(encoding="utf-8").split(JUDGED)[0].rstrip("\n")
            target.write_text(f"{page_before}\n\n{text}", encoding="utf-8")
        return
    said = judged_by_others(trials, version)
    made = with_figures(fit_table(trials, version), said)
    before = target.read_text(encoding="utf-8") if target is not None and target.exists() else ""
    text = page(trials, failed, said, made, command, before)
    click.echo(text)
    if table is not None:
        write_table(table, made)
    if target is not None:
        target.write_text(text, encoding="utf-8")


def with_figures(table: CalibrationTable, said: Sequence[Answered]) -> CalibrationTable:
    """The table with the figures of what it ``said`` of trials that it was not fitted to."""
    error, covered = calibration_error(said), _mean(said, lambda a: a.covered)
    return replace(table, judged=len(said), error=round(error, 4), coverage=round(covered, 4))


def write_table(path: Path, table: CalibrationTable) -> None:
    """The table as the program reads it."""
    path.write_text(json.dumps(_rounded(asdict(table)), indent=1) + "\n", encoding="utf-8")


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(v) for v in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()

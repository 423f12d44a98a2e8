"""``python -m tests.hidden.sweep.gains``: what proposed runs bring, against what was foretold of them.

Benches of the thesis' protocol with one effect each are diagnosed, every proposed run is recorded on its
bench, and both are diagnosed together. With ``--table`` the correction is fitted to that; with ``--page`` it
is told how well the program foretells, best on seeds that the table was not fitted to (``--fitted``).
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.progress import track
from scipy.optimize import minimize
from scipy.stats import norm
from threadpoolctl import threadpool_limits

from fingerlab.diagnosis.experiment.separation import GainCalibration, GainLine
from fingerlab.diagnosis.settings import DECIDING_LOG_ODDS
from fingerlab.sessions.model import Array
from fingerlab.twin.effects import EFFECTS
from tests.hidden.sweep.table import LITTLE, is_first, kept_by_hand, markdown_table, told_of_truth, well_told
from tests.hidden.sweep.trials import Trial

Entry = dict[str, Any]
STRIDE = 7
"""Seeds in a row take effects that stand so far apart in the catalogue."""
LEAST_ODDS = 1e-280
"""A probability below it is rounding, and what it lost cannot be told."""
POPULATION = "simulated benches of the thesis' protocol with one effect each, and the run that was proposed"


def trials(first: int, count: int) -> list[Trial]:
    """One bench a seed, with the effects in turn."""
    ids = list(EFFECTS)
    seeds = range(first, first + count)
    return [Trial("twin", "thesis", (ids[s * STRIDE % len(ids)],), s, proposed=True) for s in seeds]


def run(trial: Trial) -> Entry:
    """As ``running.run``, with every proposal taken, whatever the set holds."""
    from fingerlab.diagnosis import diagnose
    from fingerlab.sessions import open_session
    from tests.hidden.sweep.running import after, record, told

    with threadpool_limits(limits=1, user_api="blas"), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.h5"
        try:
            record(trial, path)
            said = diagnose([open_session(path)], with_curves=False)
            result = {"trial": asdict(trial), **told(trial, said)}
            return result if said.next_experiment is None else {**result, "after": after(trial, path, said)}
        except Exception as error:  # the sweep goes on, and the table counts it as wrong
            return {"trial": asdict(trial), "failed": f"{type(error).__name__}: {error}"}


def pairs(entry: Entry) -> Iterator[tuple[str, float, float]]:
    """Of a proposal whose predicted truth was the truth: kind of gain, predicted and achieved, nats."""
    follow, truth = entry.get("after", {}), entry["trial"]["effects"][0]
    predicted = (follow.get("predicted") or {}).get("gains", {}).get(truth, {})
    before, after = (_logs(odds) for odds in follow.get("odds", [{}, {}]))
    hidden = bool(predicted) and follow["predicted"]["verdict"] == "nothing_missing"
    among = "bench" if follow and follow["proposal"]["phase"] == "motor_bench" else "among"
    for rival, gain in predicted.items():
        last = after[truth] - after[rival]
        if rival == "nothing_missing":
            yield "shows", gain, float(follow["verdict"] == "missing_effect")
        elif hidden:
            if follow["verdict"] == "missing_effect":
                yield among, gain, last  # what was not seen was as likely as each other
        else:
            yield among, gain, last - (before[truth] - before[rival])


def _logs(odds: Entry) -> dict[str, float]:
    if not odds:
        return {}
    each = np.array(odds["found"]) + np.array(odds["hidden"])
    told = {**dict(zip(odds["effects"], each.tolist(), strict=True)), "nothing_missing": odds["nothing"]}
    return {name: math.log(max(value, LEAST_ODDS)) for name, value in told.items()}


def fit_line(found: Sequence[tuple[float, float]]) -> GainLine:
    """The line through predicted and achieved gains with least absolute errors, and the scatter about it.

    With a weak pull to "as predicted": ten trials' worth. Offset and scatter fade with the predicted gain.
    """
    predicted, achieved = (np.array(values) for values in zip(*found, strict=True))
    x, y = np.arcsinh(predicted), np.arcsinh(achieved)
    share = GainLine(0.0, 1.0, 0.0, 0, fades=True).share(predicted)

    def cost(line: Array) -> float:
        away = np.abs(y - line[0] * share - line[1] * x).sum()
        return float(away + 10.0 * (line[0] ** 2 / 2.0 + (line[1] - 1.0) ** 2))

    offset, slope = minimize(cost, np.array([0.0, 1.0]), method="Nelder-Mead").x
    away = np.abs(y - offset * share - slope * x) / np.maximum(share, 0.3)
    spread = float(np.median(away) / 0.6745)
    return GainLine(float(offset), float(max(slope, 0.1)), spread, len(x), fades=True)


def fit_shows(found: Sequence[tuple[float, float]]) -> GainLine:
    """When an effect that could not be seen is: offset and scatter under which what came is likeliest.

    With weak knowledge: an offset of 0 to one standard deviation, a scatter of 0.7 within a factor of two.
    """
    x, seen = np.arcsinh([p for p, _ in found]), np.array([s for _, s in found]) > 0.5
    limit = math.asinh(DECIDING_LOG_ODDS)

    def cost(free: Array) -> float:
        z = (x + free[0] - limit) / math.exp(free[1])
        prior = free[0] ** 2 + ((free[1] - math.log(0.7)) / math.log(2.0)) ** 2
        return float(0.5 * prior - norm.logcdf(np.where(seen, z, -z)).sum())

    offset, spread = minimize(cost, np.array([0.0, math.log(0.7)]), method="Nelder-Mead").x
    return GainLine(float(offset), 1.0, math.exp(float(spread)), len(x))


def fit_table(entries: Sequence[Entry], version: str) -> GainCalibration:
    """The correction that these proposals call for."""
    found = [one for entry in entries for one in pairs(entry)]
    among, bench = (
        fit_line([(p, g) for k, p, g in found if k == kind and p > 0.0]) for kind in ("among", "bench")
    )
    shows = fit_shows([(p, g) for k, p, g in found if k == "shows"])
    return GainCalibration(
        version, sum("after" in entry for entry in entries), POPULATION, among, bench, shows
    )


def _share(hits: Sequence[bool]) -> str:
    return f"{sum(hits)} of {len(hits)} ({100 * np.mean(hits):.0f} %)" if hits else "-"


def _alone(said: Entry, entry: Entry) -> bool:
    return list(said["set"]) == list(entry["trial"]["effects"])


def figures(entries: Sequence[Entry]) -> list[list[str]]:
    """What was measured, and the figure."""
    known = [e for e in entries if "failed" not in e]
    taken = [e for e in known if "after" in e]
    last = [(e.get("after", e), e) for e in known]
    told = [t for e in taken if (t := told_of_truth(e)) is not None]
    named = [t for e in taken if e["trial"]["effects"][0] in e["after"]["proposal"]["separates"]
             and (t := told_of_truth(e)) is not None]  # fmt: skip
    changed = [e for e in taken if "intervention" in e["after"]["proposal"]]
    ratios = [gained / foretold for foretold, gained in told if foretold > LITTLE]
    chances = [e["after"]["proposal"]["chance_alone"] for e in taken]
    mean = f"{100 * np.mean(chances):.0f} %" if chances else "-"
    rows = {
        "benches; diagnoses that failed": f"{len(entries)}; {len(entries) - len(known)}",
        "a run was proposed for": str(len(taken)),
        "... of them with a known change of the machine": str(len(changed)),
        "truth first before": _share([is_first(e, e["trial"]["effects"]) for e in known]),
        "truth first after one proposed run": _share([is_first(a, e["trial"]["effects"]) for a, e in last]),
        "truth in the set after it": _share([e["trial"]["effects"][0] in a["set"] for a, e in last]),
        "truth alone in the set before": _share([_alone(e, e) for e in known]),
        "truth alone in the set after it": _share([_alone(a, e) for a, e in last]),
        "... of those taken where it was not alone before": _share(
            [_alone(e["after"], e) for e in taken if not _alone(e, e)]
        ),
        "chance to stay alone, mean of those foretold": mean,
        "... and as it came": _share([_alone(e["after"], e) for e in taken]),
        "gain within a factor of two, of the two answers named": _share([well_told(*t) for t in named]),
        "gain within a factor of two, of every truth with one told": _share([well_told(*t) for t in told]),
        "gain over the one foretold, median": f"{np.median(ratios or [np.nan]):.2f}",
    }  # fmt: skip
    return [[name, value] for name, value in rows.items()]


def each(entries: Sequence[Entry]) -> list[list[str]]:
    """One line for each proposal."""
    rows = [
        ["seed", "effect", "set before", "proposed", "foretold", "gained", "alone, foretold", "set after"]
    ]
    for e in entries:
        if "after" not in e:
            continue
        a, p, told = e["after"], e["after"]["proposal"], told_of_truth(e)
        rows.append([
            str(e["trial"]["seed"]), e["trial"]["effects"][0], str(len(e["set"])), _what(p),
            "-" if told is None else f"{told[0]:.1f}", "-" if told is None else f"{told[1]:.1f}",
            f"{100 * p['chance_alone']:.0f} %", ", ".join(a["set"]) or a["verdict"],
        ])  # fmt: skip
    return rows


def _what(proposal: Entry) -> str:
    """A proposed run in a cell."""
    words = [proposal["phase"], proposal["cable"], proposal["trajectory"]["kind"]]
    changes = ", ".join(proposal.get("intervention", {}))
    return " ".join(words) + (f" ({changes})" if changes else "")


def page(entries: Sequence[Entry], table: GainCalibration, command: str, before: str) -> str:
    """The committed page."""
    lines = [
        "# Proposed runs, and what was foretold of them", "",
        f"Made by `{command}`, on seeds that table {table.version} was not fitted to.", "",
        *kept_by_hand(before), "", *markdown_table([["what", "figure"], *figures(entries)]), "",
        "## The correction", "",
        f"Table {table.version} is fitted to {table.fitted} proposals: {table.population}.",
        "With x and y the inverse hyperbolic sines of the predicted and of the achieved gain in nats,",
        "y = offset + slope x.", "",
        *markdown_table([
            ["gain", "offset", "slope", "scatter", "gains"],
            *([name, f"{line.offset:.2f}", f"{line.slope:.2f}", f"{line.spread:.2f}", str(line.trials)]
              for name, line in (("among effects", table.among), ("... of the motor alone", table.bench),
                                 ("shows what was hidden", table.shows))),
        ]), "",
        "## Every proposal", "", *markdown_table(each(entries)),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def read(path: Path) -> dict[str, Entry]:
    """Results so far, by the trial's key."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {json.dumps(entry["trial"], sort_keys=True): entry for entry in map(json.loads, lines)}


@click.command()
@click.option("--first", default=7101, show_default=True, help="First seed.")
@click.option("--count", default=60, show_default=True, help="Benches.")
@click.option("--jobs", default=-1, show_default=True, help="Processes; -1 is one for each core.")
@click.option("--results", default="foretold.jsonl", type=click.Path(path_type=Path), show_default=True)
@click.option("--table", type=click.Path(path_type=Path), help="Fit a table to them, and to --also.")
@click.option("--also", multiple=True, type=click.Path(path_type=Path, exists=True), help="More results.")
@click.option("--page", "target", type=click.Path(path_type=Path), help="Page, such as docs/foretold.md.")
@click.option("--version", default="1", show_default=True)
@click.option("--command", default="python -m tests.hidden.sweep.gains", hidden=True)
def main(
    first: int, count: int, jobs: int, results: Path, table: Path | None, also: tuple[Path, ...],
    target: Path | None, version: str, command: str,
) -> None:  # fmt: skip
    """Take proposed runs on simulated benches; fit what comes of them, or tell how well it was foretold."""
    from fingerlab.diagnosis.experiment.separation import gain_calibration

    wanted, known = trials(first, count), read(results)
    left = [t for t in wanted if t.key not in known]
    with results.open("a", encoding="utf-8") as file:
        work = Parallel(n_jobs=jobs, return_as="generator_unordered")(delayed(run)(t) for t in left)
        for entry in track(work, "Proposals", total=len(left), console=Console(stderr=True)):
            file.write(json.dumps(entry) + "\n")
            file.flush()
    known = read(results)
    entries = [known[t.key] for t in wanted]
    for row in figures(entries):
        click.echo(": ".join(row))
    if table is not None:
        more = [entry for path in also for entry in read(path).values()]
        made = asdict(fit_table([*entries, *more], version))
        table.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    if target is not None:
        before = target.read_text(encoding="utf-8") if target.exists() else ""
        target.write_text(page(entries, gain_calibration(), command, before), encoding="utf-8")


if __name__ == "__main__":
    main()

"""``python -m tests.hidden.changes``: benches that change from session to session; what is told of them.

Numbers with errors are drawn by the hundred; simulated benches are recorded and diagnosed session by session,
and their rows go to a JSON-lines file as they come. The page is made of both.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from operator import itemgetter
from pathlib import Path
from typing import Any

import click
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from fingerlab.batch.benches import shared_effects, two_groups
from fingerlab.batch.changes import NumberCourse, courses
from fingerlab.batch.settings import STEPS
from tests.hidden.changing_benches import (
    KINDS,
    Changing,
    Plan,
    drawn,
    drawn_pair,
    plans,
    simulated,
    simulated_pairs,
    units_of_bench,
)
from tests.hidden.kept import KeptResults

PAGE = Path("docs/changes-over-time.md")
Entry = dict[str, Any]
COUNTS = (6, 7, 8)
"""Sessions of a sequence, in turn."""
FEW = (3, 4)
BANDS = (("3 to 6", 3.0, 6.0), ("6 to 12", 6.0, 12.0), ("12 to 30", 12.0, 31.0))
"""Sizes of a change, in standard deviations by which sessions scatter."""
STEADY = 4
"""So many times as many sequences in which nothing changes, for a false alarm is rare."""
PAIRS = ("same", "differs", "first", "second")


def judged(case: Changing) -> Entry:
    """What is told of a sequence, beside what was done to it."""
    told = [one for one in courses(case.rows, case.units) if not one.leans_on]
    top = max(told, key=lambda one: 1.0 - one.course.chances["steady"])
    course = top.course
    changes = {kind: p for kind, p in course.chances.items() if kind != "steady"}
    return {
        "kind": case.kind,
        "place": case.place,
        "sessions": len(case.rows),
        "certain": case.certain,
        "end": case.kind in (*STEPS, "odd") and _at_end(case),
        "right": _is_it(top, case),
        "first": max(changes, key=lambda kind: changes[kind]),
        "told": course.verdict,
        "chance": course.certain,
        "at": course.place,
        "covered": course.size.low <= case.size <= course.size.high,
        "alarms": [one.course.verdict for one in told if one.course.verdict not in ("steady", "open")],
    }


def _at_end(case: Changing) -> bool:
    last = len(case.rows) - 1
    return case.place in ((0, last) if case.kind == "odd" else (1, last))


def _is_it(top: NumberCourse, case: Changing) -> bool:
    """Whether the number that stands out is the one that changed, or another of the same effect."""
    if case.column.count(".") < 2:
        return top.column.partition("@")[0].startswith(case.column.partition("@")[0] or "nothing")
    return top.effect == case.column.split(".")[1]


def figures(entries: Sequence[Entry]) -> Iterator[tuple[str, str]]:
    """What is told of sequences of enough sessions."""
    changed = [e for e in entries if e["kind"] != "nothing"]
    steady = [e for e in entries if e["kind"] == "nothing" and not e.get("rough")]
    rough = [e for e in entries if e.get("rough")]
    inside = [e for e in changed if not e["end"]]
    large = [e for e in inside if e["certain"] >= 6.0]
    named = [e for e in inside if e["right"] and e["told"] == e["kind"]]
    spoke = [e for e in changed if e["told"] not in ("steady", "open")]
    steps = [e for e in inside if e["right"] and e["kind"] in STEPS]
    yield "nothing changed: a change is told (false alarm)", share(bool(e["alarms"]) for e in steady)
    yield "... where sessions scatter with far tails", share(bool(e["alarms"]) for e in rough)
    yield "changed: the right number stands out most", share(e["right"] for e in inside)
    yield "... and its kind is named first", share(e["right"] and e["first"] == e["kind"] for e in inside)
    yield (
        "... of changes of six scatters or more",
        share(e["right"] and e["first"] == e["kind"] for e in large),
    )
    yield "told, likelier than all else together", share(e["told"] not in ("steady", "open") for e in inside)
    yield (
        "... of changes of six scatters or more",
        share(e["told"] not in ("steady", "open") for e in large),
    )
    yield "told: right number and kind", share(e["right"] and e["told"] == e["kind"] for e in spoke)
    yield "step found: its moment within one session", share(abs(e["at"] - e["place"]) <= 1 for e in steps)
    yield "... exactly", share(e["at"] == e["place"] for e in steps)
    yield "told rightly: the size is in its 90 % interval", share(e["covered"] for e in named)
    ends = [e for e in changed if e["end"]]
    yield (
        "the first or last session alone is otherwise: said that it cannot be told",
        share(e["told"] in ("steady", "open") for e in ends),
    )


def share(hits: Iterable[bool]) -> str:
    every = list(hits)
    return f"{sum(every)} of {len(every)} ({100 * sum(every) / len(every):.0f} %)" if every else "-"


def by_kind(entries: Sequence[Entry]) -> Iterator[list[str]]:
    """A row for every kind and band of sizes: trials, named first, told and right, cannot be told, wrong."""
    for kind in KINDS[1:]:
        for title, least, most in BANDS:
            part = [e for e in entries if e["kind"] == kind and least <= e["certain"] < most and not e["end"]]
            right = [e for e in part if e["right"]]
            yield [
                kind.replace("_", " "), title, str(len(part)),
                share(e["first"] == kind for e in right) if right else "-",
                str(sum(e["told"] == kind for e in right)),
                str(sum(e["told"] in ("steady", "open") for e in part)),
                str(sum(e["told"] not in ("steady", "open") and not (e["right"] and e["told"] == kind)
                        for e in part)),
            ]  # fmt: skip


def promised(entries: Sequence[Entry]) -> Iterator[list[str]]:
    """Of what is told with a probability between two bounds: how often it is right."""
    spoke = [e for e in entries if e["told"] not in ("steady", "open")]
    for low, high in ((0.5, 0.7), (0.7, 0.9), (0.9, 0.99), (0.99, 1.01)):
        part = [e for e in spoke if low <= e["chance"] < high]
        yield [f"{100 * low:.0f} to {min(100 * high, 100):.0f} %",
               share(e["right"] and e["told"] == e["kind"] for e in part)]  # fmt: skip


def judged_pair(kind: str, seed: int, count: int) -> Entry:
    """What is told of an effect on two drawn benches."""
    first, second, effect = drawn_pair(kind, seed, count)
    return _shared([*first, *second], effect, kind, units_of_bench())


def _shared(rows: Sequence[Entry], effect: str, kind: str, units: dict[str, str]) -> Entry:
    told = {one.effect: one for one in shared_effects(*two_groups(rows, "left", "right"), units)}
    one = told.get(effect)
    chances = {} if one is None else dict(one.chances)
    best = max(chances, key=lambda name: chances[name]) if chances else "none"
    others = [name for name, x in told.items() if name != effect and x.likeliest in ("same", "differs")]
    return {"kind": kind, "effect": effect, "told": best, "chance": chances.get(best, 0.0), "others": others}


def sequence_entry(plan: Plan, seed: int) -> Entry:
    """A simulated sequence, recorded and diagnosed; its rows are kept."""
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(limits=1, user_api="blas"):
        rows = simulated(plan, seed, Path(folder))
    return {"what": "sequence", "seed": seed, "plan": asdict(plan), "rows": rows}


def pair_entry(kind: str, effect: str, seed: int) -> Entry:
    """Two simulated benches, recorded and diagnosed."""
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(limits=1, user_api="blas"):
        rows = simulated_pairs(kind, effect, seed, Path(folder))
    return {"what": "pair", "seed": seed, "kind": kind, "effect": effect, "rows": rows}


def case_of(entry: Entry) -> Changing:
    """The sequence of an entry, with its size where the plan tells it in the table's unit."""
    plan, rows = entry["plan"], entry["rows"]
    units: dict[str, str] = {}
    for row in rows:
        units |= row.get("units", {})
    column = f"param.{plan['effect']}.x" if plan["effect"] else "param.arm" if plan["arms"] else ""
    column = "" if plan["kind"] == "nothing" else column
    plain = [{key: value for key, value in row.items() if key != "units"} for row in rows]
    return Changing(plan["kind"], tuple(plain), units, column, plan["place"])


ABOUT = """
Benches whose sessions are taken in order, of which one number changes, or none. What is told is that of
`fingerlab batch`: for each number the probability that it stayed, changed at one moment (a step, an effect
that is new, an effect that is gone), wears, settles, warms up in each sitting, or that one session alone went
wrong ([how](theory.md#what-became-of-a-bench)). The seeds are none that a number of
`fingerlab/batch/settings.py` was looked at with.

"""


SHORT = """
What falls short:

- The drawn numbers have errors as the laws take them to be; those with far tails are the exception. Real
  benches have errors that nobody has drawn.
- One thing changes in a sequence. Two changes of one number have no law; the likelier one is told, or none.
- Strengths of the simulated sequences lie far above what their sessions scatter by (0.25 to 1.2 times the
  default strength of the effect); the moment arms change by 1.5 to 7 %, near what can be told.
- Where there are two sittings alone, what grows by days and a step in the pause are the same numbers, and so
  are a step after the first session and one that went wrong. Then it is said that it cannot be told.
- Two benches are compared by all of their sessions: one that changed meanwhile counts with its mean.
- An effect is followed by its gains. What it has beside them (a travel, a time constant) is not, and of an
  effect without a gain (a slack cable) only the sessions that have it are counted.
"""


def markdown(drawn_: Sequence[Entry], few: Sequence[Entry], pairs: Sequence[Entry], benches: Sequence[Entry],
             command: str) -> str:  # fmt: skip
    """The page."""
    lines = ["# Changes over time", "", f"Made by `{command}`.", ABOUT.rstrip(), ""]
    lines += [
        "## Numbers with errors", "",
        f"{len(drawn_):,} sequences of 6 to 8 sessions of a bench with ten numbers, drawn with errors: each "
        "session's own, what all of a bench have in common, and a scatter between sessions. The change has 3 "
        "to 30 standard deviations by which sessions scatter. Told is what is likelier than all else.", "",
        *_table(["what", "figure"], [[what, figure] for what, figure in figures(drawn_)]), "",
        "By kind and size; where the first or the last session alone is otherwise, a step and a session that "
        "went wrong are the same numbers, and it is left out here:", "",
        *_table(["kind", "size, scatters", "sequences", "right number: kind first", "told rightly",
                 "cannot be told", "told wrongly"], list(by_kind(drawn_))), "",
        "How often what is told is right, all kinds and sizes together:", "",
        *_table(["told with", "right"], list(promised(drawn_))), "",
        f"With three or four sessions ({len(few)} sequences):", "",
        *_table(["what", "figure"], [
            ["nothing changed: a change is told (false alarm)",
             share(bool(e["alarms"]) for e in few if e["kind"] == "nothing")],
            ["changed: said that it cannot be told",
             share(e["told"] in ("steady", "open") for e in few if e["kind"] != "nothing")],
            ["told: right number and kind",
             share(e["right"] and e["told"] == e["kind"] for e in few
                   if e["kind"] != "nothing" and e["told"] not in ("steady", "open"))],
        ]), "",
        f"Effects on two benches of 3 to 6 sessions each ({len(pairs)} pairs):", "",
        *_pairs_table(pairs), "",
    ]  # fmt: skip
    return "\n".join([*lines, *_simulated_part(benches), SHORT.rstrip()]) + "\n"


def _pairs_table(pairs: Sequence[Entry]) -> list[str]:
    rows = []
    for kind in PAIRS:
        part = [e for e in pairs if e["kind"] == kind]
        sure = [e for e in part if e["chance"] >= 0.5]
        rows.append([kind, str(len(part)), share(e["told"] == kind for e in part),
                     share(e["told"] == kind for e in sure)])  # fmt: skip
    return _table(["on", "pairs", "likeliest", "right of those told with 50 % or more"], rows)


def _simulated_part(benches: Sequence[Entry]) -> list[str]:
    rows, pairs = [], []
    for entry in benches:
        if entry["what"] == "pair":
            found = _shared(entry["rows"], entry["effect"], entry["kind"], {})
            said = f"{found['told']} ({found['chance']:.2f})"
            others = ", ".join(found["others"]) or "-"
            pairs.append([str(entry["seed"]), entry["effect"], entry["kind"], said, others])
            continue
        case = case_of(entry)
        told, plan = judged(case), entry["plan"]
        what = plan["effect"] or ("moment arms" if case.kind != "nothing" else "-")
        place = str(plan["place"]) if plan["place"] >= 0 and case.kind != "nothing" else "-"
        right = "-" if case.kind == "nothing" else "yes" if told["right"] else "no"
        rows.append([
            str(entry["seed"]), str(told["sessions"]), case.kind.replace("_", " "), what, place,
            f"{told['told']} ({told['chance']:.2f})", right,
            str(told["at"]) if told["told"] in STEPS else "-", "; ".join(told["alarms"]) or "-",
        ])  # fmt: skip
    return [
        "## Simulated benches", "",
        "Sessions of eight runs on air of eight seconds each, on one simulated bench whose tolerances are "
        "drawn once; each session is recorded and diagnosed by itself. The cable's offset, friction from run "
        "to run and noise differ from session to session.", "",
        *_table(["seed", "sessions", "kind", "what", "sessions before", "told of what stands out most",
                 "right number", "sessions before, told", "all that is told"], rows), "",
        "Two simulated benches, three sessions each:", "",
        *_table(["seed", "effect", "on", "told", "others told to be on both"], pairs),
    ]  # fmt: skip


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return ["| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows)]


@click.command()
@click.option("--seed", default=91001, show_default=True, help="The first one; each sequence has the next.")
@click.option("--sequences", default=60, show_default=True, help="Drawn sequences of each kind.")
@click.option(
    "--rounds", default=2, show_default=True, help="Of 12 simulated sequences and 4 pairs of benches."
)
@click.option("--jobs", default=1, show_default=True, help="Simulated benches at a time.")
@click.option("--results", type=click.Path(path_type=Path), default=Path("changes.jsonl"))
@click.option("--table", type=click.Path(path_type=Path), help=f"Markdown page, such as {PAGE}.")
def main(seed: int, sequences: int, rounds: int, jobs: int, results: Path, table: Path | None) -> None:
    """Change benches from session to session, and say what is told of them."""
    entries = [judged(drawn(kind, seed + k, COUNTS[k % 3])) for kind in KINDS[1:] for k in range(sequences)]
    for rough in (False, True):
        entries += [
            {**judged(drawn("nothing", seed + k, COUNTS[k % 3], rough)), "rough": rough}
            for k in range(STEADY * sequences)
        ]
    few = [judged(drawn(kind, seed + 10000 + k, FEW[k % 2])) for kind in KINDS for k in range(sequences // 2)]
    pairs = [judged_pair(kind, seed + 20000 + k, 3 + k % 4) for kind in PAIRS for k in range(sequences)]
    found = list(_recorded([seed + 100 * k for k in range(rounds)], jobs, results)) if rounds else []
    for what, figure in figures(entries):
        click.echo(f"{what:75s} {figure}")
    if table is not None:
        words = f" --seed {seed} --sequences {sequences} --rounds {rounds}"
        command = f"python -m tests.hidden.changes{words} --table {PAGE.as_posix()}"
        table.write_text(markdown(entries, few, pairs, found, command), encoding="utf-8")


def _recorded(seeds: Sequence[int], jobs: int, results: Path) -> Iterator[Entry]:
    """Simulated sequences and pairs, those of an earlier call taken from its results."""
    known = KeptResults(results, itemgetter("what", "seed"))
    todo = [
        ("sequence", seed + k, delayed(sequence_entry)(plan, seed + k))
        for seed in seeds
        for k, plan in enumerate(plans(seed))
    ]
    pairs = (("same", "motor_coulomb_friction"), ("differs", "motor_coulomb_friction"),
             ("first", "viscous_friction"), ("same", "viscous_friction"))  # fmt: skip
    todo += [
        ("pair", seed + k, delayed(pair_entry)(*pair, seed + k))
        for seed in seeds
        for k, pair in enumerate(pairs)
    ]
    left = [call for what, number, call in todo if (what, number) not in known]
    for entry in Parallel(n_jobs=jobs, return_as="generator_unordered")(left):
        known.add(entry)
        click.echo(f"{entry['what']} {entry['seed']} done", err=True)
    yield from (known[what, number] for what, number, _ in todo)


if __name__ == "__main__":
    main()

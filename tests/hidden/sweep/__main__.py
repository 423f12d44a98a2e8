"""``python -m tests.hidden.sweep``: all blind trials in parallel, with progress; resumable.

Results go to a JSON-lines file as they come; the table is made of all of them.
"""

from __future__ import annotations

import json
from pathlib import Path

import click
from joblib import Parallel, delayed
from rich.console import Console
from rich.progress import track
from threadpoolctl import threadpool_limits

from fingerlab.twin.effects import EFFECTS
from tests.hidden.sweep.table import markdown, summary
from tests.hidden.sweep.trials import Trial, nothing, outside, pairs, singles

KINDS = ("rich", "thesis", "after", "pairs", "outside", "engine")
POPULATION = "population"
FIRST_SEED = 101
"""Of an effect's trials, where none is asked for; plain benches and pairs are counted from it."""


def _one(trial: Trial, recordings: Path | None, own_size: bool) -> dict[str, object]:
    from tests.hidden.sweep.running import run  # what it brings is asked for by the processes that need it

    with threadpool_limits(limits=1, user_api="blas"):
        return run(trial, recordings, own_size)


def trials(kinds: set[str], ids: list[str], seeds: list[int]) -> list[Trial]:
    """The sweep's trials in a fixed order, so that one that was stopped can go on.

    ``after`` is ``thesis`` and the proposed experiment, where there is one; it stands for both.
    """
    found: list[Trial] = []
    plain = [6 * (seed - FIRST_SEED) + k for seed in seeds for k in range(6)]
    if "rich" in kinds:
        found += [*nothing("twin", "rich", [1000 + s for s in plain])]
        found += [*singles("twin", "rich", ids, seeds)]
    if kinds & {"thesis", "after"}:
        found += [*nothing("twin", "thesis", [2000 + s for s in plain])]
        found += [*singles("twin", "thesis", ids, seeds, proposed="after" in kinds)]
    if "pairs" in kinds:
        found += [*pairs("twin", ids, 8 * len(seeds), 3000 + seeds[0] - FIRST_SEED)]
    if "outside" in kinds:
        found += [*outside("twin", ids, seeds)]
    if "engine" in kinds:
        from tests.hidden.engine.session import EFFECTS as OWN

        found += [*nothing("engine", "rich", seeds), *singles("engine", "rich", sorted(OWN), seeds)]
    return found


@click.command()
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    type=click.Choice([*KINDS, POPULATION]),
    help="Repeatable; default all but the population.",
)
@click.option("--effect", "effects", multiple=True, help="Only these effects; default the whole catalogue.")
@click.option("--seeds", default=5, show_default=True, help="Seeds for each effect and protocol.")
@click.option("--seed", default=FIRST_SEED, show_default=True, help="First of an effect's seeds.")
@click.option("--first", default=1, show_default=True, help="First seed of the population.")
@click.option("--count", default=600, show_default=True, help="Benches of the population.")
@click.option("--own-size", is_flag=True, help="Leave the population's benches at the thesis' size.")
@click.option(
    "--recordings",
    type=click.Path(path_type=Path, file_okay=False),
    help="Keep the population's sessions in this folder, and take them from there when they are there.",
)
@click.option("--jobs", default=-1, show_default=True, help="Processes; -1 is one for each core.")
@click.option("--results", default="hidden-effects.jsonl", type=click.Path(path_type=Path), show_default=True)
@click.option(
    "--table", type=click.Path(path_type=Path), help="Markdown table, such as docs/hidden-effects.md."
)
@click.option("--command", default="python -m tests.hidden.sweep", hidden=True)
def main(
    kinds: tuple[str, ...], effects: tuple[str, ...], seeds: int, seed: int, first: int, count: int,
    own_size: bool, recordings: Path | None, jobs: int, results: Path, table: Path | None, command: str,
) -> None:  # fmt: skip
    """Run blind trials, and say how often the diagnosis was right."""
    wanted = trials(set(kinds or KINDS), list(effects) or list(EFFECTS), [seed + s for s in range(seeds)])
    if POPULATION in kinds:
        from tests.hidden.sweep.surroundings import population

        wanted += population(first, count)
    if recordings is not None:
        recordings.mkdir(parents=True, exist_ok=True)
    known: dict[str, dict[str, object]] = {}
    if results.exists():
        for line in results.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            known[json.dumps(entry["trial"], sort_keys=True)] = entry
    left = [t for t in wanted if t.key not in known]
    console = Console(stderr=True)
    with results.open("a", encoding="utf-8") as file:
        work = Parallel(n_jobs=jobs, return_as="generator_unordered")(
            delayed(_one)(t, recordings, own_size) for t in left
        )
        for entry in track(work, "Blind trials", total=len(left), console=console):
            file.write(json.dumps(entry) + "\n")
            file.flush()
            known[json.dumps(entry["trial"], sort_keys=True)] = json.loads(json.dumps(entry))
    entries = [known[t.key] for t in wanted]
    Console().print(summary(entries))
    if table is not None:
        before = table.read_text(encoding="utf-8") if table.exists() else ""
        table.write_text(markdown(entries, command, before), encoding="utf-8")


if __name__ == "__main__":
    main()

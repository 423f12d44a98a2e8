"""``python -m tests.hidden.axis DATA``: real machines and a plant of any size, as the page of the documents.

``DATA`` is the folder of recordings that the project did not make; without it the plant stands alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.scales import find_scales
from fingerlab.effects import CATALOGUE
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Session
from tests.hidden.axis import robots
from tests.hidden.axis.makers import MAKERS, Maker, imported
from tests.hidden.axis.plant import LAWS, TRUTH, drawn, session
from tests.hidden.axis.regression import CUTOFF_HZ, baselines
from tests.hidden.axis.robots import Joint

FOUND_BY_MAKERS = {
    "cable-tool": "Coulomb-like friction of a cable-driven tool",
    "real-seal": "friction of an O-ring seal that grows with the chamber's pressure",
    "real-cogging": "cogging of a brushless motor",
}
PAGE = Path("docs/real-machines.md")
BEGIN, END = "<!-- made from here -->", "<!-- to here -->"


@dataclass(frozen=True)
class Told:
    """What was said of a machine; errors of the torque on runs left out, N m, and in floors.

    ``measure``: errors of the plain regression, N m, in the same band.
    """

    verdict: str
    path: tuple[str, ...]
    chosen: tuple[str, ...]
    scores: tuple[float, float]
    errors: tuple[float, float]
    measure: dict[str, float]


def tell(machine: Session) -> Told:
    """The diagnosis of a machine, the model that its path ends in, and the regression beside them."""
    first = diagnose([machine], with_curves=False)
    last = diagnose([machine], first.final_model, with_curves=False) if first.final_model else first
    return Told(
        first.verdict,
        tuple(first.final_model),
        tuple(first.set),
        (first.path[0].score, first.path[-1].score),
        (first.errors["motor_torque"].rmse, last.errors["motor_torque"].rmse),
        baselines(machine, CUTOFF_HZ / find_scales([machine]).time),
    )


def _titles(ids: tuple[str, ...]) -> str:
    return ", then ".join(CATALOGUE[name].title.lower() for name in ids) or "nothing"


def _milli(value: float) -> str:
    return f"{1e3 * value:.3g}"


def line_of(name: str, told: Told) -> str:
    """What is printed of a machine while the table is made: the verdict, and the regression beside it."""
    best = min(told.measure, key=told.measure.__getitem__)
    return (
        f"{name}: {told.verdict}, {_titles(told.path)}; torque {told.errors[0]:.3g} to {told.errors[1]:.3g} "
        f"N m ({told.scores[0]:.1f} to {told.scores[1]:.2f} floors); regression "
        f"{told.measure['nominal']:.3g} to {told.measure[best]:.3g} N m ({best})"
    )


def real_table(folder: Path) -> list[str]:
    """Each recording of a real machine that is there."""
    lines = [
        "| recording | its makers found | the path names | torque error before, after (mN m) | regression: "
        "nominal, Coulomb, and viscous, and load (mN m) | score before, after |",
        "|---|---|---|---:|---:|---:|",
    ]
    for name, known in FOUND_BY_MAKERS.items():
        path = folder / f"{name}.h5"
        if path.exists():
            told = tell(open_session(path))
            click.echo(line_of(name, told))
            measure = ", ".join(_milli(value) for value in told.measure.values())
            lines.append(
                f"| `{name}` | {known} | {_titles(told.path)} | {', '.join(map(_milli, told.errors))} "
                f"| {measure} | {told.scores[0]:.1f}, {told.scores[1]:.2f} |"
            )
    return lines


def makers_table(jobs: int) -> list[str]:
    """Each machine of another maker, by its logs and the two commands that a stranger types."""
    lines = [
        "| machine and log | in it | first step right | all of it in the path | the path names "
        "| torque error over the regression's | score before, after |",
        "|---|---|---|---|---|---:|---:|",
    ]
    machines: dict[str, Maker | Joint] = {**MAKERS, **robots.MACHINES}
    every = Parallel(n_jobs=jobs)(delayed(_made)(machine) for machine in machines.values())
    for (name, machine), told in zip(machines.items(), every, strict=True):
        click.echo(line_of(name, told))
        missed = not machine.truth and not told.path
        first = missed or (bool(told.path) and any(told.path[0] in one for one in machine.truth))
        whole = all(one & set(told.path) for one in machine.truth)
        ratio = told.errors[1] / min(told.measure.values())
        lines.append(
            f"| {name} | {machine.inside or 'nothing'} | {'yes' if first else 'no'} "
            f"| {'yes' if whole else 'no'} "
            f"| {_titles(told.path)} | {ratio:.2f} | {told.scores[0]:.1f}, {told.scores[1]:.2f} |"
        )
    return lines


def _made(machine: Maker | Joint) -> Told:
    with threadpool_limits(limits=1, user_api="blas"), TemporaryDirectory() as folder:
        if isinstance(machine, Joint):
            return tell(open_session(robots.imported(machine, Path(folder))))
        return tell(open_session(imported(machine, Path(folder))))


def _one(law: str, seed: int) -> tuple[str, Told | None]:
    with threadpool_limits(limits=1, user_api="blas"):
        try:
            return law, tell(session(drawn(law, seed)))
        except UserError:  # too short or too slow a run for anything to be said
            return law, None


def plant_table(seeds: int, jobs: int) -> list[str]:
    """What was found in how many machines of any size."""
    trials = [(law, seed) for law in LAWS for seed in range(seeds)]
    results = Parallel(n_jobs=jobs)(delayed(_one)(*trial) for trial in trials)
    lines = [
        "| in the machine | machines | first step right | first in the set | all of it in the path "
        "| nothing else in it | torque error over the regression's, median | refused |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for law in LAWS:
        every = [told for name, told in results if name == law]
        for seed, told in enumerate(every):
            click.echo(f"{law} {seed}: refused" if told is None else line_of(f"{law} {seed}", told))
        mine = [told for told in every if told is not None]
        truth = TRUTH[law]
        allowed = frozenset().union(*truth)
        first = sum((told.path[0] in allowed) if told.path else not truth for told in mine)
        among = sum(bool(allowed & set(told.chosen)) if truth else not told.path for told in mine)
        whole = sum(all(one & set(told.path) for one in truth) for told in mine)
        clean = sum(set(told.path) <= allowed for told in mine)
        ratios = [told.errors[1] / min(told.measure.values()) for told in mine]
        lines.append(
            f"| {law} | {len(mine)} | {first} | {among} | {whole} | {clean} | {np.median(ratios):.2f} "
            f"| {len(every) - len(mine)} |"
        )
    return lines


@click.command()
@click.argument("folder", required=False, type=click.Path(path_type=Path))
@click.option("--seeds", default=6, show_default=True, help="Machines for each law.")
@click.option("--jobs", default=-1, show_default=True, help="Processes; -1 is one for each core.")
def main(folder: Path | None, seeds: int, jobs: int) -> None:
    """Write the tables into the page of the documents; what stands around them is kept."""
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    made, after = rest.split(END)
    real = real_table(folder) if folder is not None else made.split("\n\n")[1].splitlines()
    tables = (real, makers_table(jobs), plant_table(seeds, jobs))
    parts = ["", *("\n".join(table) for table in tables), ""]
    PAGE.write_text(before + BEGIN + "\n\n".join(parts) + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()

"""``python -m tests.hidden.as_built``: why was the thesis' force four times too low, cause by cause?

Each seed draws the bench as it was probably built (preset ``as-built``) and takes the thesis' runs, or the
rich protocol's. What the diagnosis then names is held against what the preset has. Results go to a
JSON-lines file as they come, so that a run that was stopped can go on; the page is made of all of them.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from fingerlab.diagnosis import diagnose
from fingerlab.prediction import fit_extended, fit_steps
from fingerlab.prediction.comparing import ComparedModel, compare_models
from fingerlab.sessions import Session, open_session
from fingerlab.thesis.analysis import thesis_analysis
from fingerlab.twin.protocols import AS_BUILT, Preset, load_preset
from fingerlab.twin.protocols import PROTOCOLS as PLANS
from fingerlab.twin.session import write_session
from tests.hidden.as_built_page import PROTOCOLS, SHEATH, Row, figures, held_by, markdown, said_path
from tests.hidden.sweep.running import simulate

PAGE = Path("docs/as-built.md")
CAUSES_SEED = 1
"""The bench from which one cause at a time is taken away: that of the figures in ``docs/replicate.md``."""


def measure(seed: int, protocol: str, path: Path) -> Row:
    """One bench from its recording to the errors on runs left out, without and with what was found.

    Args:
        path: where its session is, or is to be.
    """
    about: Row = {"seed": seed, "protocol": protocol}
    with threadpool_limits(limits=1, user_api="blas"):
        try:
            if not path.exists():
                path.parent.mkdir(parents=True, exist_ok=True)
                told = ("--preset", AS_BUILT, "--protocol", protocol, "--seed", str(seed))
                simulate(*told, "--out", str(path))
            session = open_session(path)
            said = diagnose([session], with_curves=False)
            found = {"found": fit_extended([session], said.final_model)}
            nominal, full = compare_models(session, found).models[:2]
            return {
                **about,
                "verdict": said.verdict,
                "path": [[step.added, step.score] for step in said.path],
                "nominal": model_row(nominal),
                "found": model_row(full),
                "thesis_share": thesis_share(session),
            }
        except Exception as error:  # counted as nothing found
            return {**about, "failed": f"{type(error).__name__}: {error}"}


def thesis_share(session: Session) -> float | None:
    """Peak force by the parameters that the thesis ended with, fitted on air, over the measured one."""
    share = thesis_analysis(session).quantity("peak_share").value / 100
    return share if math.isfinite(share) else None


def taken_away(preset: Preset) -> dict[str, Preset]:
    """The preset without one of its causes each, by effect; the whole one as ``""``."""
    n = preset.numbers

    def having(section: str, **changed: Any) -> Preset:
        return replace(preset, numbers={**n, section: {**n[section], **changed}})

    kept = {name: {k: v for k, v in preset.effects.items() if k != name} for name in preset.effects}
    made = {name: replace(preset, effects=effects) for name, effects in kept.items()}
    made[SHEATH] = having("cable", wrap=(0.0, 0.0))
    made["routing_change"] = having("arms", flexion=n["arms"]["extension"])
    return {"": preset, **made}


def shares_without(seed: int, folder: Path) -> Row:
    """What the thesis' analysis would have given on a bench without one of the causes each."""
    shares, whole = {}, load_preset(AS_BUILT)
    plans = PLANS["thesis"](whole.numbers["protocol"]["contact_amplitude_deg"])
    first = [[p for p in plans if p.phase == phase][:2] for phase in ("on_air", "contact")]
    short = [replace(p, trajectory={**p.trajectory, "duration_s": 12.0}) for pair in first for p in pair]
    for name, preset in taken_away(whole).items():
        path = folder / f"without-{name or 'nothing'}-{seed}.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_session(path, preset, "thesis", short, {}, seed)
        shares[name] = thesis_share(open_session(path))
    return {"seed": seed, "protocol": "causes", "without": shares}


def model_row(model: ComparedModel) -> Row:
    """A model on runs left out: rms error and floor of each family, SI; peak force over the measured one."""
    shares = [run.numbers["both"].prediction.share for run in model.forces if run.held_out]
    return {
        "errors": {name: [error.rmse, error.floor] for name, error in model.errors.items()},
        "share": float(np.mean(shares)) if shares else None,
    }


def story(row: Row, path: Path) -> Row:
    """The models of the path one after the other, in the floors of the best of them."""
    session, effects = open_session(path), [name for name, _ in row["path"][1:]]
    with threadpool_limits(limits=1, user_api="blas"):
        every = dict(zip(effects, fit_steps([session], effects), strict=True))
        models = compare_models(session, every).models
    about = {"seed": row["seed"], "protocol": row["protocol"]}
    return {**about, "steps": [model_row(one) for one in models]}


def read_results(path: Path) -> dict[tuple[str, int], Row]:
    """Rows by protocol and seed; a later line adds to an earlier one."""
    known: dict[tuple[str, int], Row] = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        entry = json.loads(line)
        known.setdefault((entry["protocol"], entry["seed"]), {}).update(entry)
    return known


@click.command()
@click.option("--seeds", default=10, show_default=True, help="Benches from seed 1 on.")
@click.option(
    "--protocol", "protocols", multiple=True, type=click.Choice(list(PROTOCOLS)), default=[*PROTOCOLS]
)
@click.option("--story", "told", default=2, show_default=True, help="Seed whose path is told cause by cause.")
@click.option("--recordings", type=click.Path(path_type=Path), default=Path("as-built-sessions"))
@click.option("--results", type=click.Path(path_type=Path), default=Path("as-built.jsonl"))
@click.option("--jobs", default=1, show_default=True)
@click.option("--page", type=click.Path(path_type=Path), help=f"Markdown page, such as {PAGE}.")
@click.option("--at-hand", is_flag=True, help="No further session: only what the results hold.")
def main(
    seeds: int,
    protocols: tuple[str, ...],
    told: int,
    recordings: Path,
    results: Path,
    jobs: int,
    page: Path | None,
    at_hand: bool,
) -> None:
    """Diagnose the bench as it was probably built, and tell the story."""
    known, preset = read_results(results), load_preset(AS_BUILT)
    wanted = [(protocol, seed) for seed in range(1, seeds + 1) for protocol in protocols]
    files = {(p, s): recordings / f"as-built-{p}-{s}.h5" for p, s in wanted}

    def keep(row: Row) -> None:
        known.setdefault((row["protocol"], row["seed"]), {}).update(row)
        with results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    if not at_hand:
        work = [delayed(measure)(s, p, files[p, s]) for p, s in wanted if (p, s) not in known]
        for row in Parallel(n_jobs=jobs, return_as="generator_unordered")(work):
            keep(row)
            click.echo(f"{row['protocol']} {row['seed']}: {row.get('failed') or said_path(row)}", err=True)
        for key, row in list(known.items()):
            if key in files and key[1] == told and "path" in row and "steps" not in row:
                keep(story(row, files[key]))
        if ("causes", CAUSES_SEED) not in known:
            keep(shares_without(CAUSES_SEED, recordings))
    rows = [
        known[p, s] for p in PROTOCOLS for s in range(1, seeds + 1) if (p, s) in files and (p, s) in known
    ]
    for what, figure in figures(rows, held_by(preset)):
        click.echo(f"{what:64s} {figure}")
    if page is not None:
        without = known.get(("causes", CAUSES_SEED), {}).get("without", {})
        command = f"python -m tests.hidden.as_built --seeds {seeds}"
        command += "".join(f" --protocol {name}" for name in protocols) + f" --page {PAGE.as_posix()}"
        page.write_text(markdown(rows, len(wanted), without, preset, command), encoding="utf-8")


if __name__ == "__main__":
    main()

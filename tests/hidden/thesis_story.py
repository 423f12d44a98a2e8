"""``python -m tests.hidden.thesis_story``: from a quarter of the measured force to the force that was wanted.

Each seed draws the bench as it was probably built (preset ``as-built``) and takes the thesis' runs. What the
diagnosis names is saved as a model, and ``record --feed-forward --ab`` sends a wanted force by the nominal
and by the found model on the same bench. Results go to a JSON-lines file; the page is made of all.
"""

from __future__ import annotations

import json
from operator import itemgetter
from pathlib import Path
from typing import Any

import click
from click.testing import CliRunner
from threadpoolctl import threadpool_limits

from fingerlab.cli.main import cli
from fingerlab.core.errors import UserError
from fingerlab.core.text import in_sentence
from fingerlab.diagnosis import diagnose
from fingerlab.effects import CATALOGUE
from fingerlab.models.file import write_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.prediction.comparing import compare_models
from fingerlab.prediction.trial import analyse_trial, trial_json
from fingerlab.report.comparison_words import result_sentences
from fingerlab.sessions import open_session
from fingerlab.twin.protocols import AS_BUILT
from tests.hidden.as_built import model_row, thesis_share
from tests.hidden.kept import KeptResults
from tests.hidden.sweep.running import simulate

PAGE = Path("docs/tutorials/thesis.md")
MEAN_N, AMPLITUDE_N = 0.33, 0.12
WANTED = {"kind": "sine", "mean_n": MEAN_N, "amplitude_n": AMPLITUDE_N, "frequency_hz": 0.5, "duration_s": 8}
"""N: what the fingertip presses with in the thesis' contact runs, up to a little beyond."""
PAIRS = 3


def follow(seed: int, folder: Path) -> dict[str, Any]:
    """One bench from the thesis' runs to the trial of the force.

    Args:
        folder: where session, model and trial are kept, and taken from where they are there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    session_file, model, taken = (
        folder / f"{name}-{seed}{end}"
        for name, end in (("thesis", ".h5"), ("model", ".json"), ("trial", ".h5"))
    )
    if not session_file.exists():
        simulate(
            "--preset", AS_BUILT, "--protocol", "thesis", "--seed", str(seed), "--out", str(session_file)
        )
    session = open_session(session_file)
    with threadpool_limits(limits=1, user_api="blas"):
        diagnosis = diagnose([session], with_curves=False)
        found = fit_extended([session], diagnosis.final_model)
        nominal, full = compare_models(session, {"found": found}).models[:2]
        row = {
            "seed": seed,
            "thesis_share": thesis_share(session),
            "path": [[step.added, step.score] for step in diagnosis.path],
            "nominal": model_row(nominal),
            "found": model_row(full),
        }
        if not model.exists():
            write_model(model_of_extended(found), model)
        try:
            if not taken.exists():
                send(model, taken, seed)
            trial = analyse_trial(open_session(taken))
            row |= {"trial": trial_json(trial), "sentences": list(result_sentences(trial))}
        except UserError as error:
            row["failed"] = str(error)
    return row


def send(model: Path, taken: Path, seed: int) -> None:
    """The wanted force by either model, in pairs of runs in random order, as a user would call it."""
    done = CliRunner().invoke(
        cli,
        [
            "record", "--feed-forward", str(model), "--wanted", json.dumps(WANTED), "--force", str(MEAN_N),
            "--ab", str(PAIRS), "--device", "simulated", "--preset", AS_BUILT, "--seed", str(seed), "--yes",
            "--out", str(taken),
        ],
    )  # fmt: skip
    if done.exit_code != 0:
        raise UserError(str(done.exception or done.output.strip().splitlines()[-1]))


TEXT = Path(__file__).with_name("thesis_story_page.md")


def _bench(row: dict[str, Any]) -> str:
    head = (
        f"| {row['seed']} | {100 * row['thesis_share']:.0f} % | {len(row['path']) - 1} | "
        f"{row['path'][0][1]:.1f} → {row['path'][-1][1]:.2f} |"
    )
    if "trial" not in row:
        return f"{head} – | – | – | {row['failed'].split(';')[0]} |"
    trial = row["trial"]
    return (
        f"{head} {1e3 * trial['nominal']['rms']:.0f} | {1e3 * trial['found']['rms']:.1f} | "
        f"{100 * trial['ratio']['value']:.0f} % | {100 * trial['ratio']['foretold']:.0f} % |"
    )


def markdown(rows: list[dict[str, Any]], command: str) -> str:
    """The page; the story is that of the first bench."""
    first = rows[0]
    names = ["nominal model", *(in_sentence(CATALOGUE[name].title) for name, _ in first["path"][1:])]
    steps = [f"| {name} | {score:.3g} |" for name, (_, score) in zip(names, first["path"], strict=True)]
    before, after = first["nominal"], first["found"]
    return TEXT.read_text(encoding="utf-8").format(
        seed=first["seed"],
        thesis=100 * first["thesis_share"],
        nominal_share=100 * before["share"],
        found_share=100 * after["share"],
        before_torque=1e3 * before["errors"]["joint_torque"][0],
        after_torque=1e3 * after["errors"]["joint_torque"][0],
        before_force=1e3 * before["errors"]["endpoint_force"][0],
        after_force=1e3 * after["errors"]["endpoint_force"][0],
        first_score=first["path"][0][1],
        last_score=first["path"][-1][1],
        steps="\n".join(steps),
        wanted=json.dumps(WANTED),
        mean=MEAN_N,
        low=MEAN_N - AMPLITUDE_N,
        high=MEAN_N + AMPLITUDE_N,
        pairs=PAIRS,
        sentences="\n".join(f"> {sentence}\n>" for sentence in first["sentences"]).removesuffix("\n>"),
        benches="\n".join(map(_bench, rows)),
        command=command,
    )


@click.command()
@click.option("--seed", "seeds", multiple=True, type=int, default=(2, 1, 3), show_default=True)
@click.option("--folder", type=click.Path(path_type=Path), default=Path("thesis-story"), show_default=True)
@click.option("--results", type=click.Path(path_type=Path), default=Path("thesis-story.jsonl"))
@click.option("--page", type=click.Path(path_type=Path), help=f"Markdown page, such as {PAGE.as_posix()}.")
def main(seeds: tuple[int, ...], folder: Path, results: Path, page: Path | None) -> None:
    """Follow the thesis' experiment to the force that was wanted, and tell the story."""
    known = KeptResults(results, itemgetter("seed"))
    for seed in seeds:
        if seed not in known:
            known.add(follow(seed, folder))
        click.echo(_bench(known[seed]))
    if page is not None:
        asked = "".join(f" --seed {seed}" for seed in seeds)
        command = f"python -m tests.hidden.thesis_story{asked} --page {PAGE.as_posix()}"
        page.write_text(markdown([known[seed] for seed in seeds], command), encoding="utf-8")


if __name__ == "__main__":
    main()

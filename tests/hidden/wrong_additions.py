"""``python -m tests.hidden.wrong_additions``: a wrong effect is added on purpose; is that seen?

A bench has one effect. Its two nearest relatives are each put into the model in its place, and then the
effect itself. Results go to a JSON-lines file as they come, so that a run that was stopped can go on; the
table is made of all of them.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from threadpoolctl import threadpool_limits

from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.effects import CATALOGUE
from fingerlab.sessions import open_session
from tests.hidden.sweep.running import asked, simulate
from tests.hidden.sweep.table import IN_A_FAMILY, near
from tests.hidden.sweep.trials import Trial

PAGE = Path("docs/wrong-additions.md")
RELATIVES = 2


def relatives(effect: str) -> list[str]:
    """The effects nearest to one: those that its file names, then those that name it, then its neighbours."""
    named = CATALOGUE[effect].formula
    first = () if named is None else named.alike
    others = [e.id for e in CATALOGUE.values() if e.formula is not None and effect in e.formula.alike]
    alike = [name for name in IN_A_FAMILY if name != effect and near(effect, name)]
    found = dict.fromkeys((*first, *others, *sorted(alike)))
    return [name for name in found if name in CATALOGUE][:RELATIVES]


def told(said: Diagnosis) -> dict[str, Any]:
    """What was said of a model with an effect added."""
    better = said.better
    return {
        "verdict": said.verdict,
        "nothing": said.probability_nothing,
        "score": said.score,
        "set": list(said.set),
        "path": [step.added for step in said.path[1:]],
        "better": None if better is None else [list(better.removed), list(better.added), better.score],
        "as_good": [list(one.added) for one in said.as_good],
    }


def try_effect(effect: str, seed: int, protocol: str) -> list[dict[str, Any]]:
    """What is said with each of the relatives in the model, and with the effect itself."""
    about = {"effect": effect, "seed": seed, "protocol": protocol}
    result = []
    with tempfile.TemporaryDirectory() as folder:
        path, trial = Path(folder) / "session.h5", Trial("twin", protocol, (effect,), seed)
        simulate("--protocol", protocol, *asked(trial), "--seed", str(seed), "--out", str(path))
        sessions = [open_session(path)]
        kept = Reduction(sessions)
        for added in (*relatives(effect), effect):
            try:
                said = told(
                    diagnose(sessions, [added], with_curves=False, options=DiagnosisOptions(kept=kept))
                )
            except Exception as error:  # counted as wrong
                said = {"failed": f"{type(error).__name__}: {error}"}
            result.append({**about, "added": added, **said})
    return result


Entry = Mapping[str, Any]


def is_nothing(entry: Entry) -> bool:
    """Whether the wrong model was taken for all that there is."""
    return entry.get("verdict") == "nothing_missing"


def is_named(entry: Entry) -> bool:
    """Whether the truth is in the set of what is missing, in the path, or in a model offered in exchange."""
    known = list(entry.get("path", []))
    known += entry.get("set", []) if not is_nothing(entry) else []
    known += entry["better"][1] if entry.get("better") else []
    return entry["effect"] in known or any(entry["effect"] in one for one in entry.get("as_good", []))


def figures(entries: Sequence[Entry]) -> list[tuple[str, str]]:
    """What was counted, and how often."""
    wrong = [e for e in entries if e["added"] != e["effect"]]
    right = [e for e in entries if e["added"] == e["effect"]]
    return [
        ("wrong effect added: “nothing missing”", _share([is_nothing(e) for e in wrong])),
        ("wrong effect added: the truth named or offered in exchange", _share([is_named(e) for e in wrong])),
        (
            "wrong effect added: a model with the truth is told as the better one",
            _share([bool(e.get("better")) and e["effect"] in e["better"][1] for e in wrong]),
        ),
        ("right effect added: “nothing missing”", _share([is_nothing(e) for e in right])),
        ("right effect added: another model told as better", _share([bool(e.get("better")) for e in right])),
    ]


def _share(hits: Sequence[bool]) -> str:
    return f"{sum(hits)} of {len(hits)} ({100 * sum(hits) / len(hits):.0f} %)" if hits else "-"


def markdown(entries: Sequence[Entry], command: str) -> str:
    """The page."""
    seeds = list(dict.fromkeys(e["seed"] for e in entries))
    by_seed = [figures([e for e in entries if e["seed"] == seed]) for seed in seeds]
    counted = [(of_each[0][0], *(value for _, value in of_each)) for of_each in zip(*by_seed, strict=True)]
    lines = [
        "# A wrong effect in the model", "", f"Made by `{command}`.",
        "Each bench has one effect, at 0.6 to 1.6 times its default strength. Each of its two nearest",
        "relatives is put into the model in its place, and then the effect itself. Whole models are compared",
        "on the same held-out runs: where one with an effect exchanged is better, the answer says so, and",
        "offers it. What these data could not have shown (`distal_rotation`) is in the set then.", "",
        f"| what | {' | '.join(f'seed {seed}' for seed in seeds)} |", "|---" * (1 + len(seeds)) + "|",
        *(f"| {' | '.join((what, *values))} |" for what, *values in counted), "",
        "| seed | in the bench | added | error, floors | verdict | better model | its error |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for e in entries:
        if "failed" in e:
            lines.append(
                f"| {e['seed']} | {e['effect']} | {e['added']} | - | failed: {e['failed'][:60]} | - | - |"
            )
            continue
        gone, came, score = e["better"] or ([], [], None)
        better = f"{' + '.join(came)} for {' + '.join(gone)}" if came else "-"
        verdict = e["verdict"].replace("_", " ")
        if e["verdict"] == "missing_effect" and not came:
            verdict += f": {' + '.join(e['path']) or ', '.join(e['set'])}"
        told = "-" if score is None else f"{score:.2f}"
        said = f"{e['score']:.2f} | {verdict} | {better} | {told}"
        lines.append(f"| {e['seed']} | {e['effect']} | {e['added']} | {said} |")
    return "\n".join(lines) + "\n"


@click.command()
@click.option("--effect", "effects", multiple=True, help="Only these effects; default the whole catalogue.")
@click.option("--first", default=len(CATALOGUE), help="Only so many of the catalogue, from its beginning.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(301,), show_default=True)
@click.option("--protocol", default="rich", show_default=True)
@click.option("--results", type=click.Path(path_type=Path), default=Path("wrong-additions.jsonl"))
@click.option("--table", type=click.Path(path_type=Path), help=f"Markdown table, such as {PAGE}.")
def main(
    effects: tuple[str, ...],
    first: int,
    seeds: tuple[int, ...],
    protocol: str,
    results: Path,
    table: Path | None,
) -> None:
    """Add wrong effects to the model, and say how often that is seen."""
    known: dict[tuple[str, int, str], list[dict[str, Any]]] = {}
    if results.exists():
        for line in results.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            known.setdefault((entry["effect"], entry["seed"], entry["protocol"]), []).append(entry)
    wanted = [(name, seed, protocol) for seed in seeds for name in effects or tuple(CATALOGUE)[:first]]
    with results.open("a", encoding="utf-8") as file, threadpool_limits(limits=1, user_api="blas"):
        for key in wanted:
            if key in known:
                continue
            known[key] = try_effect(*key)
            file.writelines(json.dumps(entry) + "\n" for entry in known[key])
            file.flush()
            click.echo(f"{key[0]}: {[e.get('better') or e.get('verdict') for e in known[key]]}", err=True)
    entries = [entry for key in wanted for entry in known[key]]
    for what, value in figures(entries):
        click.echo(f"{what:74s} {value}")
    if table is not None:
        said = f" --first {first}" if first < len(CATALOGUE) else ""
        said += "".join(f" --seed {seed}" for seed in seeds) + f" --protocol {protocol}"
        command = f"python -m tests.hidden.wrong_additions{said} --table {PAGE.as_posix()}"
        table.write_text(markdown(entries, command), encoding="utf-8")


if __name__ == "__main__":
    main()

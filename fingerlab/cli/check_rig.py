"""``fingerlab check-rig``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from fingerlab.cli.common import json_option, write_json
from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken


@click.command("check-rig")
@click.option(
    "--device",
    metavar="NAME",
    help="A card such as Dev1 or host:31763/Dev1; own:FILE.py; 'simulated' for practice; else the first one "
    "found.",
)
@click.option(
    "--rig", "rig_file", type=click.Path(path_type=Path), help="Rig file; the default rig without it."
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Protocol to write (JSON).")
@click.option(
    "--yes", "all_yes", is_flag=True, help="Answer every question with yes: for rehearsals and tests."
)
@click.option(
    "--answer",
    "answers",
    multiple=True,
    metavar="STEP=yes|no|skip",
    help="Answer one step's question, such as limits/force=no; may be repeated. The rest is asked.",
)
@json_option
def check_rig(
    device: str | None,
    rig_file: Path | None,
    out: Path,
    all_yes: bool,
    answers: tuple[str, ...],
    json_target: str | None,
) -> None:
    """Confirm channels, terminals, signs, limits and assumptions of the rig, step by step.

    Exits with 0 where everything was confirmed. A step that failed or was left out is bad input: the bench is
    not known to be what its rig file says; the exit code is 2 then. The protocol is written either way.
    """
    from fingerlab.devices.checking import check_rig as check
    from fingerlab.devices.checking import write_protocol
    from fingerlab.devices.choosing import REPLAY, choose_device
    from fingerlab.devices.detect import detect, opening_sentence
    from fingerlab.rig.file import default_rig, load_rig

    refuse_taken(out)
    rig = load_rig(rig_file) if rig_file else default_rig()
    if device is None:
        click.echo(opening_sentence(detect(rig)), err=True)
    operator = _Operator(_answers(answers), all_yes)
    choice = choose_device(device, rig, real_time=not all_yes)
    if choice.kind == REPLAY:
        raise UserError("A replay has no bench to check; give a card such as Dev1, or 'simulated'.")
    chosen = choice.build()
    click.echo(f"Checking {chosen.name}.", err=True)
    protocol = check(chosen, rig, operator, str(rig_file or "the default rig"))
    write_protocol(protocol, out)
    states = [outcome.state for outcome in protocol.outcomes]
    counted = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    click.echo(f"{counted}. Written to {out}.", err=True)
    if json_target is not None:
        write_json(_json(protocol), json_target)
    if not protocol.all_confirmed:
        raise UserError(_complaint(protocol, out))


def _complaint(protocol: Any, out: Path) -> str:
    """Which steps failed or were left out, and what to do."""
    from fingerlab.devices.checking import FAILED, SKIPPED

    said = []
    for state, words in ((FAILED, "failed"), (SKIPPED, "were left out")):
        steps = [outcome.id for outcome in protocol.outcomes if outcome.state == state]
        if steps:
            said.append(f"{', '.join(steps)} {words}")
    return (
        f"The rig is not confirmed ({'; '.join(said)}; see {out}); correct the wiring or the rig file and "
        "run check-rig again."
    )


class _Operator:
    """Asks on the terminal, unless the command line has answered already."""

    def __init__(self, answers: dict[str, str], all_yes: bool) -> None:
        self._answers, self._all_yes = answers, all_yes

    def tell(self, text: str) -> None:
        click.echo(text, err=True)

    def ask(self, step: str, question: str) -> str:
        if step in self._answers or self._all_yes:
            answer = self._answers.get(step, "yes")
            click.echo(f"[{step}] {question} {answer}", err=True)
            return answer
        if sys.stdin is None or not sys.stdin.isatty():
            raise UserError(
                f"Nobody is there to answer the step '{step}'; run check-rig in a terminal, or give --yes."
            )
        words = click.Choice(["yes", "no", "skip"])
        answer = click.prompt(f"[{step}] {question}", type=words, err=True)
        return str(answer)


def _answers(given: tuple[str, ...]) -> dict[str, str]:
    result = {}
    for text in given:
        step, _, answer = text.partition("=")
        if answer not in ("yes", "no", "skip"):
            raise UserError(f"--answer {text!r} should look like limits/force=no, with yes, no or skip.")
        result[step] = answer
    return result


def _json(protocol: Any) -> dict[str, Any]:
    from fingerlab.devices.checking import finite

    result: dict[str, Any] = finite(protocol.to_json())
    return result

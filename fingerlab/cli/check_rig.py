"""``fingerlab check-rig``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import Interrupts, asked_device, json_option, somebody_there, write_json
from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.bench import Bench
    from fingerlab.acquisition.check_rig.look import CheckProtocol, Operator, Outcome
    from fingerlab.acquisition.check_rig.walk import Step
    from fingerlab.devices.choosing import DeviceChoice
    from fingerlab.rig.constants import Rig


@click.command("check-rig")
@click.option(
    "--device",
    metavar="NAME",
    help="A card such as Dev1 or host:31763/Dev1; own:FILE.py; 'simulated' for practice; else it is asked.",
)
@click.option(
    "--rig", "rig_file", type=click.Path(path_type=Path), help="Rig file; the default rig without it."
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Protocol to write (JSON).")
@click.option(
    "--yes", "all_yes", is_flag=True, help="Answer every question with yes: on the simulated rig alone."
)
@click.option(
    "--answer",
    "answers",
    multiple=True,
    metavar="STEP=yes|no|skip",
    help="Answer one step's question, such as limits/force=no; may be repeated. The rest is asked, and every "
    "yes on a bench that is real.",
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
    from fingerlab.acquisition.check_rig.kept import checks_folder, keep
    from fingerlab.acquisition.check_rig.look import write_protocol
    from fingerlab.acquisition.check_rig.walk import check_answers
    from fingerlab.devices.choosing import REPLAY, choose_device
    from fingerlab.rig.file import default_rig, load_rig

    refuse_taken(out)
    given = _answers(answers)
    rig = load_rig(rig_file) if rig_file else default_rig()
    choice = choose_device(device or asked_device(rig, "to check"), rig, real_time=not all_yes)
    if choice.kind == REPLAY:
        raise UserError("A replay has no bench to check; give a card such as Dev1, or 'simulated'.")
    check_answers(given, all_yes, choice.simulated)
    protocol = checked(choice, _Operator(given, all_yes), str(rig_file or "the default rig"))
    write_protocol(protocol, out)
    if not choice.simulated:  # a rehearsal says nothing about a real bench
        keep(protocol, checks_folder(rig_file))
    states = [outcome.state for outcome in protocol.outcomes]
    counted = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    click.echo(f"{counted}. Written to {out}.", err=True)
    if json_target is not None:
        write_json(_json(protocol), json_target)
    if not protocol.all_confirmed:
        raise UserError(_complaint(protocol, out))


def checked(
    choice: DeviceChoice, operator: Operator, rig_source: str, steps: Sequence[Step] | None = None
) -> CheckProtocol:
    """Open the bench, walk through all steps or those given, and close it whatever happens.

    Raises:
        UserError: the bench cannot be opened, or nobody answers. KeyboardInterrupt: it was stopped.
    """
    from fingerlab.acquisition.check_rig.kept import bench_key
    from fingerlab.acquisition.check_rig.walk import STEPS
    from fingerlab.acquisition.check_rig.walk import check_rig as check
    from fingerlab.devices.choosing import CARD
    from fingerlab.rig.file import default_rig

    rig = choice.rig or default_rig()
    bench = _open(choice, rig)
    try:
        operator.tell(f"Checking {bench.status().device}.")
        with Interrupts(bench.stop) as interrupts:
            walked = STEPS if steps is None else steps
            on_card = choice.kind == CARD
            protocol = check(bench, rig, operator, rig_source, on_card, walked, bench_key(choice))
        if interrupts.asked:
            raise KeyboardInterrupt
    finally:
        bench.close()
    return protocol


def _open(choice: DeviceChoice, rig: Rig) -> Bench:
    """The bench with its loop, limits and guardian; a rehearsal without questions waits for no clock."""
    from fingerlab.acquisition.check_rig.look import check_settings
    from fingerlab.acquisition.record.recording import rescue_folder

    settings = check_settings(rig)
    if choice.simulated and not choice.real_time:
        from fingerlab.acquisition.bench.inline import InlineBench

        return InlineBench(choice.build(), settings, rescue_folder())
    from fingerlab.acquisition.bench.process_bench import ProcessBench

    return ProcessBench(choice, settings, rescue_folder(), rig.daq.rate_hz)


def _complaint(protocol: Any, out: Path) -> str:
    """Which steps failed or were left out, and what to do."""
    from fingerlab.acquisition.check_rig.look import FAILED, SKIPPED

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

    def found(self, outcome: Outcome) -> None:
        self.tell(f"{outcome.state}: {outcome.title.rstrip('.')}. {outcome.sentence}")

    def ask(self, step: str, question: str) -> str:
        if step in self._answers or self._all_yes:
            answer = self._answers.get(step, "yes")
            click.echo(f"[{step}] {question} {answer}", err=True)
            return answer
        if not somebody_there():
            raise UserError(f"Nobody is there to answer the step '{step}'; run check-rig in a terminal.")
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
    from fingerlab.acquisition.check_rig.look import finite

    result: dict[str, Any] = finite(protocol.to_json())
    return result

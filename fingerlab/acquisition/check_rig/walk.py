"""``check-rig``: an operator confirms every channel, sign, limit and assumption; the protocol tells of it.

Whatever can be measured is measured; the operator does what hands have to do and confirms what only eyes
can see. Nothing moves before the operator has said so. A step that failed or was left out blocks every later
one that drives: what limits a motor is known before it is driven.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.check_rig.card import OUTPUT_TITLES, PACING_TITLES, output, pacing
from fingerlab.acquisition.check_rig.channels import channels_at_rest, channels_moved, encoder_turned, scaling
from fingerlab.acquisition.check_rig.driving import DRIVE_TITLES, drive, limits, stop
from fingerlab.acquisition.check_rig.lines import DEAD_MAN_TITLES, dead_man, inputs
from fingerlab.acquisition.check_rig.look import (
    FAILED,
    NOT_HERE,
    SKIPPED,
    BenchFailed,
    CheckProtocol,
    Look,
    Operator,
    Outcome,
)
from fingerlab.acquisition.control.commands import Reset
from fingerlab.acquisition.control.machine import Mode
from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig

LOST, STOPPED = "device-lost", "stopped"


@dataclass(frozen=True)
class Step:
    """One step of a check.

    Attributes:
        name: for what goes wrong in it. run: does it. drives: whether a set value leaves in it.
        card: whether only a card has it. titles: of its outcomes by id, where it drives or is a card's.
    """

    name: str
    run: Callable[[Look], Iterable[Outcome]]
    drives: bool = False
    card: bool = False
    titles: Mapping[str, str] = field(default_factory=dict)


STEPS = (
    Step("rest", channels_at_rest),
    Step("moved", channels_moved),
    Step("scale", scaling),
    Step("encoder", encoder_turned),
    Step("lines", inputs),
    Step("limits", limits),
    Step("pacing", pacing, card=True, titles=PACING_TITLES),
    Step("output", output, drives=True, card=True, titles=OUTPUT_TITLES),
    Step("drive", drive, drives=True, titles=DRIVE_TITLES),
    Step("dead_man", dead_man, drives=True, titles=DEAD_MAN_TITLES),
    Step("stop", stop),
)
"""All steps in their order."""


def check_rig(
    bench: Bench,
    rig: Rig,
    operator: Operator,
    rig_source: str,
    card: bool = False,
    steps: Sequence[Step] = STEPS,
    key: str = "",
) -> CheckProtocol:
    """Walk through all steps of an open bench, whose loop was given ``check_settings(rig)``.

    Args:
        rig_source: the rig file's name, for the protocol. card: whether a card is checked. key: of the bench
            that is checked, for who looks for its last check.

    Raises:
        UserError: by the operator, where nobody is there to answer.
    """
    look, outcomes = Look(bench, rig, operator), list[Outcome]()
    for step in steps:
        for outcome in _taken(step, look, outcomes, card):
            operator.found(outcome)
            outcomes.append(outcome)
        if outcomes and outcomes[-1].id in (LOST, STOPPED):
            break
    date = datetime.now().astimezone().isoformat(timespec="seconds")
    return CheckProtocol(bench.status().device, date, rig, rig_source, tuple(outcomes), key)


def _taken(step: Step, look: Look, before: Sequence[Outcome], card: bool) -> Iterable[Outcome]:
    """A step, unless it is not for this bench or blocked; a fault is a finding, a lost device is the end."""
    if step.card and not card:
        yield from (
            Outcome(k, title, NOT_HERE, "Only a card can show it.") for k, title in step.titles.items()
        )
        return
    first = next((outcome for outcome in before if outcome.open), None)
    if step.drives and first is not None:
        happened = "failed" if first.state == FAILED else "was left out"
        why = f"Left out, for {first.id} {happened}; mend that and run check-rig again."
        yield from (Outcome(k, title, SKIPPED, why) for k, title in step.titles.items())
        return
    try:
        yield from step.run(look)
    except BenchFailed as failure:
        yield _failed(step, look, str(failure))


def _failed(step: Step, look: Look, sentence: str) -> Outcome:
    status = look.bench.status()
    if status.loop_ended:
        return Outcome(LOST, "The device was lost", FAILED, status.fault or sentence)
    if status.latched:
        return Outcome(STOPPED, "The bench was stopped", FAILED, sentence)
    if status.mode is Mode.FAULT and not status.pressed:  # an emergency stop has a step of its own
        try:
            look.ask(Reset())
        except BenchFailed as failure:
            return Outcome(LOST, "The device was lost", FAILED, str(failure))
    return Outcome(step.name, "The bench reported a fault", FAILED, sentence)


def check_answers(given: Mapping[str, str], all_yes: bool, simulated: bool) -> None:
    """What may be answered before anybody has seen the bench: all of it for the simulated rig alone.

    A person who stands at the bench says yes, step by step. No and skip may be given for any bench: they
    never let a motor run.

    Raises:
        UserError: more was answered.
    """
    yes = [step for step, answer in given.items() if answer == "yes"]
    if simulated or not (all_yes or yes):
        return
    said = "--yes" if all_yes else f"--answer {yes[0]}=yes"
    raise UserError(
        f"{said} is for the simulated rig; at a real bench run check-rig in a terminal and answer each "
        "question there, or give --answer STEP=no or STEP=skip."
    )

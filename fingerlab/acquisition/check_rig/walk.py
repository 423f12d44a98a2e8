"""``check-rig``: an operator confirms every channel, sign, limit and assumption; what became of it is kept.

A check holds for what it was made of: the bench, its wiring and its limits. Whoever changes one of them in
the rig file checks again. Slopes and zeros of the sensors are left out: a calibration changes them, and
judges them by the data sheet.

Whatever can be measured is measured; the operator does what hands have to do and confirms what only eyes
can see. Nothing moves before the operator has said so. A step that failed or was left out blocks every later
one that drives: what limits a motor is known before it is driven.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.check_rig.channels import (
    CHANNELS,
    CLEARED,
    OUTPUT_TITLES,
    PACING_TITLES,
    channels_at_rest,
    channels_moved,
    encoder_turned,
    output,
    pacing,
    scaling,
)
from fingerlab.acquisition.check_rig.driving import (
    DEAD_MAN,
    DEAD_MAN_TITLES,
    DRIVE_TITLES,
    LINE_STEPS,
    NOT_WIRED,
    dead_man,
    drive,
    inputs,
    limits,
    stop,
)
from fingerlab.acquisition.check_rig.look import (
    FAILED,
    NOT_HERE,
    SKIPPED,
    BenchFailed,
    CheckProtocol,
    Look,
    Operator,
    Outcome,
    finite,
    write_protocol,
)
from fingerlab.acquisition.control.machine import Mode, Reset
from fingerlab.core.errors import UserError
from fingerlab.core.files import own_data, read_text
from fingerlab.core.plain_data import read_object
from fingerlab.devices.choosing import OWN, DeviceChoice
from fingerlab.rig.daq import SOURCES, plain_section
from fingerlab.rig.file import Rig
from fingerlab.rig.limits import BENCH_LIMITS

UNCHECKED_SHARE = 0.1
"""Of the rig's limit of the current; so much a bench gets that nobody has checked."""

CALIBRATED = ("load_cell", "mcp", "pip")


@dataclass(frozen=True)
class KeptCheck:
    """The last check of a bench as it is wired now.

    Attributes:
        date: ISO 8601; empty where there was none. open: steps that failed or were left out.
        changed: it was checked, and its wiring or limits were changed since.
    """

    date: str = ""
    open: tuple[str, ...] = ()
    changed: bool = False

    @property
    def confirmed(self) -> bool:
        """Whether everything was, and nothing was changed since."""
        return bool(self.date) and not self.open and not self.changed

    @property
    def words(self) -> str:
        """A few words: when it was checked, and with what result."""
        if not self.date:
            return "never checked"
        on = f"checked on {datetime.fromisoformat(self.date):%Y-%m-%d at %H:%M}"
        if self.changed:
            return f"{on}, and wiring or limits of the rig file were changed since"
        if self.open:
            return f"{on}, not confirmed: {', '.join(self.open)}"
        return f"{on}, all confirmed"

    def current_share(self) -> float:
        """Of the rig's limit of the current that the loop may send."""
        return 1.0 if self.confirmed else UNCHECKED_SHARE

    def sentence(self, rig: Rig) -> str:
        """What holds for the motor; for an operator."""
        words = f"{self.words[:1].upper()}{self.words[1:]}"
        if self.confirmed:
            return f"{words}."
        amps = UNCHECKED_SHARE * rig.limits.current
        return (
            f"{words}: the current stays below {amps:.2g} A, a tenth of its limit, until a check confirms it."
        )


def checks_folder(rig_file: Path | None = None) -> Path:
    """Where checks are kept: beside a rig file, else among the user's data."""
    if rig_file is not None:
        return rig_file.with_name(f"{rig_file.stem}-checks")
    return own_data("rigs", "default", "checks")


def bench_key(choice: DeviceChoice) -> str:
    """Which bench it is, beside what the wiring says (card and server): the content of an own device.

    Raises:
        UserError: the file of the own device cannot be read.
    """
    if choice.kind != OWN or choice.file is None:
        return choice.kind
    from fingerlab.devices.choosing import device_file

    return f"{OWN}:{device_file(choice.file).sha256}"


def keep(protocol: CheckProtocol, folder: Path) -> Path:
    """Write the protocol under a name of its own.

    Raises:
        UserError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder} cannot be made ({error.strerror}); the check is not kept.") from None
    stem = protocol.date[:19].replace(":", "")
    path, number = folder / f"{stem}.json", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.json"
    write_protocol(protocol, path)
    return path


def last_check(rig: Rig, bench: str, folder: Path) -> KeptCheck:
    """The newest check of this bench as it is wired; of another wiring where there is none of this one.

    Args:
        bench: by :func:`bench_key`. A file that cannot be read counts as none.
    """
    wiring, other = _wiring(plain_section(rig.daq), plain_section(rig.limits)), KeptCheck()
    for path in sorted(folder.glob("*.json"), reverse=True):
        try:
            data = read_object(read_text(path, "the protocol of a check"), str(path), "see check-rig")
            if data.get("kind") != "check-rig" or data.get("bench") != bench:
                continue
            same = _wiring(data["daq"], data["limits"]) == wiring
            steps = tuple(str(step["id"]) for step in data["steps"] if step["state"] in ("failed", "skipped"))
            date = str(data["date"])
            datetime.fromisoformat(date)
        except (UserError, KeyError, TypeError, ValueError):
            continue
        if same:
            return KeptCheck(date, steps)
        if not other.date:
            other = KeptCheck(date, changed=True)
    return other


def _wiring(daq: Any, limits: Any) -> Any:
    """Wiring and limits as a check holds for them."""
    plain = {name: value for name, value in dict(daq).items() if name != SOURCES}
    for name in CALIBRATED:
        plain[name] = {
            key: value for key, value in dict(plain[name]).items() if key not in ("gain", "offset")
        }
    kept = {name: value for name, value in dict(limits).items() if name != SOURCES}
    return json.loads(json.dumps(finite({"daq": plain, "limits": kept})))


LOST, STOPPED = "device-lost", "stopped"


@dataclass(frozen=True)
class Step:
    """One step of a check.

    Attributes:
        name: for what goes wrong in it. run: does it. drives: whether a set value leaves in it.
        card: whether only a card has it. titles: of its outcomes by id, where it drives or is a card's.
        wired: whether the rig has the line that is tried in it.
    """

    name: str
    run: Callable[[Look], Iterable[Outcome]]
    drives: bool = False
    card: bool = False
    titles: Mapping[str, str] = field(default_factory=dict)
    wired: Callable[[Rig], bool] = lambda _rig: True


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
    Step(
        "dead_man",
        dead_man,
        drives=True,
        titles=DEAD_MAN_TITLES,
        wired=lambda rig: bool(rig.daq.dead_man.terminal),
    ),
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
    why = "Only a card can show it." if step.card and not card else ""
    why = why or ("" if step.wired(look.rig) else NOT_WIRED)
    if why:
        yield from (Outcome(k, title, NOT_HERE, why) for k, title in step.titles.items())
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
    if not look.bench.status().loop_ended:
        look.bench.idle()  # a STOP that was pressed this moment is latched by the loop's next cycle
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


def questions() -> tuple[str, ...]:
    """The steps that may ask something, in their order, of whatever bench."""
    hand = [f"{name}/{channel}" for name in ("moved", "scale") for channel in CHANNELS[:3]]
    return (
        *(f"rest/{channel}" for channel in CHANNELS), *hand, "encoder", *LINE_STEPS,
        *(f"limits/{name}" for name in BENCH_LIMITS), "assumptions", CLEARED, "drive", DEAD_MAN, "stop",
    )  # fmt: skip


def check_answers(given: Mapping[str, str], all_yes: bool, simulated: bool) -> None:
    """What may be answered before anybody has seen the bench: all of it for the simulated rig alone.

    A person who stands at the bench says yes, step by step. No and skip may be given for any bench: they
    never let a motor run.

    Raises:
        UserError: more was answered, or what no step asks.
    """
    asked = questions()
    strange = next((step for step in given if step not in asked), None)
    if strange is not None:
        raise UserError(f"--answer names the step '{strange}'; the steps that ask are {', '.join(asked)}.")
    yes = [step for step, answer in given.items() if answer == "yes"]
    if simulated or not (all_yes or yes):
        return
    said = "--yes" if all_yes else f"--answer {yes[0]}=yes"
    raise UserError(
        f"{said} is for the simulated rig; at a real bench run check-rig in a terminal and answer each "
        "question there, or give --answer STEP=no or STEP=skip."
    )

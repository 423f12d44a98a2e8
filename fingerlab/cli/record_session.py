"""The taking of one session by ``fingerlab record``: driver, script, events and the operator together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import Interrupts
from fingerlab.cli.record_events import Events, Lines, Observer, live_model
from fingerlab.core.errors import Cancelled, UserError

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.bench import Bench
    from fingerlab.acquisition.control.commands import Initialise
    from fingerlab.acquisition.protocols.driver import Beginning, ProtocolDriver
    from fingerlab.acquisition.protocols.script import Order
    from fingerlab.acquisition.protocols.steps import Step
    from fingerlab.models.file import Model
    from fingerlab.rig.constants import Rig

Report = Callable[[float, str], None]


@dataclass(frozen=True)
class Told:
    """What the command line says of the session.

    Attributes:
        orders: of the script. typed: further ones come from standard input. asks: the operator is waited
            for where the bench is to be changed. model: to be compared with; a name or a model, or None.
    """

    out: Path
    name: str
    title: str | None
    attributes: Mapping[str, Any]
    initial: Initialise
    beginning: Beginning
    model: Model | str | None
    orders: Sequence[Order]
    typed: bool
    asks: bool


class _Attendant:
    """Between the driver and everybody else."""

    def __init__(self, bench: Bench, rig: Rig, told: Told, events: Events, bar: Any, report: Report) -> None:
        from fingerlab.acquisition.protocols.driver import ProtocolDriver
        from fingerlab.acquisition.protocols.script import Script

        self._bench, self._told, self._events, self._bar, self._report = bench, told, events, bar, report
        self.script = Script(self._tell, told.orders)
        self._observer = Observer(bench, rig, events, self.say, told.model)
        self._lines = Lines(self.script.add if told.typed else lambda line: self.script.add("ready"))
        self.driver: ProtocolDriver = ProtocolDriver(
            bench, self._ask, self._show, told.initial, self.look, told.beginning
        )
        if told.typed:
            self._lines.begin()

    def look(self) -> None:
        """Tell what is new, and obey."""
        self._observer.look(self.driver)
        self.script.look(self.driver)

    def close(self) -> None:
        """Nothing more is to come."""
        self._observer.look(self.driver)
        self.script.close()

    def say(self, sentence: str) -> None:
        """A sentence for whoever sits there."""
        self._bar.console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    def _tell(self, event: str, what: dict[str, Any]) -> None:
        self._events.tell(event, what)
        if event == "refused":
            self.say(what["sentence"])

    def _show(self, share: float, words: str) -> None:
        from fingerlab.acquisition.protocols.steps import countdown

        step, left = self.driver.step_left_s, self.driver.left_s
        own = f" {countdown(step)}," if step > 0 else ","
        self._report(share, f"{words}{own} in all {countdown(left)} left")

    def _ask(self, sentence: str) -> None:
        """Let the operator change the bench; not for ever where somebody stops."""
        self._events.tell("ask" if self._told.asks else "change", {"sentence": sentence})
        if not self._told.asks:
            self._report(self.driver.share, sentence)
            return
        self._bar.stop()
        click.echo(
            f"{sentence} Then {'give the line ready' if self._told.typed else 'press Enter'}.", err=True
        )
        self._lines.begin()
        self.script.asking, self.script.answered = True, False

        def answered() -> bool:
            over = self._lines.ended
            self.look()
            if over and not self.script.answered:
                raise UserError(
                    "Nobody is there to say that the bench has been changed; record from a terminal, or give "
                    "the line 'ready' with --commands."
                )
            return self.script.answered

        try:
            self._bench.wait_until(answered, float("inf"), "")
        finally:
            self.script.asking = False
        self._bar.start()


def take(
    bench: Bench, rig: Rig, steps: Sequence[Step], told: Told, events: Events, bar: Any, report: Report
) -> tuple[Path, int, int]:
    """Take all steps and write the session.

    Returns:
        Its path, how many samples were recorded, and in how many runs.

    Raises:
        UserError: the bench or the recorder failed. KeyboardInterrupt: it was stopped. What was recorded is
            kept in either case.
    """
    from fingerlab.acquisition.control.commands import SetUp
    from fingerlab.acquisition.protocols.steps import Record, plan_seconds

    if told.model is not None:
        live_model(rig, bench.rate_hz, told.model, SetUp())  # what is lacking is told before anything moves
    attendant = _Attendant(bench, rig, told, events, bar, report)
    driver, script = attendant.driver, attendant.script
    runs = sum(isinstance(step, Record) for step in steps)
    plan = {"runs": runs, "seconds": plan_seconds(steps), "rate_hz": bench.rate_hz}
    device = bench.status().device
    with Interrupts(bench.stop) as interrupts:
        try:
            bench.recorder.open(_info(rig, told, device))
            events.tell("begun", {"session": str(told.out), "device": device, **plan})
            driver.take(steps)
            attendant.close()
        except BaseException as error:
            bench.stop()  # before anything else
            why = KeyboardInterrupt() if interrupts.asked or script.stopped else error
            _keep(bench, why, told.out, _Writing(events, bar, report))
            raise why from None
    return _write(bench, told.out, _Writing(events, bar, report)), driver.samples, driver.number


class _Writing:
    """Shows and tells how far a session's file is; ``put_off`` lets it be finished later."""

    STEP = 0.01
    """Told again when so much more is done, as a share of the whole."""

    def __init__(self, events: Events, bar: Any, report: Report) -> None:
        self.events, self._report = events, report
        self._told, self._doing = -1.0, ""
        self._later = False
        bar.reset(bar.task_ids[0])  # the time left is that of the writing, not of the runs

    def put_off(self) -> None:
        self._later = True

    def __call__(self, share: float, doing: str) -> None:
        from fingerlab.sessions.recording_files import VERIFYING

        self._report(share, "reading the file back" if doing == VERIFYING else "writing the file")
        if doing != self._doing or share >= min(self._told + self.STEP, 1.0) > self._told:
            self._told, self._doing = share, doing
            self.events.tell("writing", {"share": round(share, 4), "doing": doing})
        if self._later:
            raise Cancelled


def _write(bench: Bench, out: Path, writing: _Writing) -> Path:
    """Write the session's file. Ctrl-C puts it off: all runs are whole by then.

    Raises:
        UserError: the place is full. KeyboardInterrupt: it was put off.
    """
    from fingerlab.sessions.recording_files import recording_folder

    with Interrupts(writing.put_off, raises=False):
        try:
            return bench.recorder.close(writing)
        except Cancelled:
            sentence = (
                f"The runs are whole and kept in {recording_folder(out)}; the file is written when {out} is "
                "next opened, such as by 'fingerlab info'."
            )
            writing.events.tell("put_off", {"sentence": sentence})
            click.echo(sentence, err=True)
            raise KeyboardInterrupt from None


def _info(rig: Rig, told: Told, device: str) -> Any:
    from fingerlab.acquisition.record.recording import SessionInfo

    title = told.title or f"{told.name} protocol on {device}"
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    attributes = {**told.attributes, "protocol": told.name, "device": device}
    return SessionInfo(told.out, rig.to_json(), title, now, attributes)


def _keep(bench: Bench, error: BaseException, out: Path, writing: _Writing) -> None:
    """What was recorded before it broke off becomes a session that says so."""
    note = str(error) if isinstance(error, UserError) else "The recording was stopped by the operator."
    try:
        bench.recorder.cut(note)
        path = bench.recorder.close(writing)
    except UserError:
        writing.events.tell("broken_off", {"sentence": note, "session": None})
        return
    writing.events.tell("broken_off", {"sentence": note, "session": str(path)})
    click.echo(f"The recording broke off; what was taken is in {path}.", err=True)

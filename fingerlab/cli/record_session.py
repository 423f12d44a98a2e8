"""One session taken by ``fingerlab record``: driver, script, operator, and the events that tell of it."""

from __future__ import annotations

import json
import locale
import math
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

import click

from fingerlab.cli.common import Interrupts
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.files import refuse_taken
from fingerlab.core.plain_data import json_ready

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.bench import Bench, Status
    from fingerlab.acquisition.control.machine import Initialise
    from fingerlab.acquisition.protocols.driver import Beginning, ProtocolDriver
    from fingerlab.acquisition.protocols.script import Order
    from fingerlab.acquisition.protocols.steps import Step
    from fingerlab.models.file import SavedModel
    from fingerlab.models.live import LiveModel
    from fingerlab.rig.file import Rig

READINGS_S = 1.0
"""Readings are told once in so much of the bench's time."""

SHOWN = (
    "motor_command", "motor_position", "motor_speed", "motor_current", "motor_torque", "mcp_angle",
    "pip_angle", "endpoint_force",
)  # fmt: skip


class Events:
    """One JSON object a line, to a file or to standard output; nothing where no target is given."""

    def __init__(self, target: str | None) -> None:
        self._file: IO[str] | None = None
        self._own = target is not None and target != "-"
        if target == "-":
            self._file = sys.stdout
        elif target is not None:
            refuse_taken(Path(target))
            try:
                self._file = Path(target).open("x", encoding="utf-8")  # noqa: SIM115 (it is one itself)
            except OSError as error:
                raise UserError(f"{target} cannot be written ({error.strerror}).") from None

    def __enter__(self) -> Events:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._own and self._file is not None:
            self._file.close()

    @property
    def wanted(self) -> bool:
        """Whether anybody listens."""
        return self._file is not None

    def tell(self, event: str, what: dict[str, Any] | None = None) -> None:
        """Write one event. A listener who has gone, or a disk that is full, does not end the recording."""
        if self._file is None:
            return
        known = json_ready(what or {})
        with suppress(OSError):
            self._file.write(json.dumps({"event": event, **known}, ensure_ascii=False) + "\n")
            self._file.flush()


class Observer:
    """Looks at bench and driver between the driver's own looks, and tells what is new.

    Args:
        say: shows the operator a sentence. model: beside the measurement; ``nominal`` fits it as it goes.
    """

    def __init__(
        self,
        bench: Bench,
        rig: Rig,
        events: Events,
        say: Callable[[str], None],
        model: SavedModel | str | None,
    ) -> None:
        from fingerlab.acquisition.ring import CycleTimes

        self._bench, self._rig, self._events, self._say, self._model = bench, rig, events, say, model
        self._cycles = CycleTimes(bench.rate_hz)
        self._rows = bench.ring.reader()
        self._status: Status = bench.status()
        self._newest: Any = None
        self._due = 0.0
        self._run = 0
        self._recording = False
        self._live: LiveModel | None = None
        self._set_up: Any = None
        self._progress = ("", 0, 0)

    def look(self, driver: ProtocolDriver) -> None:
        """To be called many times a second."""
        from fingerlab.acquisition.bench.bench import Kind, notices

        before, self._status = self._status, self._bench.status()
        for notice in notices(before, self._status, self._bench.rate_hz):
            if notice.kind is not Kind.RUN:  # told with the run's end
                self._events.tell("warning", {"about": notice.kind.value, "sentence": notice.sentence})
            self._say(notice.sentence)
        self._tell_runs(driver)
        if not self._events.wanted:
            return
        self._follow(driver)
        self._tell_progress(driver)
        if self._status.index >= self._due and self._newest is not None:
            self._due = self._status.index + READINGS_S * self._bench.rate_hz
            self._events.tell("readings", self._readings())

    def _tell_runs(self, driver: ProtocolDriver) -> None:
        run = driver.run
        if run is None:
            return
        if driver.number != self._run:
            self._run = driver.number
            begun = {"run": driver.number, "phase": run.phase, "cable": run.cable, **run.attributes}
            self._events.tell("run", {**begun, "trajectory": dict(run.trajectory)})
        if self._recording and not driver.recording:
            now = self._status
            ended = {"run": driver.number, "samples": now.recorded, "gaps": now.gaps, "missing": now.dropped}
            self._events.tell("run_ended", {**ended, "verdict": now.verdict})
        self._recording = driver.recording

    def _tell_progress(self, driver: ProtocolDriver) -> None:
        """When a second has passed or something else is done."""
        now = driver.doing, math.ceil(driver.step_left_s), math.ceil(driver.left_s)
        if now != self._progress:
            self._progress = now
            progress = {"share": round(driver.share, 4), "doing": driver.doing}
            self._events.tell("progress", {**progress, "step_left_s": now[1], "left_s": now[2]})

    def _readings(self) -> dict[str, Any]:
        from fingerlab.acquisition.bench.bench import line_words
        from fingerlab.acquisition.control.machine import MODE_WORDS
        from fingerlab.acquisition.ring import COLUMN

        status = self._status
        readings: dict[str, Any] = {
            "time_s": status.index / self._bench.rate_hz,
            "mode": MODE_WORDS[status.mode],
        }
        readings |= {"recorded": status.recorded, "late_cycles": status.late, "lost_cycles": status.lost}
        readings |= {"cycle_s": self._cycles.mean, "longest_cycle_s": self._cycles.longest}
        readings |= {name: float(self._newest[COLUMN[name]]) for name in SHOWN}
        readings |= {
            name.replace(" ", "_").replace("-", "_"): word for name, word in line_words(status).items()
        }
        if self._live is not None:
            readings["torque_error"] = self._live.error("torque")
            readings["force_error"] = self._live.error("force")
        return readings

    def _follow(self, driver: ProtocolDriver) -> None:
        import numpy as np

        from fingerlab.acquisition.ring import COLUMN

        rows = self._rows.read().rows
        if not len(rows):
            return
        index = rows[:, COLUMN["index"]]
        before = index[0] - 1 if self._newest is None else self._newest[COLUMN["index"]]
        self._newest = rows[-1]
        self._cycles.take(rows)
        if self._model is None:
            return
        from fingerlab.models.live import Measured

        if driver.set_up != self._set_up:
            self._set_up = driver.set_up
            self._live = live_model(self._rig, self._bench.rate_hz, self._model, driver.set_up)
        assert self._live is not None
        if np.any(np.diff(index, prepend=before) != 1):
            self._live.forget()
        names = ("mcp_angle", "pip_angle", "motor_position", "motor_torque", "endpoint_force")
        self._live.extend(Measured(*(rows[:, COLUMN[name]] for name in names)))


def live_model(rig: Rig, rate_hz: float, model: SavedModel | str, set_up: Any) -> LiveModel:
    """The model beside the measurement of a set-up.

    Raises:
        UserError: rig or model lack what it needs.
    """
    from fingerlab.models.live import LiveModel, balance_of

    balance = None if isinstance(model, str) else balance_of(model, set_up.cable)
    return LiveModel(rig, rate_hz, set_up.phase, set_up.cable, balance)


class Lines:
    """Lines of standard input as they come, read in a thread of their own.

    It reads past Python's buffer: a thread that waits inside of it would break the program's end.

    Attributes:
        ended: there will be no further line.
    """

    def __init__(self, take: Callable[[str], None]) -> None:
        self._take = take
        self._begun = self.ended = False

    def begin(self) -> None:
        """Read from now on."""
        if not self._begun:
            self._begun = True
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        if sys.stdin is not None:
            for line in _lines(sys.stdin):
                self._take(line)
        self.ended = True


def _lines(stream: IO[str]) -> Iterator[str]:
    try:
        number = stream.fileno()
    except OSError:  # not a file of the system's
        yield from stream
        return
    rest = b""
    while piece := os.read(number, 4096):
        *whole, rest = (rest + piece).split(b"\n")
        yield from map(_text, whole)
    if rest:
        yield _text(rest)


def _text(line: bytes) -> str:
    """UTF-8, as scripts write it, else as a terminal of this system writes it."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode(locale.getencoding(), errors="replace")


Report = Callable[[float, str], None]


@dataclass(frozen=True)
class SessionOptions:
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
    model: SavedModel | str | None
    orders: Sequence[Order]
    typed: bool
    asks: bool


class _Attendant:
    """Between the driver and everybody else.

    Args:
        check: raises where the program was asked to end.
    """

    def __init__(
        self,
        bench: Bench,
        rig: Rig,
        options: SessionOptions,
        events: Events,
        bar: Any,
        report: Report,
        check: Callable[[], None],
    ) -> None:
        from fingerlab.acquisition.protocols.driver import ProtocolDriver
        from fingerlab.acquisition.protocols.script import Script

        self._bench, self._options, self._events = bench, options, events
        self._bar, self._report, self._check = bar, report, check
        self.script = Script(self._tell, options.orders)
        self._observer = Observer(bench, rig, events, self.say, options.model)
        self._lines = Lines(self.script.add if options.typed else lambda line: self.script.add("ready"))
        self.driver: ProtocolDriver = ProtocolDriver(
            bench, self._ask, self._show, options.initial, self.look, options.beginning
        )
        if options.typed:
            self._lines.begin()

    def look(self) -> None:
        """Tell what is new, and obey."""
        self._check()
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
        self._events.tell("ask" if self._options.asks else "change", {"sentence": sentence})
        if not self._options.asks:
            self._report(self.driver.share, sentence)
            return
        self._bar.stop()
        click.echo(
            f"{sentence} Then {'give the line ready' if self._options.typed else 'press Enter'}.", err=True
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
    bench: Bench,
    rig: Rig,
    steps: Sequence[Step],
    options: SessionOptions,
    events: Events,
    bar: Any,
    report: Report,
) -> tuple[Path, int, int]:
    """Take all steps and write the session.

    Returns:
        Its path, how many samples were recorded, and in how many runs.

    Raises:
        UserError: the bench or the recorder failed. KeyboardInterrupt: it was stopped. What was recorded is
            kept in either case.
    """
    from fingerlab.acquisition.control.machine import SetUp
    from fingerlab.acquisition.protocols.driver import refuse_impossible
    from fingerlab.acquisition.protocols.steps import Record, plan_seconds

    refuse_impossible(steps, bench.settings)
    if options.model is not None:
        # What is lacking is told before anything moves.
        live_model(rig, bench.rate_hz, options.model, SetUp())
    interrupts = Interrupts(bench.stop)
    attendant = _Attendant(bench, rig, options, events, bar, report, interrupts.check)
    driver, script = attendant.driver, attendant.script
    runs = sum(isinstance(step, Record) for step in steps)
    plan = {"runs": runs, "seconds": plan_seconds(steps), "rate_hz": bench.rate_hz}
    device = bench.status().device
    with interrupts:
        try:
            bench.recorder.open(_info(rig, options, device))
            events.tell("begun", {"session": str(options.out), "device": device, **plan})
            driver.take(steps)
            attendant.close()
            interrupts.check()
        except BaseException as error:
            bench.stop()  # before anything else
            why = KeyboardInterrupt() if interrupts.asked or script.stopped else error
            _keep(bench, why, options.out, _Writing(events, bar, report))
            raise why from None
    numbers = [step.number for step in steps if isinstance(step, Record)]  # from the one that was begun with
    path = _write(bench, options.out, _Writing(events, bar, report))
    return path, driver.samples, sum(number <= driver.number for number in numbers)


class _Writing:
    """Shows and tells how far a session's file is; ``put_off`` lets it be finished later."""

    STEP = 0.01
    """Told again when so much more is done, as a share of the whole."""

    def __init__(self, events: Events, bar: Any, report: Report) -> None:
        self.events, self._report = events, report
        self._reported, self._doing = -1.0, ""
        self._later = False
        bar.reset(bar.task_ids[0])  # the time left is that of the writing, not of the runs

    def put_off(self) -> None:
        self._later = True

    def __call__(self, share: float, doing: str) -> None:
        from fingerlab.sessions.recording_files import VERIFYING

        self._report(share, "reading the file back" if doing == VERIFYING else "writing the file")
        if doing != self._doing or share >= min(self._reported + self.STEP, 1.0) > self._reported:
            self._reported, self._doing = share, doing
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


def _info(rig: Rig, options: SessionOptions, device: str) -> Any:
    from fingerlab.acquisition.recording import SessionInfo

    title = options.title or f"{options.name} protocol on {device}"
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    attributes = {**options.attributes, "protocol": options.name, "device": device}
    return SessionInfo(options.out, rig.to_json(), title, now, attributes)


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

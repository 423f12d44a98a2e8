"""What may be asked for while a protocol is recorded, written as lines: by a script, or by whoever types.

=====================  ==========================================================================
line                   what it asks for
=====================  ==========================================================================
``mark a light touch``  a marker with this note
``pause``              leave samples out from now on, which makes a gap in time
``resume``             go on
``ready``              the bench has been changed as it was asked for
``end``                no further run; the present one ends here, the motor comes softly to rest
``stop``               the latched stop: no current, amplifier off, the recording is cut
=====================  ==========================================================================

A line may begin with a moment: ``@1.5 mark here`` comes 1.5 s after the beginning of the run that goes on,
or of the next; ``@3:1.5 pause`` in the third run. A marker then stands at that very sample, everything else
comes with the next look at the bench, some 10 ms. What is empty or begins with ``#`` is no line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue
from typing import Any

from fingerlab.acquisition.protocols.driver import ProtocolDriver
from fingerlab.acquisition.recording import RunInfo
from fingerlab.core.errors import UserError

VERBS = ("mark", "pause", "resume", "ready", "end", "stop")
_LINE = re.compile(r"(?:@(?:(\d+):)?(\d+(?:\.\d*)?|\.\d+)\s+)?([a-z]+)(?:\s+(.*))?")

Tell = Callable[[str, dict[str, Any]], None]
"""Told what happened: a word, and what belongs to it."""


@dataclass(frozen=True)
class Order:
    """One line: ``at_s`` seconds after the beginning of run ``run``; None for now, and for any run."""

    verb: str
    text: str = ""
    run: int | None = None
    at_s: float | None = None


def read_order(line: str, where: str = "the line") -> Order | None:
    """What a line asks for; None where it is empty or a remark.

    Raises:
        UserError: it asks for nothing that is known.
    """
    line = line.strip()
    if not line or line.startswith("#"):
        return None
    matched = _LINE.fullmatch(line)
    if matched is None or matched[3] not in VERBS:
        raise UserError(
            f"{where} is {line!r}; it should be one of {', '.join(VERBS)}, with a moment before it where one "
            "is meant, such as '@2:1.5 mark here'."
        )
    run, at, verb, text = matched.groups()
    if text and verb != "mark":
        raise UserError(f"{where} is {line!r}; only 'mark' takes words behind it.")
    return Order(verb, text or "", None if run is None else int(run), None if at is None else float(at))


def read_orders(lines: Iterable[str], where: str) -> list[Order]:
    """All lines of a file.

    Raises:
        UserError: one of them asks for nothing that is known.
    """
    found = (read_order(line, f"{where}, line {number}") for number, line in enumerate(lines, 1))
    return [order for order in found if order is not None]


class Script:
    """Carries out orders between the looks of a driver.

    Attributes:
        stopped: whether ``stop`` was asked for. asking: whether the operator is being asked for something;
            set by whoever asks. answered: whether ``ready`` came since.
    """

    def __init__(self, tell: Tell, orders: Iterable[Order] = ()) -> None:
        self._tell = tell
        self._come: SimpleQueue[Order | UserError] = SimpleQueue()
        self._waiting: list[Order] = list(orders)
        self.stopped = self.asking = self.answered = False

    def add(self, line: str) -> None:
        """Take a line; may be called from another thread."""
        try:
            order = read_order(line)
        except UserError as error:
            self._come.put(error)
        else:
            if order is not None:
                self._come.put(order)

    def look(self, driver: ProtocolDriver) -> None:
        """Do what is due."""
        self._take_what_came()
        later = []
        for order in self._waiting:
            found = self._due(order, driver)
            if found is None:
                later.append(order)
            else:
                self._try(found, driver)
        self._waiting = later

    def close(self) -> None:
        """Everything is over: say which orders have waited in vain."""
        self._take_what_came()
        for order in self._waiting:
            self._refuse(order, "Its moment did not come.")
        self._waiting = []

    def _take_what_came(self) -> None:
        while True:
            try:
                came = self._come.get_nowait()
            except Empty:
                return
            if isinstance(came, Order):
                self._waiting.append(came)
            else:
                self._tell("refused", {"sentence": str(came)})

    def _due(self, order: Order, driver: ProtocolDriver) -> Order | None:
        """The order, with the run that it means, where its moment has come; None before."""
        run = driver.run
        if order.at_s is None:
            return order
        if run is None or (order.run is not None and order.run > driver.number):
            return None
        if order.run is None:
            if not driver.recording:
                return None
            order = replace(order, run=driver.number)
        over = order.run != driver.number or not driver.recording
        return order if over or driver.newest >= _moment(order, run) else None

    def _try(self, order: Order, driver: ProtocolDriver) -> None:
        over = order.run is not None and (order.run != driver.number or not driver.recording)
        if over:
            self._refuse(order, f"Run {order.run} is over.")
            return
        try:
            self._do(order, driver)
        except UserError as error:
            self._refuse(order, str(error))

    def _do(self, order: Order, driver: ProtocolDriver) -> None:
        bench, details = driver.bench, {"run": driver.number}
        if order.verb == "mark":
            run, note = driver.run, order.text.strip() or "marker"
            if run is None or not driver.recording:
                raise UserError("Nothing is being recorded; a marker belongs to a run.")
            at = driver.newest if order.at_s is None else _moment(order, run)
            bench.recorder.mark(note, at)
            self._tell("marked", {**details, "note": note, "time_s": (at - run.start) / run.sample_rate_hz})
        elif order.verb in ("pause", "resume"):
            bench.recorder.pause(order.verb == "pause")
            self._tell("paused" if order.verb == "pause" else "resumed", details)
        elif order.verb == "ready":
            if not self.asking:
                raise UserError("Nothing was asked for.")
            self.answered = True
        elif order.verb == "end":
            driver.end()
            self.answered = True
            self._tell("ending", details)
        else:
            self.stopped = True
            bench.stop()
            self._tell("stopping", details)

    def _refuse(self, order: Order, sentence: str) -> None:
        self._tell("refused", {"order": f"{order.verb} {order.text}".strip(), "sentence": sentence})


def _moment(order: Order, run: RunInfo) -> int:
    """Index of the sample that the order means."""
    assert order.at_s is not None
    return run.start + round(order.at_s * run.sample_rate_hz)

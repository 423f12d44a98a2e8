"""One kill of ``check-rig`` in one of its steps, at the virtual card, and what became of its outputs."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil

from tests.faults.killing import PATIENCE_S, ROOT, signal_of
from tests.faults.live_card import Served
from tests.faults.shared_device import Output, read_output

STEPS = {
    "rest": 0.9,
    "moved": 3.5,
    "scale": 3.5,
    "encoder": 3.5,
    "lines": 3.5,
    "limits": 0.05,
    "pacing": 2.0,
    "output": 0.15,
    "drive, line low": 0.5,
    "drive": 0.1,
    "dead_man": 0.3,
    "stop": 0.05,
}
"""Steps in which it is killed, and within how many s of the step's beginning; of the set value's, where there
is one."""

DRIVING = ("output", "drive, line low", "drive", "dead_man")
"""Those in which a set value stands for a while."""

ASKED = {"output": "assumptions", "pacing": "rest/current_monitor", "dead_man": "drive/dead_man"}
"""By what the beginning of a step shows where that is not a question of its own name."""


@dataclass(frozen=True)
class Kill:
    """What was seen.

    Attributes:
        step, how: where and by which signal. driven: whether a set value stood when the kill came; enabled:
            whether the enable line did. zero: whether zero and low were reached, and stayed.
        too_late: the step's set value had stood and was over again when the kill came.
        since_ms: cycles of the card since that set value, to the kill; NaN in a step that has none.
        plant_ms: cycles of the card (1 ms each) from the kill to zero and low; 0 where nothing stood.
        ended: whether no process was left.
    """

    step: str
    how: str
    driven: bool
    enabled: bool
    too_late: bool
    since_ms: float
    zero: bool
    plant_ms: float
    ended: bool


class NotSoFar(Exception):
    """The check ended before: on a busy machine its loop comes late, stops the motor, and says so."""


def kill_check(card: Served, step: str, how: str, share: float) -> Kill:
    """Kill a check in ``step``, at this share (0 to 1) of its time.

    Raises:
        NotSoFar: it did not come so far.
    """
    output, name = card.output, step.partition(",")[0]
    free = name in ("drive", "dead_man")
    card.do("set_up", *(("motor_bench", "none") if free else ("on_air", "extension")))
    before_it = ["rest"] if name in ("moved", "scale", "pacing") else []
    arguments = [sys.executable, "-m", "tests.faults.checker", card.address, *before_it, name]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, cwd=ROOT, text=True) as check:
        lines = _Lines(check)
        try:
            children = lines.wait_for("told")["children"]
            _await_step(lines, name)
            _wait(_begun(step, output), 1e-4, check)
        except NotSoFar:
            raise NotSoFar(lines.failures()) from None
        begun = read_output(output).cycles
        time.sleep(STEPS[step] * share)
        before = read_output(output)
        os.kill(check.pid, signal_of(how))
        _wait(lambda: read_output(output).zero, 1e-3)
        at = read_output(output)
        ended = _all_gone([check.pid, *children], check)
        after = read_output(output)
    stood = not before.zero
    plant = float(at.changed_at - before.cycles) if stood else 0.0
    since = float(before.cycles - begun) if step in DRIVING else math.nan
    driven = before.volts != 0.0
    too_late = step in DRIVING and not driven
    zero = at.zero and after.zero
    return Kill(step, how, driven, before.enabled, too_late, since, zero, plant, ended)


class _Lines:
    """What the check prints, as it comes."""

    def __init__(self, check: subprocess.Popen[str]) -> None:
        self._said: list[dict] = []
        self._taken = 0
        self._check = check
        self._reader = threading.Thread(target=self._read, args=(check,), daemon=True)
        self._reader.start()

    def wait_for(self, key: str) -> dict:
        """The next line with this key."""
        found: list[dict] = []

        def there() -> bool:
            while self._taken < len(self._said) and not found:
                line = self._said[self._taken]
                self._taken += 1
                found.extend([line] if key in line else [])
            return bool(found)

        _wait(there, 1e-3, self._check)
        return found[0]

    def failures(self) -> str:
        """What failed, of a check that has ended."""
        self._reader.join(PATIENCE_S)
        return " ".join(line["told"] for line in self._said if line.get("told", "").startswith("failed"))

    def _read(self, check: subprocess.Popen[str]) -> None:
        assert check.stdout is not None
        for line in check.stdout:
            self._said.append(json.loads(line))


def _await_step(lines: _Lines, name: str) -> None:
    """Until the step has begun: the questions of rest come at its end, and pacing has none of its own."""
    if name == "rest":
        return
    while not lines.wait_for("asked")["asked"].startswith(ASKED.get(name, name)):
        pass


def _begun(step: str, output: Path) -> Callable[[], bool]:
    """Whether a set value stands, in the steps that have one."""

    def stands(now: Output) -> bool:
        if step in ("drive", "dead_man"):
            return now.volts != 0.0 and now.enabled
        return now.volts != 0.0 or step not in DRIVING

    return lambda: stands(read_output(output))


def _wait(condition: Callable[[], bool], pause: float, check: subprocess.Popen[str] | None = None) -> None:
    """Until it is so, or the check, which has to bring it about, has ended."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if check is not None and check.poll() is not None:
            raise NotSoFar
        assert time.monotonic() < end, "the bench was not at rest in time"
        time.sleep(pause)


def _all_gone(pids: list[int], check: subprocess.Popen[str]) -> bool:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        check.poll()
        if not any(psutil.pid_exists(pid) for pid in pids):
            return True
        time.sleep(0.01)
    return False

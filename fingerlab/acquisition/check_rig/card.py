"""What is assumed about the card, measured on the card, through the loop that drives it.

``fingerlab.devices.ni`` names an assumption by its id where it relies on it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.acquisition.check_rig.look import CONFIRMED, FAILED, NOTED, SKIPPED, YES, Look, Outcome
from fingerlab.acquisition.control.commands import TryOutput
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Number, Slot


@dataclass(frozen=True)
class Assumption:
    """One statement about the card, and what happens to the bench where it is wrong."""

    id: str
    text: str
    otherwise: str


PACED_BY_THE_CARD = Assumption(
    "paced-by-the-card",
    "A blocking read in hardware-timed single-point mode returns once a cycle, at the card's sample clock.",
    "Set timing = 'buffered' in the rig file's [daq]; the position loop then runs at 100 to 200 Hz.",
)
LATE_WRITE_IS_LOST = Assumption(
    "late-write-is-lost",
    "A write to a clock-timed output never reaches the terminal once its clock has stopped, and the output "
    "may hold its last value when its task ends.",
    "The stop does not rely on it; the finding is only noted.",
)
FRESH_TASK_REACHES_THE_OUTPUT = Assumption(
    "fresh-task-reaches-the-output",
    "A fresh on-demand task brings the output to 0 V and the enable line low in whatever state the timed "
    "tasks were left.",
    "Do not drive the motor from this card; the stop would not stop it.",
)

PACE_SECONDS = 2.0
PACE_TOLERANCE = 0.01
"""Share by which the mean cycle may differ: clocks differ by less than 0.02 %, a free loop by far more."""

LEFT_VOLTS = 0.2
"""V that are left standing at the output, with the amplifier off, to see what the card does with them."""
SAME_VOLTS = 0.02
"""V within which two readings of the output are the same: offset of the card's inner channel (assumed)."""


PACING = f"assumption/{PACED_BY_THE_CARD.id}"
HELD = f"assumption/{LATE_WRITE_IS_LOST.id}"
CLEARED = f"assumption/{FRESH_TASK_REACHES_THE_OUTPUT.id}"
PACING_TITLES = {PACING: PACED_BY_THE_CARD.text}
OUTPUT_TITLES = {HELD: LATE_WRITE_IS_LOST.text, CLEARED: FRESH_TASK_REACHES_THE_OUTPUT.text}


def pacing(look: Look) -> Iterator[Outcome]:
    """Thousands of cycles against a clock that is not the card's."""
    rate, block = look.bench.rate_hz, look.bench.board[Slot.HOLD]
    look.rows(0.02 * block)  # the first cycles make up for the start
    rows = look.rows(PACE_SECONDS)
    index = rows[:, COLUMN["index"]]
    cycles = int(index[-1] - index[0])
    taken = float(rows[1:, COLUMN["cycle_time"]].sum())
    period = taken / cycles * rate
    lateness = rows[:, COLUMN["lateness"]]
    measured = {
        "cycles": cycles,
        "seconds": taken,
        "lost": cycles + 1 - len(rows),
        "lateness_max": float(lateness.max(initial=0.0, where=~np.isnan(lateness))),
        "samples_a_block": block,
    }
    if abs(period - 1.0) > PACE_TOLERANCE:
        sentence = (
            f"A cycle took {1000 * taken / cycles:.3f} ms instead of {1000 / rate:g} ms. "
            f"{PACED_BY_THE_CARD.otherwise}"
        )
        state = FAILED
    elif block > 1:
        sentence = f"The card is read in blocks of {block}; single points were not tried. Blocks are paced."
        state = NOTED
    else:
        sentence = f"{cycles} cycles took {taken:.3f} s, {measured['lost']} were lost."
        state = CONFIRMED
    yield Outcome(PACING, PACED_BY_THE_CARD.text, state, sentence, measured=measured)


def output(look: Look) -> Iterator[Outcome]:
    """Leave volts standing, stop the clock, write too late, look; then clear them by the fresh task."""
    question = "Switch the amplifier's power off; 0.2 V will stand at the set value for a moment. Is it off?"
    answer = look.operator.ask("assumptions", question)
    if answer != YES:
        for step, title in OUTPUT_TITLES.items():
            yield Outcome(step, title, SKIPPED, "The operator left it out.", question, answer)
        return
    look.ask(TryOutput(LEFT_VOLTS))
    board = look.bench.board
    left, cleared = board.number(Number.LEFT), board.number(Number.CLEARED)
    confirmed = bool(board[Slot.SAFE])
    measured = {"written": LEFT_VOLTS, "after_stop": left, "after_fresh_task": cleared}
    yield _held(left, measured, question)
    if math.isnan(cleared):
        ask = "This card cannot read its own output: measure it. Are there 0 V at the set value's terminal?"
        answer = look.operator.ask(CLEARED, ask)
        good = confirmed and answer == YES
        asked = (ask, answer)
    else:
        good, asked = confirmed and abs(cleared) <= SAME_VOLTS, (question, YES)
    sentence = f"After the fresh task there are {_volts(cleared)} at the output."
    if not good:
        sentence = (
            f"After the fresh task there are {_volts(cleared)}. {FRESH_TASK_REACHES_THE_OUTPUT.otherwise}"
        )
    state = CONFIRMED if good else FAILED
    yield Outcome(CLEARED, OUTPUT_TITLES[CLEARED], state, sentence, *asked, measured)


def _held(left: float, measured: dict[str, Any], question: str) -> Outcome:
    step, text = HELD, LATE_WRITE_IS_LOST.text
    if math.isnan(left):
        sentence = f"This card cannot read its own output. {LATE_WRITE_IS_LOST.otherwise}"
        return Outcome(step, text, NOTED, sentence, question, YES, measured)
    if math.isclose(left, LEFT_VOLTS, abs_tol=SAME_VOLTS):
        return Outcome(step, text, CONFIRMED, f"{_volts(left)} stayed standing.", question, YES, measured)
    sentence = f"Of {LEFT_VOLTS:g} V there were {_volts(left)} left. {LATE_WRITE_IS_LOST.otherwise}"
    return Outcome(step, text, NOTED, sentence, question, YES, measured)


def _volts(value: float) -> str:
    return "an unknown voltage" if math.isnan(value) else f"{value:.3f} V"

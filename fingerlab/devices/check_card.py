"""The three assumptions about the card, measured on the card."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from fingerlab.devices.checking import (
    CONFIRMED,
    FAILED,
    NO,
    NOT_HERE,
    NOTED,
    SKIPPED,
    YES,
    Bench,
    Outcome,
)
from fingerlab.devices.ni.assumptions import (
    ASSUMPTIONS,
    FRESH_TASK_REACHES_THE_OUTPUT,
    LATE_WRITE_IS_LOST,
    PACED_BY_THE_CARD,
)
from fingerlab.devices.protocol import cycles_per_command

PACE_CYCLES = 2000
PACE_TOLERANCE = 0.01
"""Share by which the mean cycle may differ: clocks differ by less than 0.02 %, a free loop by far more."""

LEFT_VOLTS = 0.2
"""V that are left standing at the output, with the amplifier off, to see what the card does with them."""
SAME_VOLTS = 0.02
"""V within which two readings of the output are the same: offset of the card's inner channel (assumed)."""


def assumptions(bench: Bench) -> Iterator[Outcome]:
    """Pacing, what a stopped clock leaves standing, and whether the fresh task clears it."""
    if not hasattr(bench.device, "read_back_output"):
        for one in ASSUMPTIONS:
            yield Outcome(f"assumption/{one.id}", one.text, NOT_HERE, "Only a card can show it.")
        return
    yield _pacing(bench)
    question = "Switch the amplifier's power off; 0.2 V will stand at the set value for a moment. Is it off?"
    answer = bench.operator.ask("assumptions", question)
    if answer != YES:
        for one in (LATE_WRITE_IS_LOST, FRESH_TASK_REACHES_THE_OUTPUT):
            text = "The operator left it out."
            yield Outcome(f"assumption/{one.id}", one.text, SKIPPED, text, question, answer)
        return
    yield from _stopping(bench, bench.device, question)


def _pacing(bench: Bench) -> Outcome:
    """Thousands of cycles against a clock that is not the card's."""
    device, step = bench.device, f"assumption/{PACED_BY_THE_CARD.id}"
    block = cycles_per_command(device)
    device.start()
    try:
        for _ in range(10 * block):
            first = device.exchange(0.0)
        begun = bench.clock.now()
        samples = [device.exchange(0.0) for _ in range(PACE_CYCLES)]
        taken = bench.clock.now() - begun
    finally:
        device.make_safe()
    cycles = samples[-1].index - first.index
    period = taken / cycles * device.rate_hz
    measured = {
        "cycles": cycles,
        "seconds": taken,
        "lost": cycles - PACE_CYCLES,
        "lateness_max": float(np.nanmax([s.lateness for s in samples])),
        "samples_a_block": block,
    }
    if abs(period - 1.0) > PACE_TOLERANCE:
        sentence = (
            f"A cycle took {1000 * taken / cycles:.3f} ms instead of {1000 / device.rate_hz:g} ms. "
            f"{PACED_BY_THE_CARD.otherwise}"
        )
        return Outcome(step, PACED_BY_THE_CARD.text, FAILED, sentence, measured=measured)
    if block > 1:
        sentence = f"The card is read in blocks of {block}; single points were not tried. Blocks are paced."
        return Outcome(step, PACED_BY_THE_CARD.text, NOTED, sentence, measured=measured)
    sentence = f"{cycles} cycles took {taken:.3f} s, {measured['lost']} were lost."
    return Outcome(step, PACED_BY_THE_CARD.text, CONFIRMED, sentence, measured=measured)


def _stopping(bench: Bench, card: Any, question: str) -> Iterator[Outcome]:
    """Leave volts standing, stop the clock, write too late, look; then clear them by the fresh task."""
    card.start()
    for _ in range(20 * cycles_per_command(card)):
        card.exchange(LEFT_VOLTS)
    card.abandon(late_write=0.0 if cycles_per_command(card) == 1 else None)
    left = card.read_back_output()
    confirmed = card.make_safe()
    cleared = card.read_back_output()
    measured = {"written": LEFT_VOLTS, "after_stop": left, "after_fresh_task": cleared}
    yield _held(left, measured, question)
    step, text = f"assumption/{FRESH_TASK_REACHES_THE_OUTPUT.id}", FRESH_TASK_REACHES_THE_OUTPUT.text
    if cleared is None:
        ask = "This card cannot read its own output: measure it. Are there 0 V at the set value's terminal?"
        answer = bench.operator.ask(step, ask)
        good = confirmed and answer == YES
        asked = (ask, answer if answer != NO else NO)
    else:
        good, asked = confirmed and abs(cleared) <= SAME_VOLTS, (question, YES)
    sentence = (
        f"After the fresh task there are {_volts(cleared)} at the output."
        if good
        else f"After the fresh task there are {_volts(cleared)}. {FRESH_TASK_REACHES_THE_OUTPUT.otherwise}"
    )
    yield Outcome(step, text, CONFIRMED if good else FAILED, sentence, *asked, measured)


def _held(left: float | None, measured: dict[str, Any], question: str) -> Outcome:
    step, text = f"assumption/{LATE_WRITE_IS_LOST.id}", LATE_WRITE_IS_LOST.text
    if left is None:
        sentence = f"This card cannot read its own output. {LATE_WRITE_IS_LOST.otherwise}"
        return Outcome(step, text, NOTED, sentence, question, YES, measured)
    if math.isclose(left, LEFT_VOLTS, abs_tol=SAME_VOLTS):
        return Outcome(step, text, CONFIRMED, f"{_volts(left)} stayed standing.", question, YES, measured)
    sentence = f"Of {LEFT_VOLTS:g} V there were {_volts(left)} left. {LATE_WRITE_IS_LOST.otherwise}"
    return Outcome(step, text, NOTED, sentence, question, YES, measured)


def _volts(value: float | None) -> str:
    return "an unknown voltage" if value is None else f"{value:.3f} V"

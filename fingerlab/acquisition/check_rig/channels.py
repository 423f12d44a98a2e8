"""Channels at rest, moved by hand and against what is known, and the card under them. Nothing is driven.

``fingerlab.devices.ni`` names an assumption by its id where it relies on it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.acquisition.check_rig.look import (
    CONFIRMED,
    FAILED,
    NOT_HERE,
    NOTED,
    SKIPPED,
    YES,
    Look,
    Outcome,
    asked,
)
from fingerlab.acquisition.control.machine import TryOutput
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Number, Slot
from fingerlab.rig.daq import AnalogInput, encoder_wires, second_terminal

REST_SECONDS = 1.0
HAND_SECONDS = 4.0
"""s that the operator has for a movement (assumed)."""

QUIET_VOLTS = 0.1
"""V, standard deviation at rest above which a wire is loose or unshielded (assumed)."""

END_SHARE = 0.01
"""A reading within this share of the range's end is at the end: nothing connected, or too much."""

TURN_TOLERANCE = 0.1
"""Share of a turn that a hand may miss (assumed)."""

CHANNELS = ("load_cell", "mcp", "pip", "current_monitor")
TITLES = {
    "load_cell": "load cell",
    "mcp": "MCP sensor",
    "pip": "PIP sensor",
    "current_monitor": "current monitor",
}
UNITS = {"load_cell": (1.0, "N"), "mcp": (180 / math.pi, "°"), "pip": (180 / math.pi, "°")}
HANDS = {
    "load_cell": ("Press the load cell with a finger, firmly", 3.0, 1.0),
    "mcp": (
        "Flex the MCP joint by hand by about 30 degrees, the PIP joint as little as possible",
        0.52,
        0.17,
    ),
    "pip": (
        "Flex the PIP joint by hand by about 30 degrees, the MCP joint as little as possible",
        0.52,
        0.17,
    ),
}
"""What to do, how much of it the simulated operator does, and how much must at least be seen (N, rad)."""


KNOWN = {
    "load_cell": (
        "Lay a known weight of 200 g on the load cell, where the fingertip presses",
        0.2 * 9.81,
        0.1,
    ),
    "mcp": ("Flex the MCP joint by 30 degrees more than at rest, by a set square", math.radians(30.0), 0.2),
    "pip": ("Flex the PIP joint by 30 degrees more than at rest, by a set square", math.radians(30.0), 0.2),
}
"""What to do, how much it is (N, rad), and the share by which a right scaling may miss it: a weight that is
not quite in the axis, a joint that is held by hand (assumed)."""


def channels_at_rest(look: Look) -> Iterator[Outcome]:
    """Every analog channel reads something, quietly, and not at the end of its range."""
    raw = look.watch(REST_SECONDS)
    look.rest, look.rest_spread = raw.mean(axis=0), raw.std(axis=0)
    for k, name in enumerate(CHANNELS):
        channel = look.rig.daq.inputs[k]
        title = f"{_sentence_case(TITLES[name])} at rest, {_wires(channel)}"
        if not channel.terminal:
            yield Outcome(f"rest/{name}", title, NOT_HERE, "The rig file has no such channel.")
            continue
        volts, spread = float(look.rest[k]), float(look.rest_spread[k])
        measured = {"volts": volts, "spread": spread, "quantity": channel.quantity(volts)}
        fault = _fault_at_rest(channel, volts, spread)
        if fault:
            yield Outcome(f"rest/{name}", title, FAILED, fault, measured=measured)
            continue
        shown = (
            f"The {TITLES[name]} reads {_shown(name, channel.quantity(volts))} ({volts:.3f} V at "
            f"{channel.terminal}, noise {1000 * spread:.1f} mV)."
        )
        doubt = "Is that right for a bench at rest?"
        yield asked(look, f"rest/{name}", title, shown, doubt, measured)


@dataclass(frozen=True)
class _Task:
    """What the operator is to do by hand, for one channel."""

    step: str
    title: str
    question: str

    def outcome(self, state: str, sentence: str, measured: dict[str, Any], answer: str = YES) -> Outcome:
        return Outcome(self.step, self.title, state, sentence, self.question, answer, measured)


def channels_moved(look: Look) -> Iterator[Outcome]:
    """The right channel answers to a hand, in the right direction."""
    for k, name in enumerate(CHANNELS[:3]):
        act, amount, least = HANDS[name]
        question = f"{act}, within {HAND_SECONDS:g} s from your 'yes'. Ready?"
        task = _Task(f"moved/{name}", f"{_sentence_case(TITLES[name])} moved by hand", question)
        raw = _by_hand(look, k, task, amount)
        yield raw if isinstance(raw, Outcome) else _judge_movement(look, k, raw, least, task)


def scaling(look: Look) -> Iterator[Outcome]:
    """A known weight and a known angle read as what they are."""
    for k, name in enumerate(CHANNELS[:3]):
        act, amount, tolerance = KNOWN[name]
        question = f"{act}, within {HAND_SECONDS:g} s from your 'yes', and leave it so. Ready?"
        task = _Task(f"scale/{name}", f"{_sentence_case(TITLES[name])}, scaling", question)
        raw = _by_hand(look, k, task, amount)
        yield raw if isinstance(raw, Outcome) else _judge_scaling(look, k, raw, amount, tolerance, task)


def encoder_turned(look: Look) -> Iterator[Outcome]:
    """One turn by hand gives the counts of the rig file, and the sign too."""
    encoder = look.rig.daq.encoder
    title = f"Encoder, {encoder.terminal}: {encoder_wires(encoder)}"
    question = (
        f"Turn the pulley by hand by one whole turn in the direction that winds the cable, within "
        f"{HAND_SECONDS:g} s from your 'yes'. Ready?"
    )
    answer = look.operator.ask("encoder", question)
    if answer != YES:
        yield Outcome("encoder", title, SKIPPED, "The operator left it out.", question, answer)
        return
    raw = look.watch(HAND_SECONDS, hand=("encoder", 2.0 * math.pi))
    counts = float(raw[-1, 4] - raw[0, 4])
    measured = {"counts": counts, "expected": encoder.sign * encoder.counts_per_turn}
    share = counts / measured["expected"]
    if abs(share - 1.0) <= TURN_TOLERANCE:
        sentence, state = f"One turn gave {counts:.0f} counts.", CONFIRMED
    elif abs(share + 1.0) <= TURN_TOLERANCE:
        sentence = f"One turn gave {counts:.0f} counts: turn the sign of [daq.encoder] around."
        state = FAILED
    else:
        sentence = (
            f"One turn gave {counts:.0f} counts where {measured['expected']:.0f} were expected; correct "
            "counts_per_turn or the encoder's wiring, and check again."
        )
        state = FAILED
    yield Outcome("encoder", title, state, sentence, question, answer, measured)


def _wires(channel: AnalogInput) -> str:
    """``ai0 against ai8``: both terminals, where a card's are told."""
    second = second_terminal(channel)
    return f"{channel.terminal or 'no terminal'}{f' against {second}' if second else ''}"


def _fault_at_rest(channel: AnalogInput, volts: float, spread: float) -> str:
    if math.isnan(volts):
        return "It gives no number; check the terminal in the rig file's [daq]."
    edge = END_SHARE * (channel.high - channel.low)
    if not channel.low + edge < volts < channel.high - edge:
        return f"It reads {volts:.3f} V, the end of its range; check supply and wiring."
    if spread > QUIET_VOLTS:
        return f"It wanders by {1000 * spread:.0f} mV at rest; check shield and wiring."
    return ""


def _by_hand(look: Look, k: int, task: _Task, amount: float) -> Any | Outcome:
    """What was read meanwhile, shape (n, channels), V and counts; an outcome where nothing was done."""
    if not look.rig.daq.inputs[k].terminal:
        return Outcome(task.step, task.title, NOT_HERE, "The rig file has no such channel.")
    if math.isnan(look.rest[k]):
        return Outcome(task.step, task.title, SKIPPED, "The channel could not be read at rest.")
    answer = look.operator.ask(task.step, task.question)
    if answer != YES:
        return task.outcome(SKIPPED, "The operator left it out.", {}, answer)
    return look.watch(HAND_SECONDS, hand=(CHANNELS[k], amount))


def _judge_scaling(look: Look, k: int, raw: Any, amount: float, tolerance: float, task: _Task) -> Outcome:
    name, channel = CHANNELS[k], look.rig.daq.inputs[k]
    last = raw[-len(raw) // 4 :, k].mean()
    shown = float(channel.gain * channel.sign * (last - look.rest[k]))
    measured = {"shown": shown, "known": amount, "tolerance": tolerance}
    sentence = f"It shows {_shown(name, shown)} of {_shown(name, amount)}"
    if abs(shown / amount - 1.0) <= tolerance:
        return task.outcome(CONFIRMED, f"{sentence}.", measured)
    sentence += f"; calibrate it ('fingerlab calibrate'), or correct its gain and sign in [daq.{name}]."
    return task.outcome(FAILED, sentence, measured)


def _judge_movement(look: Look, k: int, raw: Any, least: float, task: _Task) -> Outcome:
    name, channel = CHANNELS[k], look.rig.daq.inputs[k]
    moved = channel.gain * channel.sign * (raw[:, :3] - look.rest[:3])
    peak = moved[np.nanargmax(np.abs(moved[:, k])), k] if not np.isnan(moved[:, k]).all() else math.nan
    swings = np.abs(np.nan_to_num(raw[:, :3] - look.rest[:3])).max(axis=0)
    measured = {"peak": float(peak), "volts": {CHANNELS[j]: float(swings[j]) for j in range(3)}}
    other = int(np.argmax(swings))
    sentence = f"It moved by {_shown(name, float(peak))}"
    if not abs(peak) >= least:
        loudest = (
            f"; the {TITLES[CHANNELS[other]]} moved instead" if other != k and swings[other] > 0.1 else ""
        )
        return task.outcome(FAILED, f"{sentence} only{loudest}; check its terminal and wiring.", measured)
    if peak < 0:
        sentence += ": turn its sign in the rig file's [daq] around."
        return task.outcome(FAILED, sentence, measured)
    if other != k and swings[other] > 1.5 * swings[k]:
        sentence = f"The {TITLES[CHANNELS[other]]} moved by more; check whether the terminals are swapped."
        return task.outcome(FAILED, sentence, measured)
    return task.outcome(CONFIRMED, f"{sentence}.", measured)


def _shown(name: str, quantity: float) -> str:
    factor, unit = UNITS.get(name, (1.0, "A"))
    rounded = round(factor * quantity, 2) + 0.0  # no "-0.00"
    return f"{rounded:.2f} {unit}".replace(" °", "°")


def _sentence_case(text: str) -> str:
    return text[0].upper() + text[1:]


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

"""The steps that take the current away or let it flow: digital lines, limits, driving and stopping."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from fingerlab.acquisition.check_rig.channels import HAND_SECONDS
from fingerlab.acquisition.check_rig.look import (
    CONFIRMED,
    FAILED,
    NOT_HERE,
    SKIPPED,
    TEST_CURRENT,
    YES,
    Driven,
    Look,
    Outcome,
    asked,
)
from fingerlab.acquisition.control.machine import Mode, Release, Reset
from fingerlab.acquisition.ring import RowFlag
from fingerlab.acquisition.status import Input, Slot
from fingerlab.rig.file import Rig
from fingerlab.rig.limits import BENCH_LIMITS, LIMIT_UNITS

EMERGENCY_STOP, READY, DEAD_MAN = "lines/emergency_stop", "lines/amplifier_ready", "drive/dead_man"
LINE_STEPS = (EMERGENCY_STOP, READY)
DEAD_MAN_TITLES = {DEAD_MAN: "No current without the dead-man's beat"}

HELD_CURRENT = 0.5 * TEST_CURRENT
"""A, to and fro: it is to be seen, and needs no motion, which would end the test before a slow pump does."""

HALF_PERIOD = 0.03
"""s between two changes of its sign: a free motor then swings by less than a degree (RE40's rotor)."""

SOFTLY = 0.01
"""s of its rise."""

HELD_AFTER = 0.2
"""s after which the beat ends: the current has been seen."""

HOLD_TOLERANCE = 0.2
"""Share by which the hold time may miss the rig file's: parts of 5 and 1 % make it 7 % (docs/rig.md), the
monitor's filter and a sample or two come on top (assumed)."""

NOT_WIRED = "The rig file has no such line."


def inputs(look: Look) -> Iterator[Outcome]:
    """Emergency stop and "amplifier ready" are seen to change, and to change back. Nothing is driven."""
    stop, ready = look.rig.daq.emergency_stop, look.rig.daq.amplifier_ready
    if stop.terminal:
        yield _emergency_stop(look, f"Emergency stop, {stop.terminal}")
    else:
        yield Outcome(EMERGENCY_STOP, "Emergency stop", NOT_HERE, NOT_WIRED)
    if ready.terminal:
        yield _amplifier_ready(look, f"Amplifier ready, {ready.terminal}", ready.needs_enable)
    else:
        yield Outcome(READY, "Amplifier ready", NOT_HERE, NOT_WIRED)


def _emergency_stop(look: Look, title: str) -> Outcome:
    step, question = EMERGENCY_STOP, _in_time("Press the emergency stop and leave it pressed")
    before = look.bench.status().emergency_stop
    if before is Input.YES:
        sentence = (
            "It reads pressed before anybody has pressed it; release it, or correct its terminal, contact or "
            "active_high in the rig file's [daq.emergency_stop]."
        )
        return Outcome(step, title, FAILED, sentence)
    answer = look.operator.ask(step, question)
    if answer != YES:
        return Outcome(step, title, SKIPPED, "The operator left it out.", question, answer)
    pressed = look.line("emergency_stop", True, HAND_SECONDS)
    in_fault = look.bench.status().mode is Mode.FAULT
    look.operator.ask(step, _in_time("Release the emergency stop at its button"))
    released = not look.line("emergency_stop", False, HAND_SECONDS)
    if in_fault and released:
        look.ask(Reset())
    measured = {"pressed_seen": pressed, "released_seen": released, "bench_stopped": in_fault}
    if not pressed:
        sentence = "It still read released; check terminal, contact and active_high in the rig file's [daq]."
    elif not released:
        sentence = "It still read pressed after it was released; check its button and its wires."
    elif not in_fault:
        sentence = "It was seen to be pressed and the bench was not stopped; do not drive the motor."
    else:
        return Outcome(step, title, CONFIRMED, "Pressed and released, and seen.", question, answer, measured)
    return Outcome(step, title, FAILED, sentence, question, answer, measured)


def _amplifier_ready(look: Look, title: str, needs_enable: bool) -> Outcome:
    """Not ready without its supply; ready with it, or only once enabled, which the drive then waits for."""
    step, question = READY, _in_time("Switch the amplifier's supply off")
    answer = look.operator.ask(step, question)
    if answer != YES:
        return Outcome(step, title, SKIPPED, "The operator left it out.", question, answer)
    off = not look.line("amplifier_ready", False, HAND_SECONDS)
    look.operator.ask(step, _in_time("Switch the amplifier's supply on again"))
    on = look.line("amplifier_ready", True, HAND_SECONDS)
    measured = {"not_ready_seen": off, "ready_seen": on}
    check = "check its terminal, wiring and active_high in the rig file's [daq.amplifier_ready]."
    if not off:
        state, sentence = FAILED, f"It read ready without its supply; {check}"
    elif on:
        state, sentence = CONFIRMED, "Not ready without its supply, and ready with it."
    elif needs_enable:
        state, sentence = CONFIRMED, "Not ready without its supply; that it gets ready shows in the drive."
    else:
        state, sentence = FAILED, f"It did not read ready with its supply on; {check}"
    return Outcome(step, title, state, sentence, question, answer, measured)


def _in_time(act: str) -> str:
    return f"{act}, within {HAND_SECONDS:g} s from your 'yes'. Ready?"


def dead_man(look: Look) -> Iterator[Outcome]:
    """The test current flows, the beat ends as in a loop that hangs, and the current ends with the pump."""
    daq, title = look.rig.daq, DEAD_MAN_TITLES[DEAD_MAN]
    if not daq.current_monitor.terminal:
        why = "The rig file has no current monitor, without which the loop drives no motor; connect one."
        yield Outcome(DEAD_MAN, title, SKIPPED, why)
        return
    question = (
        "Hold the pulley until it stands, then keep hands away: the motor will be pushed to and fro with "
        f"{HELD_CURRENT:g} A; after {HELD_AFTER:g} s the dead-man's line stands still while enable is high, "
        "as where the computer hangs, and the amplifier has to let go by itself. May it?"
    )
    answer = look.operator.ask(DEAD_MAN, question)
    if answer != YES:
        yield Outcome(DEAD_MAN, title, SKIPPED, "The operator left it out.", question, answer)
        return
    course = _to_and_fro(HELD_AFTER + 2.0 * daq.dead_man.hold_time + 2.0 * HALF_PERIOD)
    driven = look.drive(course, SOFTLY, test_travel(look.rig), held_after=HELD_AFTER)
    if look.bench.status().mode is Mode.FAULT:
        look.ask(Reset())
    measured, state, sentence = _judge_dead_man(look, driven)
    yield Outcome(DEAD_MAN, title, state, sentence, question, answer, measured)


def _to_and_fro(seconds: float) -> list[tuple[float, float]]:
    """The current's course: begun with half a stroke, so that the motor swings about where it is."""
    course, moment, amps = [(0.0, HELD_CURRENT)], 0.5 * (HALF_PERIOD + SOFTLY), HELD_CURRENT
    while moment < seconds:
        course += [(moment, amps), (moment + 1e-3, -amps)]
        moment, amps = moment + HALF_PERIOD, -amps
    return [*course, (moment + HALF_PERIOD, amps)]


def _judge_dead_man(look: Look, driven: Driven) -> tuple[dict[str, Any], str, str]:
    wanted, period = look.rig.daq.dead_man.hold_time, 1.0 / look.bench.rate_hz
    measured: dict[str, Any] = {"hold_time": math.nan, "expected": wanted}
    enabled = (driven.column("flags").astype(np.int64) & RowFlag.ENABLED) != 0
    index, flows = driven.column("index"), np.abs(driven.column("motor_current")) > 0.5 * HELD_CURRENT
    held = index >= driven.held_at
    if np.count_nonzero(flows & enabled & ~held) * period < 0.5 * HELD_AFTER:
        why = f": {driven.fault}" if driven.fault else "; check power, enable line and the dead-man's pump."
        return measured, FAILED, f"No current flowed while the line was beating{why}"
    unready = held & (driven.column("raw/amplifier_ready") == 0.0)  # where it tells of the enable itself
    last = float(index[enabled][-1])
    if unready.any():
        ended = float(index[unready][0])
    elif driven.fault:
        return measured, FAILED, f"The loop stopped the motor before the dead-man did: {driven.fault}"
    else:
        ended = float(index[flows & enabled][-1]) + 1.0
    if not unready.any() and (last - ended) * period < HALF_PERIOD:
        sentence = (
            f"{HELD_CURRENT:g} A went on flowing for {1e3 * period * (last - driven.held_at):.0f} ms without "
            "the beat, until enable was dropped; look for a comparator stuck high or a pump that is bridged "
            "(docs/rig.md, A dead-man)."
        )
        return measured, FAILED, sentence
    hold_time = measured["hold_time"] = (ended - driven.held_at) * period
    shown = f"Without the beat the current ended after {1e3 * hold_time:.0f} ms"
    since_charged = 2 * look.bench.board[Slot.HOLD] * period  # the last edge that fed the pump
    if (1.0 - HOLD_TOLERANCE) * wanted - since_charged <= hold_time <= (1.0 + HOLD_TOLERANCE) * wanted:
        return measured, CONFIRMED, f"{shown}."
    sentence = (
        f"{shown}, not {1e3 * wanted:.0f} ms; correct the parts of its pump, or hold_time in the rig file's "
        "[daq.dead_man]."
    )
    return measured, FAILED, sentence


RISE_SECONDS = 0.1
MOST_SECONDS = 1.0
STEADY = ((0.0, TEST_CURRENT), (MOST_SECONDS, TEST_CURRENT))
TEST_TRAVEL = math.radians(45.0)
"""Where the test ends; a motor at 13 rad/s turns some 20 degrees further until it is told."""
LEAST_TRAVEL = math.radians(1.0)
"""Less is no motion: play of the gearbox (assumed)."""
CURRENT_TOLERANCE = 0.2
"""Share by which the monitor may differ from the command: the data sheet says "about 0.8 V/A"."""
WHOLE = 0.9
"""From this share on the test current counts as reached; in its rise the monitor lags behind (assumed)."""
STOP_SECONDS = 1.0
"""A stop that the loop has not answered after this is none."""

DISABLED, DIRECTION, MONITOR = "drive/disabled", "drive/direction", "drive/monitor"
DRIVE_TITLES = {
    DISABLED: "No current without enable",
    DIRECTION: "Positive set value winds the cable",
    MONITOR: "Current monitor against set value",
}


def limits(look: Look) -> Iterator[Outcome]:
    """Every limit of the rig file, one by one."""
    held = look.rig.limits
    for name in BENCH_LIMITS:
        unit = LIMIT_UNITS[name]
        value = getattr(held, name)
        in_degrees = unit.startswith("rad")
        number, degrees = math.degrees(value) if in_degrees else value, unit.replace("rad", "°")
        shown = f"{number:.4g}{'' if degrees == '°' else ' '}{degrees}"
        called = name.replace("_", " ").replace("mcp", "MCP angle").replace("pip", "PIP angle")
        source = held.sources.get(name, "FingerLab's default")
        limit, doubt = f"The limit {called} is {shown} ({source}).", "Is it right for this bench?"
        yield asked(look, f"limits/{name}", f"Limit {called}", limit, doubt, {"value": value})


def drive(look: Look) -> Iterator[Outcome]:
    """No current without enable; with it the current, the monitor and the motion have one sign."""
    if not look.rig.daq.current_monitor.terminal:
        why = "The rig file has no current monitor, without which the loop drives no motor; connect one."
        yield from (Outcome(step, title, SKIPPED, why) for step, title in DRIVE_TITLES.items())
        return
    question = (
        "Switch the amplifier's power on, take the cable off the pulley and keep hands away: the motor will "
        f"turn with at most {TEST_CURRENT:g} A for at most {MOST_SECONDS:g} s. May it?"
    )
    answer = look.operator.ask("drive", question)
    if answer != YES:
        for step, title in DRIVE_TITLES.items():
            yield Outcome(step, title, SKIPPED, "The operator left it out.", question, answer)
        return
    disabled = _judge_disabled(look, _turn(look, line=False), question)
    yield disabled
    if disabled.open:
        for step in (DIRECTION, MONITOR):
            why = f"Left out, for {DISABLED} failed; mend that and run check-rig again."
            yield Outcome(step, DRIVE_TITLES[step], SKIPPED, why, question, answer)
        return
    yield from _judge_drive(_turn(look, line=True), question)


def stop(look: Look) -> Iterator[Outcome]:
    """The latched stop: the device confirms 0 V and a low enable line, and the operator sees it."""
    bench = look.bench
    bench.stop()
    look.until(lambda: bench.status().latched, STOP_SECONDS, "The stop")
    safe = bench.status().safe_confirmed
    title = "Stop"
    if not safe:
        yield Outcome("stop", title, FAILED, "The device does not confirm 0 V and a low enable line.")
    else:
        shown = "The device confirms 0 V and a low enable line."
        doubt = "Is the amplifier's enable light off?"
        yield asked(look, "stop", title, shown, doubt, {"confirmed_by_device": safe})
    look.ask(Release())


def test_travel(rig: Rig) -> float:
    """Angle (rad) after which the current is switched off: well within what the loop lets pass."""
    return min(TEST_TRAVEL, 0.9 * rig.limits.position_high)


def _turn(look: Look, line: bool) -> Driven:
    driven = look.drive(STEADY, RISE_SECONDS, test_travel(look.rig), line)
    if look.bench.status().mode is Mode.FAULT:
        look.ask(Reset())
    return driven


def _judge_disabled(look: Look, driven: Driven, question: str) -> Outcome:
    title = DRIVE_TITLES[DISABLED]
    asked_for = _mean_under_current(driven, "current_command")
    current = _mean_under_current(driven, "motor_current")
    travel = float(np.ptp(driven.column("motor_position"))) if len(driven.rows) else math.nan
    measured = {"current": current, "commanded": asked_for, "travel": travel}
    if abs(current) > 0.25 * TEST_CURRENT or travel > LEAST_TRAVEL:
        state = FAILED
        sentence = (
            f"With the enable line low {current:.2f} A flowed and the motor turned by "
            f"{math.degrees(travel):.1f}°; check the enable line's terminal and active_high in the rig "
            "file's [daq]."
        )
    elif driven.fault or math.isnan(current + travel):
        state, sentence = FAILED, f"The loop broke the test off: {driven.fault}"
    else:
        state, sentence = CONFIRMED, "Nothing moved."
    return Outcome(DISABLED, title, state, sentence, question, YES, measured)


def _judge_drive(driven: Driven, question: str) -> Iterator[Outcome]:
    position = driven.column("motor_position")
    travel = float(position[-1] - position[0]) if len(position) else math.nan
    measured: dict[str, float] = {"travel": travel}
    if travel < -LEAST_TRAVEL:
        state = FAILED
        sentence = "The pulley turned backwards: turn the command's sign in the rig file's [daq] around."
    elif not travel > LEAST_TRAVEL:
        state = FAILED
        sentence = "The pulley did not turn; check power, enable line and the set value's terminal."
    elif driven.fault:
        state, sentence = FAILED, f"The loop stopped the motor: {driven.fault}"
    else:
        state = CONFIRMED
        sentence = f"The pulley turned by {math.degrees(travel):.0f}° in the winding direction."
    yield Outcome(DIRECTION, DRIVE_TITLES[DIRECTION], state, sentence, question, YES, measured)
    current = _mean_under_current(driven, "motor_current")
    wanted = _mean_under_current(driven, "current_command")
    measured = {"current": current, "commanded": wanted}
    share, shown = current / wanted, f"It shows {current:.2f} A of {wanted:.2f} A"
    if math.isnan(share):
        state, sentence = FAILED, "It was not seen: the motor was stopped before its current was reached."
    elif abs(share - 1.0) <= CURRENT_TOLERANCE:
        state, sentence = CONFIRMED, f"{shown}."
    elif abs(share + 1.0) <= CURRENT_TOLERANCE:
        state, sentence = FAILED, f"{shown}: turn the monitor's sign in the rig file's [daq] around."
    else:
        state = FAILED
        sentence = (
            f"{shown}; correct the gain of the command or of the monitor in the rig file's [daq], by the "
            "amplifier's settings."
        )
    yield Outcome(MONITOR, DRIVE_TITLES[MONITOR], state, sentence, question, YES, measured)


def _mean_under_current(driven: Driven, name: str) -> float:
    """Mean of a column while the whole test current was asked for; NaN where it never was."""
    under = driven.column("current_command") >= WHOLE * TEST_CURRENT
    return float(driven.column(name)[under].mean()) if under.any() else math.nan
